//! The kernel `brick_distance` against its twin.

use cao::draw::brick_distance::BrickDistance;
use cao_gpu::Access;
use cao_measure::random::Random;
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;

/// "There is none", as the kernel writes it.
const FAR: u32 = (1 << 24) - 1;

/// The word of `clip_bricks` for a brick that the clips hide, and one that clip 2 cuts.
const HIDDEN: u32 = 0;
const CUT_BY_2: u32 = 1 | 1 << (4 + 2);
const VISIBLE: u32 = 2;

#[test]
fn distances_are_those_of_the_twin() {
    const SEED: u64 = 50;
    let gpu = open();
    let mut random = Random::new(SEED);
    let large = [
        Grid { dims: [70, 33, 17], spacing: [1.0; 3] },
        Grid { dims: [8, 150, 60], spacing: [1.0; 3] },
        Grid { dims: [41, 42, 43], spacing: [1.0; 3] },
    ];
    for grid in GRIDS.into_iter().chain(large) {
        let field = blank(&gpu, &grid);
        let kernel = BrickDistance::new(&gpu, &field).unwrap();
        let bricks = twin::field::bricks::bricks(&grid);
        for turn in 0..5 {
            // From all bricks to none with opacity; clips hide one half in a plane.
            let share = [1, 2, 10, 60, u64::MAX][turn];
            let opaque: Vec<u32> = (0..bricks.len()).map(|_| u32::from(random.below(share) == 0)).collect();
            let middle = bricks.dims[turn % 3] / 2;
            let code = |brick: usize| match bricks.voxel(brick)[turn % 3].cmp(&middle) {
                std::cmp::Ordering::Less => VISIBLE,
                std::cmp::Ordering::Equal => CUT_BY_2,
                std::cmp::Ordering::Greater => HIDDEN,
            };
            let codes: Vec<u32> = (0..bricks.len()).map(code).collect();
            let occupancy = buffer(&gpu, "occupancy", bytemuck::cast_slice(&opaque));
            let clip_bricks = buffer(&gpu, "clip bricks", bytemuck::cast_slice(&codes));
            let distances = BrickDistance::buffer(&gpu, &field).unwrap();
            run(&gpu, |rec| {
                rec.barrier(&[], &[Access::StorageRead, Access::StorageWrite]);
                kernel.record(rec, &field, &occupancy, &clip_bricks, &distances).unwrap();
            });
            let found: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &distances));

            // A ray reads a brick up to the first voxels of those above it.
            let above = |brick: usize| {
                let at = bricks.voxel(brick);
                (0..8_usize).map(move |i| {
                    bricks.index(std::array::from_fn(|a| (at[a] + (i >> a & 1)).min(bricks.dims[a] - 1)))
                })
            };
            let opaque: Vec<bool> = opaque.iter().map(|&o| o == 1).collect();
            let left: Vec<bool> = (0..bricks.len())
                .map(|brick| opaque[brick] && !above(brick).all(|b| codes[b] == HIDDEN))
                .collect();
            let to_left = twin::draw::brick_distance::brick_distance(&bricks, &left);
            for (brick, &word) in found.iter().enumerate() {
                let far = |distance: Option<usize>| distance.map_or(FAR, |d| d as u32);
                // Of a brick that is hidden whole the code does not say by which.
                let asked = above(brick).fold(0, |bits, b| match codes[b] {
                    HIDDEN => bits | 0xff,
                    CUT_BY_2 => bits | 1 << 2,
                    _ => bits,
                });
                assert_eq!(
                    [word & FAR, word >> 24],
                    [far(to_left[brick]), asked],
                    "seed {SEED} {:?} turn {turn} brick {:?}",
                    grid.dims,
                    bricks.voxel(brick)
                );
            }
        }
    }
    close(gpu);
}
