//! The kernel `mask`: what each feature's volume holds afterwards, which bricks hold any of it, and that others are left alone.

use cao::features::mask::{Mask, Masked};
use cao_gpu::{Access, Format};
use cao_measure::random::Random;
use cao_testing::*;
use cao_twin::field::bricks::{EDGE, bricks};

const FEATURES: usize = 3;

#[test]
fn changed_bricks_hold_each_features_own_opacity_and_others_what_they_held() {
    let mut random = Random::new(6);
    let gpu = open();
    for grid in GRIDS {
        let field = blank(&gpu, &grid);
        let (mask, masked) = (Mask::new(&gpu, &field).unwrap(), Masked::new(&gpu, &field, FEATURES).unwrap());
        let all = bricks(&grid);
        let mut volumes = vec![vec![0_u16; grid.len()]; FEATURES];
        let mut held = vec![0_u32; FEATURES * all.len()];
        for turn in 0..3 {
            let opacity: Vec<u16> =
                (0..grid.len()).map(|_| [0, 0, 40000, 65535][random.below(4) as usize]).collect();
            // Whole bricks of one, too.
            let labels: Vec<u8> = (0..grid.len())
                .map(|i| if grid.voxel(i)[0] < 8 { 2 } else { random.below(FEATURES as u64 + 1) as u8 })
                .collect();
            let change: Vec<f32> = (0..all.len()).map(|_| random.below(2) as f32).collect();
            let image = |format, content: &[u8]| {
                let image = cao::field::volume_image(&gpu, "test", &field, format).unwrap();
                write_image(&gpu, &image, content);
                image
            };
            let images =
                [image(Format::R16Unorm, bytemuck::cast_slice(&opacity)), image(Format::R8Uint, &labels)];
            let change_buffer = buffer(&gpu, "change", bytemuck::cast_slice(&change));
            run(&gpu, |rec| {
                let [opacity, labels] = &images;
                mask.record(rec, &field, turn == 0, opacity, labels, &change_buffer, &masked).unwrap();
                rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
            });
            let brick = |i: usize| all.index(grid.voxel(i).map(|c| c / EDGE));
            let written = |i: usize| turn == 0 || change[brick(i)] == 0.0;
            for (k, volume) in volumes.iter_mut().enumerate() {
                let label = k as u8 + 1;
                for i in (0..grid.len()).filter(|&i| written(i)) {
                    volume[i] = if labels[i] == label { opacity[i] } else { 0 };
                }
                let bricks = &mut held[k * all.len()..(k + 1) * all.len()];
                bricks.fill(0);
                (0..grid.len()).filter(|&i| volume[i] > 0).for_each(|i| bricks[brick(i)] = 1);
                let found: Vec<u16> = bytemuck::pod_collect_to_vec(&read_image(&gpu, &masked.images[k]));
                assert_eq!(&found, volume, "{grid:?} {turn} {label}");
            }
            let found: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &masked.held));
            assert_eq!(found, held, "{grid:?} {turn}");
        }
    }
    close(gpu);
}
