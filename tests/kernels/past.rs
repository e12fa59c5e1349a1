//! The kernel `past`: opacities of the listed bricks are exchanged with what is kept of them, and twice leaves everything as it was.

use cao::field::volume_image;
use cao::sweep::past::{Past, PastBricks};
use cao_gpu::Format;
use cao_measure::random::Random;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::field::bricks::bricks;

#[test]
fn listed_bricks_are_exchanged_and_twice_is_nothing() {
    let gpu = open();
    let kernel = Past::new(&gpu).unwrap();
    let mut random = Random::new(91);
    let grid = Grid { dims: [37, 29, 50], spacing: [1.0; 3] };
    let field = blank(&gpu, &grid);
    let all = bricks(&grid);
    let before: Vec<u16> = (0..grid.len()).map(|_| random.below(65536) as u16).collect();
    let opacity = volume_image(&gpu, "test opacity", &field, Format::R16Unorm).unwrap();
    write_image(&gpu, &opacity, bytemuck::cast_slice(&before));
    let mut past = PastBricks::new(&gpu, &field).unwrap();
    let listed: Vec<u32> =
        (0..all.len() as u32).filter(|i| i % 3 == 1).take(past.capacity as usize).collect();
    let count = listed.len() as u32;
    let kept: Vec<u32> = (0..256 * past.capacity).map(|_| random.below(1 << 32) as u32).collect();
    past.list.buffer =
        buffer(&gpu, "changed", bytemuck::cast_slice(&[&[count, 1, 1, count], &listed[..]].concat()));
    past.opacities = buffer(&gpu, "past", bytemuck::cast_slice(&kept));

    let exchange = || run(&gpu, |rec| kernel.record(rec, &field, &past, &opacity).unwrap());
    let stored = || -> Vec<u16> { bytemuck::pod_collect_to_vec(&read_image(&gpu, &opacity)) };
    exchange();
    let mut expected = before.clone();
    for (slot, brick) in listed.iter().enumerate() {
        let first = all.voxel(*brick as usize).map(|c| c * 8);
        for n in 0..512 {
            let voxel = std::array::from_fn(|axis| first[axis] + [n % 8, n / 8 % 8, n / 64][axis]);
            if (0..3).all(|axis| voxel[axis] < grid.dims[axis]) {
                expected[grid.index(voxel)] = (kept[256 * slot + n % 256] >> (16 * (n / 256))) as u16;
            }
        }
    }
    assert!(stored() == expected && expected != before);
    exchange();
    assert!(stored() == before);
    drop((past, opacity, field, kernel));
    close(gpu);
}
