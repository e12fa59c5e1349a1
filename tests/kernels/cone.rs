//! The kernel `cone` against its twin, over levels that the kernel `level` made.

use cao::cones::cone::{Bindings, ConePlan, ConeTracing};
use cao::drive::Take;
use cao::field::bricks::BrickList;
use cao::field::volume_image;
use cao::pyramid::levels::{LevelImages, MakeLevels};
use cao_gpu::{Access, Format, Gpu};
use cao_measure::random::Random;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::Scope;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::cones::cone::cones;

/// A cone that is just dark on one side ends there, on the other it goes on with less than 0.001, of a share of the sphere that others
/// have too; `log2` of a width that is a power of two may lie on either side of a whole number, which moves nothing.
const DARK: f64 = 2e-4;
/// A mean is off by a few 65535ths, and a step of a cone has a few voxels of it.
const ROUNDING: f64 = 1e-4;
/// Where a mean is opaque but for a rounding, a step lets nothing through or 1/ln 65535 of its length, 0.09: that is up to 0.01 of a cone
/// here, and befalls every fourth cone at once where matter is opaque.
const NEARLY: f64 = 2.5e-3;
/// Of the filter of each look-up, over all steps of a cone.
const OF_FILTER: f64 = 3.0;

/// V_AO of every voxel, the bricks and the cones in this order.
fn computed(
    gpu: &Gpu,
    grid: &Grid,
    opacity: &[u16],
    occlusion: &Occlusion,
    reference_mm: f64,
    scope: Scope,
    reverse: bool,
) -> Vec<u16> {
    let (make, kernel) = (MakeLevels::new(gpu).unwrap(), ConeTracing::new(gpu).unwrap());
    let field = blank(gpu, grid);
    let image = volume_image(gpu, "test opacity", &field, Format::R16Unorm).unwrap();
    write_image(gpu, &image, bytemuck::cast_slice(opacity));
    let ambient = volume_image(gpu, "test ambient", &field, Format::R16Unorm).unwrap();
    write_image(gpu, &ambient, bytemuck::cast_slice(&vec![7_u16; grid.len()]));
    let (mut plan, levels) = ConePlan::new(field.dims, field.spacing, occlusion).unwrap();
    let mut bricks: Vec<u32> = (0..field.brick_count()).collect();
    if reverse {
        bricks.reverse();
        plan.cones.reverse();
    }
    let list = BrickList::of(gpu, &bricks).unwrap();
    let levels = LevelImages::new(gpu, levels).unwrap();
    let exponent = field.min_spacing() / reference_mm as f32;
    run(gpu, |rec| {
        make.record_table(rec, &levels.plan).unwrap();
        kernel.record_cones(rec, &plan).unwrap();
        for part in make.parts(exponent, &levels, &image, None) {
            part.record(rec, &Take::All).unwrap();
        }
        let b = Bindings { opacity: &image, make: &make, levels: &levels, list: &list, ambient: &ambient };
        kernel.record(rec, &field, &plan, reference_mm as f32, scope, b, &Take::All).unwrap();
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
    });
    bytemuck::pod_collect_to_vec(&read_image(gpu, &ambient))
}

#[test]
fn cones_equal_their_twin_in_any_order() {
    let gpu = open();
    let mut random = Random::new(51);
    let extra = [
        Grid { dims: [29, 26, 21], spacing: [1.0; 3] },
        Grid { dims: [26, 20, 13], spacing: [1.0, 0.5, 0.8] },
    ];
    let mut worst = 0.0_f64;
    for grid in GRIDS.iter().chain(&extra) {
        for (n, (rays, voxels, offset, reference)) in [
            (RaySet::W14, 9.0, None, 1.0),
            (RaySet::W26, 12.0, None, 1.0),
            (RaySet::R6, 7.3, Some(0.2), 2.0),
            (RaySet::Spiral(50), 5.0, None, 1.0),
            (RaySet::W26, 0.4, None, 1.0),
            (RaySet::W26, 10.0, None, 1.0),
        ]
        .into_iter()
        .enumerate()
        {
            // Soft and opaque matter in layers of some voxels, and nothing between.
            let soft = random.below(60_000) as u16;
            let solid = if n % 2 == 0 { 60_000 } else { 65_535 };
            let opacity: Vec<u16> = (0..grid.len())
                .map(|i| {
                    let [x, y, z] = grid.voxel(i);
                    [0, soft, 0, solid, 0][(x / 3 + y / 5 + z / 4) % 5]
                })
                .collect();
            let mm = |voxels: f64| (voxels * grid.min_spacing()) as f32;
            let occlusion = Occlusion {
                rays,
                quadrature: Quadrature::Cone,
                radius_mm: mm(voxels),
                offset_mm: offset.map(mm),
                step_mm: None,
                ..Occlusion::paper(1.0)
            };
            let reference_mm = reference * grid.min_spacing();
            let scope = if random.below(2) == 0 { Scope::Needed } else { Scope::All };
            let of = |reverse| computed(&gpu, grid, &opacity, &occlusion, reference_mm, scope, reverse);
            let found = of(false);
            assert_eq!(found, of(true), "the order of bricks and cones matters");
            let floats: Vec<f32> = opacity.iter().map(|&a| f32::from(a) / 65535.0).collect();
            let expected = cones(grid, &floats, &occlusion, reference_mm, scope == Scope::All);
            let nearly = if solid == 65_535 { NEARLY } else { 0.0 };
            let allowed = DARK + ROUNDING + nearly + OF_FILTER * filter_error(&gpu);
            for (i, (&found, expected)) in found.iter().zip(expected).enumerate() {
                let error = (f64::from(found) / 65535.0 - expected).abs();
                worst = worst.max(error);
                let context = || format!("{occlusion:?} {grid:?} {:?}: {found} {expected}", grid.voxel(i));
                assert!(error <= allowed, "{}", context());
            }
        }
    }
    println!("worst {worst}");
    close(gpu);
}

#[test]
fn too_few_directions_and_too_long_radii_are_refused_by_name() {
    let of = |rays, radius_mm| {
        let occlusion = Occlusion { rays, radius_mm, ..Occlusion::paper(1.0) };
        ConePlan::new([16; 3], [1.0; 3], &occlusion).map(|(_, levels)| levels.levels())
    };
    assert_eq!(of(RaySet::W26, 16.0), Ok(4));
    assert_eq!(of(RaySet::R6, 256.0), Ok(9));
    assert_eq!(of(RaySet::W26, 0.0), Ok(0));
    let said = of(RaySet::Spiral(2), 16.0).unwrap_err().to_string();
    assert!(said.contains("spiral:2") && said.contains("four"), "{said}");
    let said = of(RaySet::W26, 300.0).unwrap_err().to_string();
    assert!(said.contains("300") && said.contains("256"), "{said}");
}
