//! The kernel `bricks` against its twin and against plain loops.

use cao::field::Field;
use cao::field::bricks::{BrickList, Bricks, Which};
use cao::field::volume_image;
use cao_gpu::{Access, Gpu};
use cao_measure::random::Random;
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;

const CLIPPED: u8 = 0;
const AFFECTED: u8 = 1;
const UNTOUCHED: u8 = 2;

/// Largest group count along one axis that every device has.
const ROW: u32 = 65535;

/// Runs the kernel; returns the bricks ascending, the group counts and the marks it left.
fn list(
    gpu: &Gpu,
    kernel: &Bricks,
    field: &Field,
    which: Which,
    opacity: &[f32],
    mask: &[u8],
    before: &[u32],
) -> (Vec<u32>, [u32; 3], Vec<u32>) {
    let opacity = float_image(gpu, field, opacity);
    let mask = byte_image(gpu, field, mask);
    let before = buffer(gpu, "changed before", bytemuck::cast_slice(before));
    let list = BrickList::new(gpu, field).unwrap();
    run(gpu, |rec| {
        kernel.record(rec, field, which, &opacity, &mask, &before, &list).unwrap();
        // What an indirect dispatch reads is also what a copy may read.
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
    });
    let content: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &list.buffer));
    let count = content[3] as usize;
    let mut items = content[4..4 + count].to_vec();
    items.sort_unstable();
    (items, [content[0], content[1], content[2]], bytemuck::pod_collect_to_vec(&read_buffer(gpu, &before)))
}

fn bricks_where(grid: &Grid, wanted: impl Fn([usize; 3]) -> bool) -> Vec<u32> {
    let bricks = twin::field::bricks::bricks(grid);
    let mut marked = vec![false; bricks.len()];
    for i in 0..grid.len() {
        let voxel = grid.voxel(i);
        marked[bricks.index(voxel.map(|c| c / twin::field::bricks::EDGE))] |= wanted(voxel);
    }
    (0..bricks.len() as u32).filter(|&b| marked[b as usize]).collect()
}

/// Categories in a few balls and boxes, as clips leave them, or all alike.
fn random_mask(random: &mut Random, grid: &Grid, turn: usize) -> Vec<u8> {
    let mut mask = vec![if turn == 1 { CLIPPED } else { UNTOUCHED }; grid.len()];
    if turn < 2 {
        return mask;
    }
    let centre: [f32; 3] = std::array::from_fn(|a| random.between(0.0, grid.dims[a] as f32));
    let radius = random.between(0.3, 6.0);
    for (i, category) in mask.iter_mut().enumerate() {
        let voxel = grid.voxel(i);
        let d = (0..3).map(|a| (voxel[a] as f32 - centre[a]).powi(2)).sum::<f32>().sqrt();
        if d < radius {
            *category = CLIPPED;
        } else if d < radius + random.between(0.0, 3.0) {
            *category = AFFECTED;
        }
    }
    mask
}

#[test]
fn each_wanted_brick_is_listed_once_and_no_other() {
    let gpu = open();
    let kernel = Bricks::new(&gpu).unwrap();
    let mut random = Random::new(2);
    for grid in GRIDS {
        let field = blank(&gpu, &grid);
        let count = field.brick_count();
        for turn in 0..5 {
            let mask = random_mask(&mut random, &grid, turn);
            let mut opacity = vec![0.0; grid.len()];
            for _ in 0..turn {
                opacity[random.below(grid.len() as u64) as usize] = 0.25;
            }
            let before: Vec<u32> = (0..count).map(|_| u32::from(random.below(4) == 0)).collect();
            let context = format!("{:?} turn {turn}", grid.dims);

            let (found, groups, marks) = list(&gpu, &kernel, &field, Which::All, &opacity, &mask, &before);
            assert_eq!(found, (0..count).collect::<Vec<_>>(), "{context}");
            assert_eq!((groups, &marks), ([count, 1, 1], &before), "{context}");

            let needed = bricks_where(&grid, |voxel| {
                opacity[grid.index(voxel)] > 0.0
                    || grid.neighbours(voxel).any(|n| opacity[grid.index(n)] > 0.0)
            });
            let (found, groups, marks) = list(&gpu, &kernel, &field, Which::Needed, &opacity, &mask, &before);
            assert_eq!(found, needed, "{context}");
            let some = u32::from(!needed.is_empty());
            assert_eq!((groups, &marks), ([needed.len() as u32, some, 1], &before), "{context}");

            let changed = bricks_where(&grid, |voxel| mask[grid.index(voxel)] != UNTOUCHED);
            let (found, groups, marks) =
                list(&gpu, &kernel, &field, Which::Changed, &opacity, &mask, &before);
            let now = |b: &u32| changed.binary_search(b).is_ok();
            let expected: Vec<_> = (0..count).filter(|b| now(b) || before[*b as usize] == 1).collect();
            assert_eq!(found, expected, "{context}");
            let some = u32::from(!expected.is_empty());
            assert_eq!(groups, [expected.len() as u32, some, 1], "{context}");
            assert_eq!(marks, (0..count).map(|b| u32::from(now(&b))).collect::<Vec<_>>(), "{context}");
            // Every voxel that the twin computes is in a listed brick.
            for brick in twin::field::bricks::to_compute(&grid, &mask) {
                assert!(found.binary_search(&(brick as u32)).is_ok(), "{context}: brick {brick}");
            }
        }
    }
    drop(kernel);
    close(gpu);
}

/// More bricks than one row of workgroups holds: neither this kernel's dispatch nor the one that it prepares may need
/// more groups along an axis than every device has.
#[test]
fn more_bricks_than_a_row_of_groups_are_all_listed() {
    let gpu = open();
    let kernel = Bricks::new(&gpu).unwrap();
    // Listing all bricks reads no voxel: the images may be small.
    let small = Grid { dims: [1, 1, 1], spacing: [1.0; 3] };
    let mut field = blank(&gpu, &small);
    let opacity = volume_image(&gpu, "opacity", &field, cao_gpu::Format::R32Float).unwrap();
    let mask = volume_image(&gpu, "mask", &field, cao_gpu::Format::R8Uint).unwrap();
    field.dims = [8 * 300, 8 * 300, 8];
    let count = field.brick_count();
    assert!(count > ROW);
    let before = buffer(&gpu, "changed before", &vec![0; 4 * count as usize]);
    let list = BrickList::new(&gpu, &field).unwrap();
    run(&gpu, |rec| {
        rec.discard(&opacity);
        rec.discard(&mask);
        kernel.record(rec, &field, Which::All, &opacity, &mask, &before, &list).unwrap();
    });
    let content: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &list.buffer));
    assert_eq!(content[..4], [ROW, count.div_ceil(ROW), 1, count]);
    let mut items = content[4..].to_vec();
    items.sort_unstable();
    assert_eq!(items, (0..count).collect::<Vec<_>>());
    drop((kernel, field, opacity, mask, before, list));
    close(gpu);
}
