//! The kernel `bounds` against its twin.

use cao::draw::bounds::Bounds;
use cao_gpu::Access;
use cao_measure::random::Random;
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;

#[test]
fn bounds_are_those_of_the_twin() {
    const SEED: u64 = 51;
    let gpu = open();
    let mut random = Random::new(SEED);
    let large =
        [Grid { dims: [170, 33, 17], spacing: [1.0; 3] }, Grid { dims: [8, 150, 160], spacing: [1.0; 3] }];
    let kernel = Bounds::new(&gpu).unwrap();
    let mut none = 0;
    for grid in GRIDS.into_iter().chain(large) {
        let field = blank(&gpu, &grid);
        let bricks = twin::field::bricks::bricks(&grid);
        let bounds = Bounds::buffer(&gpu).unwrap();
        for share in [1, 3, 20, 200, u64::MAX] {
            let shows: Vec<bool> = (0..bricks.len()).map(|_| random.below(share) == 0).collect();
            // Bricks that the clips hide whole are 0 bricks away from opacity all the same.
            let word = |shows: &bool| if *shows { 0xff << 24 } else { (1 + random.below(9) as u32) << 12 };
            let words: Vec<u32> = shows.iter().map(word).collect();
            let distances = buffer(&gpu, "distances", bytemuck::cast_slice(&words));
            run(&gpu, |rec| {
                rec.barrier(&[], &[Access::StorageRead, Access::StorageWrite]);
                kernel.record(rec, &field, &distances, &bounds).unwrap();
            });
            let found: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &bounds));
            let expected = twin::draw::bounds::bounds(&bricks, &shows);
            none += usize::from(expected.is_none());
            let expected = expected.map_or([0; 6], |[first, last]| {
                let from_first = |axis: usize| (bricks.dims[axis] - first[axis]) as u32;
                std::array::from_fn(|i| if i < 3 { from_first(i) } else { last[i - 3] as u32 + 1 })
            });
            assert_eq!(found, expected, "seed {SEED} {:?} one in {share}", grid.dims);
        }
    }
    assert!(none > 0);
    drop(kernel);
    close(gpu);
}
