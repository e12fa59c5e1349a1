//! The kernel `vicinity` against its twin: opacities are compared as whole numbers, so that the same directions are visible; sums of their
//! weights round.

use cao::drive::Take;
use cao::field::bricks::BrickList;
use cao::field::volume_image;
use cao::vicinity::vicinity::{Bindings, LinePlan, Vicinity};
use cao_gpu::{Access, Format};
use cao_measure::random::Random;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::Scope;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::vicinity::vicinity::vicinity;

/// Rounding of sums of 50 weights, and of V_AO to 65535ths.
const ROUNDED: f64 = 3.0 / 65535.0;
/// Where lengths are not the reference length the threshold is a power, which rounds: a voxel within a 65535th of it may be on the other
/// side, and a gradient's weight of about 0 may have the other sign. Shares of voxels.
const MOST_APART: f64 = 2e-3;

/// V_AO of the listed bricks, 7 in the others.
fn computed(
    grid: &Grid,
    opacity: &[u16],
    occlusion: &Occlusion,
    reference_mm: f32,
    scope: Scope,
    bricks: impl Fn(u32) -> Vec<u32>,
) -> Vec<u16> {
    let gpu = open();
    let field = blank(&gpu, grid);
    let kernel = Vicinity::new(&gpu).unwrap();
    let plan = LinePlan::new(field.spacing, occlusion).unwrap();
    let image = |name| volume_image(&gpu, name, &field, Format::R16Unorm).unwrap();
    let (source, ambient) = (image("test opacity"), image("test ambient"));
    write_image(&gpu, &source, bytemuck::cast_slice(opacity));
    write_image(&gpu, &ambient, bytemuck::cast_slice(&vec![7_u16; opacity.len()]));
    let list = BrickList::of(&gpu, &bricks(field.brick_count())).unwrap();
    let b = Bindings { opacity: &source, list: &list, ambient: &ambient };
    run(&gpu, |rec| {
        kernel.record_directions(rec, &plan).unwrap();
        kernel.record(rec, &field, &plan, reference_mm, scope, b, &Take::All).unwrap();
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
    });
    let found = bytemuck::pod_collect_to_vec(&read_image(&gpu, &ambient));
    drop((kernel, source, ambient, list, field));
    close(gpu);
    found
}

fn settings(rays: RaySet, radius_mm: f64) -> Occlusion {
    let radius_mm = radius_mm as f32;
    Occlusion { rays, quadrature: Quadrature::Visible, radius_mm, ..Occlusion::paper(1.0) }
}

#[test]
fn values_equal_the_twins() {
    let mut random = Random::new(12);
    let (mut apart, mut count) = (0, 0);
    for grid in &GRIDS {
        for (rays, radius, reference) in [
            (RaySet::W26, 9.0, 1.0),
            (RaySet::Spiral(50), 20.0, 1.0),
            (RaySet::R6, 0.3, 1.0),
            (RaySet::Spiral(14), 6.0, 2.5),
        ] {
            // Few levels, so that many are equal and some differ by just the threshold.
            let opacity: Vec<u16> =
                (0..grid.len()).map(|_| (random.below(12) as u16).saturating_sub(4) * 257).collect();
            let occlusion = settings(rays, radius * grid.min_spacing());
            let reference_mm = reference * grid.min_spacing() as f32;
            let scope = if random.below(2) == 0 { Scope::Needed } else { Scope::All };
            let found = computed(grid, &opacity, &occlusion, reference_mm, scope, |n| (0..n).rev().collect());
            let expected = vicinity(grid, &opacity, &occlusion, reference_mm, scope == Scope::All);
            for (i, (f, e)) in found.iter().zip(&expected).enumerate() {
                let error = (f64::from(*f) / 65535.0 - e).abs();
                if reference == 1.0 {
                    assert!(error <= ROUNDED, "{occlusion:?} {:?} of {grid:?}: {f} {e}", grid.voxel(i));
                }
                apart += usize::from(error > ROUNDED);
            }
            count += found.len();
        }
    }
    assert!(apart as f64 <= MOST_APART * count as f64, "{apart} of {count}");
}

#[test]
fn known_answers() {
    let grid = Grid { dims: [41, 41, 30], spacing: [1.0; 3] };
    let of = |opacity: &dyn Fn([usize; 3]) -> u16, at| {
        let opacity: Vec<u16> = (0..grid.len()).map(|i| opacity(grid.voxel(i))).collect();
        let occlusion = settings(RaySet::Spiral(254), 20.0);
        // The brick of the voxels that are asked for, the second along x and y and the first along z.
        let bricks = |_: u32| vec![2 + 6 * 2];
        let found = computed(&grid, &opacity, &occlusion, 1.0, Scope::Needed, bricks);
        assert_eq!(found[0], 7, "not listed");
        f64::from(found[grid.index(at)]) / 65535.0
    };
    assert_eq!(of(&|_| 9000, [20, 20, 5]), 1.0);
    assert_eq!(of(&|[_, _, z]| if z < 8 { 65535 } else { 0 }, [20, 20, 7]), 1.0);
    let corner = |[x, _, z]: [usize; 3]| if x >= 22 { 65535 } else { u16::from(z < 8) * 32768 };
    let value = of(&corner, [20, 20, 7]);
    // Half a hemisphere, and what of the other half does not reach the wall within the radius: the twin's test has it.
    assert!((value - 0.548).abs() < 0.02, "{value}");
}
