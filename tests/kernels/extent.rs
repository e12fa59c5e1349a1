//! The kernel `extent` against its twin.

use cao::draw::extent::{Extent, MOST_WAYS};
use cao::field::Field;
use cao_gpu::Gpu;
use cao_measure::random::Random;
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;
use glam::Vec3;

/// The word of `clip_bricks` for a brick that the clips hide, and for one that they do not.
const HIDDEN: u32 = 0;
const VISIBLE: u32 = 2;

/// f32 against f64, as a share of the volume's size: a dot product of three terms rounds five times by 2⁻²⁴ of its largest.
const ROUNDING: f64 = 1e-6;

/// What the kernel finds; bricks with opacity are those that the opacities say, and `hidden` says which the clips hide.
fn on_device(
    gpu: &Gpu,
    kernel: &Extent,
    field: &Field,
    grid: &Grid,
    opacity: &[f32],
    hidden: &[bool],
    directions: &[Vec3],
) -> Option<Vec<f32>> {
    let bricks = twin::field::bricks::bricks(grid);
    let mut occupied = vec![0_u32; bricks.len()];
    for voxel in (0..grid.len()).filter(|voxel| opacity[*voxel] > 0.0) {
        occupied[bricks.index(grid.voxel(voxel).map(|c| c / 8))] = 1;
    }
    let codes: Vec<u32> = hidden.iter().map(|hidden| if *hidden { HIDDEN } else { VISIBLE }).collect();
    let image = float_image(gpu, field, opacity);
    let occupancy = buffer(gpu, "occupancy", bytemuck::cast_slice(&occupied));
    let clip_bricks = buffer(gpu, "clip bricks", bytemuck::cast_slice(&codes));
    kernel.run(gpu, field, &image, &occupancy, &clip_bricks, directions).unwrap()
}

fn directions(random: &mut Random) -> Vec<Vec3> {
    let mut along = |_| random.between(-1.0, 1.0);
    let oblique = (0..MOST_WAYS - 2).map(|_| Vec3::from_array([(); 3].map(&mut along)) * 3.0);
    // Along an axis many voxels reach equally far; and one that is shorter than any rounding.
    oblique.chain([Vec3::NEG_Y, Vec3::Z * 1e-12]).collect()
}

#[test]
fn reaches_are_those_of_the_twin() {
    const SEED: u64 = 12;
    let gpu = open();
    let kernel = Extent::new(&gpu).unwrap();
    let mut random = Random::new(SEED);
    let large = [
        Grid { dims: [70, 33, 17], spacing: [1.0, 0.3, 2.0] },
        Grid { dims: [9, 50, 40], spacing: [1e-6, 3e-6, 2e-6] },
    ];
    let mut seen = [0, 0];
    for grid in GRIDS.into_iter().chain(large) {
        let field = blank(&gpu, &grid);
        let bricks = twin::field::bricks::bricks(&grid).len();
        for turn in 0..6 {
            // From every other voxel to one in thousands, those that show something a half or all of the largest, the others a fog that
            // does not count; in the last nothing is visible.
            let share = [2, 2, 30, 400, 3000, u64::MAX][turn];
            let largest = random.between(0.1, 1.0);
            let fog = if turn % 2 == 1 { 0.9 / 64.0 } else { 0.0 };
            let hidden: Vec<bool> = (0..bricks).map(|_| turn > 0 && random.below(4) == 0).collect();
            let hides = |voxel: usize| {
                let brick = twin::field::bricks::bricks(&grid).index(grid.voxel(voxel).map(|c| c / 8));
                hidden[brick]
            };
            let opacity: Vec<f32> = (0..grid.len())
                .map(|voxel| match random.below(share) {
                    _ if hides(voxel) || turn == 5 => 0.0,
                    0 => largest * random.between(0.5, 1.0),
                    _ => 0.5 * largest * fog,
                })
                .collect();
            let directions = directions(&mut random);
            let found = on_device(&gpu, &kernel, &field, &grid, &opacity, &hidden, &directions);
            let exact: Vec<_> = directions.iter().map(|d| d.as_dvec3().to_array()).collect();
            let expected = twin::draw::extent::extent(&grid, &opacity, &exact);
            let context = format!("seed {SEED} {:?} turn {turn}", grid.dims);
            assert_eq!(found.is_some(), expected.is_some(), "{context}");
            seen[usize::from(found.is_some())] += 1;
            let size = f64::from(size_mm(&grid).element_sum());
            for ((found, expected), way) in found.iter().flatten().zip(expected.iter().flatten()).zip(&exact)
            {
                let long = way.iter().map(|c| c.abs()).sum::<f64>() * size;
                let off = (f64::from(*found) - expected).abs();
                assert!(off <= ROUNDING * long, "{context} {way:?}: {found} {expected}");
            }
        }
    }
    assert!(seen[0] > 7 && seen[1] > 24, "{seen:?}");
    close(gpu);
}

/// A ball reaches as far as its radius from its middle, in every direction: within the corners of a voxel, half a diagonal.
#[test]
fn a_ball_reaches_by_its_radius() {
    let gpu = open();
    let kernel = Extent::new(&gpu).unwrap();
    let grid = Grid { dims: [60, 50, 40], spacing: [0.5, 0.75, 1.0] };
    let field = blank(&gpu, &grid);
    let (centre, radius) = (Vec3::new(3.0, -5.0, 6.0), 8.0);
    let inside = |voxel: usize| {
        let at = grid.to_world(grid.voxel(voxel).map(|c| c as f64));
        Vec3::from_array(at.map(|c| c as f32)).distance(centre) <= radius
    };
    let opacity: Vec<f32> = (0..grid.len()).map(|voxel| f32::from(u8::from(inside(voxel)))).collect();
    let nothing = vec![false; twin::field::bricks::bricks(&grid).len()];
    let mut random = Random::new(7);
    for _ in 0..10 {
        let directions: Vec<Vec3> =
            directions(&mut random).into_iter().map(|direction| direction.normalize()).collect();
        let found = on_device(&gpu, &kernel, &field, &grid, &opacity, &nothing, &directions).unwrap();
        for (found, direction) in found.iter().zip(&directions) {
            let off = found - centre.dot(*direction) - radius;
            assert!(off.abs() <= 0.5 * grid.diagonal() as f32, "{direction}: {off} mm");
        }
    }
    drop(field);
    close(gpu);
}

#[test]
fn directions_that_are_none_are_refused() {
    let gpu = open();
    let kernel = Extent::new(&gpu).unwrap();
    let grid = GRIDS[0];
    let field = blank(&gpu, &grid);
    let image = float_image(&gpu, &field, &[1.0]);
    let one = buffer(&gpu, "words", bytemuck::bytes_of(&VISIBLE));
    let run = |directions: &[Vec3]| kernel.run(&gpu, &field, &image, &one, &one, directions);
    assert_eq!(run(&[]).unwrap(), Some(vec![]));
    let error = run(&[Vec3::X; MOST_WAYS + 1]).unwrap_err().to_string();
    assert!(error.contains("7") && error.contains("several calls"), "{error}");
    let error = run(&[Vec3::NAN]).unwrap_err().to_string();
    assert!(error.contains("direction of the visible extent"), "{error}");
    drop((image, one, field));
    close(gpu);
}
