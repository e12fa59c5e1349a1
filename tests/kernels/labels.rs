//! The kernel `labels`: what it holds afterwards, and which bricks count as changed.

use cao::features::labels::Labels;
use cao::field::near::FAR;
use cao_gpu::Access;
use cao_measure::random::Random;
use cao_testing::*;
use cao_twin::field::bricks::{EDGE, bricks};

#[test]
fn bricks_with_other_features_count_as_changed_and_no_others() {
    let mut random = Random::new(5);
    for grid in GRIDS {
        let gpu = open();
        let field = blank(&gpu, &grid);
        let labels = Labels::new(&gpu, &field).unwrap();
        let all = bricks(&grid);
        let mut before = vec![0_u8; grid.len()];
        for turn in 0..4 {
            // At the last all voxels are of one.
            let mut now = if turn == 3 { vec![1; grid.len()] } else { before.clone() };
            for _ in 0..if turn == 3 { 0 } else { random.below(3) } {
                now[random.below(grid.len() as u64) as usize] = random.below(9) as u8;
            }
            let image = byte_image(&gpu, &field, &now);
            let change = buffer(&gpu, "change", bytemuck::cast_slice(&vec![FAR; all.len()]));
            run(&gpu, |rec| {
                labels.record(rec, &field, &image, &change).unwrap();
                rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
            });
            assert_eq!(read_image(&gpu, &labels.image), now, "{grid:?} {turn}");
            let mut changed = vec![FAR; all.len()];
            for i in (0..grid.len()).filter(|&i| now[i] != before[i]) {
                changed[all.index(grid.voxel(i).map(|c| c / EDGE))] = 0;
            }
            let found: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &change));
            assert_eq!(found, changed, "{grid:?} {turn}");
            before = now;
        }
        drop((field, labels));
        close(gpu);
    }
}
