//! The kernel `rays` against its twin: bit for bit where a rule is whole numbers only, closely where it filters.

use cao::drive::Take;
use cao::field::Field;
use cao::field::bricks::BrickList;
use cao::field::volume_image;
use cao::rays::rays::{Bindings, RayPlan, Rays};
use cao_gpu::{Access, DeviceKind, Format, Gpu, Image};
use cao_measure::random::Random;
use cao_model::light::AmbientLight;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::Scope;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::rays::rays::rays;
use std::ops::Range;

/// A ray that is just dark on one side ends there; on the other it goes on with less than 2⁻¹⁰, in the worst case for two directions
/// whose weight is all there is.
const DARK: f64 = 2.0 / 1024.0;
/// Rounding of `pow` and `sqrt`, and of what filters make of it, in the mean over all voxels.
const MEAN: f64 = 1e-5;
/// What a sample's error is in a value: an eighth of a segment of one ray, seen in the worst of all voxels and in the mean.
const OF_FILTER: [f64; 2] = [3.0, 0.1];

/// What comes through the first half of an opaque cell if the filter says that it is not quite: its opacity is a square root, its mean
/// 1 over the logarithm of that, which for filters of 1/256 voxel is a third of the cell. It shows in rays of a cell or two.
pub fn of_opaque_cells(gpu: &Gpu, cells: u32) -> f64 {
    match gpu.info().kind {
        DeviceKind::Cpu => 0.0,
        _ => 2.0 / -filter_error(gpu).ln() / f64::from(2 * cells.max(1) - 1),
    }
}

struct State {
    gpu: Gpu,
    kernel: Rays,
    field: Field,
}

/// What is computed.
#[derive(Clone, Copy)]
struct Asked<'a> {
    opacity: &'a Image,
    reference_mm: f32,
    scope: Scope,
}

impl State {
    fn new(grid: &Grid) -> Self {
        let gpu = open();
        Self { kernel: Rays::new(&gpu).unwrap(), field: blank(&gpu, grid), gpu }
    }

    fn opacity(&self, opacity: &[u16]) -> Image {
        let image = volume_image(&self.gpu, "test opacity", &self.field, Format::R16Unorm).unwrap();
        write_image(&self.gpu, &image, bytemuck::cast_slice(opacity));
        image
    }

    fn plan(&self, occlusion: &Occlusion) -> RayPlan {
        RayPlan::new(self.field.spacing, occlusion).unwrap()
    }

    /// V_AO in coloured light, red, green, blue and what is in the fourth channel; 7 in what is not written.
    fn coloured(&self, plan: &RayPlan, asked: Asked, bricks: &[u32]) -> Vec<[u16; 4]> {
        let kernel = Rays::coloured(&self.gpu).unwrap();
        let ambient = volume_image(&self.gpu, "test ambient", &self.field, Format::Rgba16Unorm).unwrap();
        let voxels = self.field.dims.iter().product::<u32>() as usize;
        write_image(&self.gpu, &ambient, bytemuck::cast_slice(&vec![[7_u16; 4]; voxels]));
        let list = BrickList::of(&self.gpu, bricks).unwrap();
        let Asked { opacity, reference_mm, scope } = asked;
        let b = Bindings { opacity, list: &list, ambient: &ambient };
        run(&self.gpu, |rec| {
            kernel.record_directions(rec, plan).unwrap();
            kernel.record(rec, &self.field, plan, reference_mm, scope, b, &Take::All).unwrap();
            rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        });
        bytemuck::pod_collect_to_vec(&read_image(&self.gpu, &ambient))
    }

    /// V_AO with 7 in what is not written; of the listed bricks all at once, or in these slices.
    fn computed(&self, plan: &RayPlan, asked: Asked, bricks: &[u32], slices: &[Range<u32>]) -> Vec<u16> {
        let ambient = volume_image(&self.gpu, "test ambient", &self.field, Format::R16Unorm).unwrap();
        let voxels = self.field.dims.iter().product::<u32>() as usize;
        write_image(&self.gpu, &ambient, bytemuck::cast_slice(&vec![7_u16; voxels]));
        let list = BrickList::of(&self.gpu, bricks).unwrap();
        let Asked { opacity, reference_mm, scope } = asked;
        let b = Bindings { opacity, list: &list, ambient: &ambient };
        run(&self.gpu, |rec| {
            let (kernel, field) = (&self.kernel, &self.field);
            kernel.record_directions(rec, plan).unwrap();
            if slices.is_empty() {
                kernel.record(rec, field, plan, reference_mm, scope, b, &Take::All).unwrap();
            }
            for slice in slices {
                let take = Take::These(slice.clone());
                kernel.record(rec, field, plan, reference_mm, scope, b, &take).unwrap();
                rec.barrier(&[Access::StorageWrite], &[Access::StorageWrite]);
            }
            rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        });
        bytemuck::pod_collect_to_vec(&read_image(&self.gpu, &ambient))
    }

    fn all(&self) -> Vec<u32> {
        (0..self.field.brick_count()).collect()
    }

    fn close(self) {
        let Self { gpu, kernel, field } = self;
        drop((kernel, field));
        close(gpu);
    }
}

/// Blobs of soft and of opaque matter.
fn blobs(random: &mut Random, grid: &Grid) -> Vec<u16> {
    let mut field = vec![0_u16; grid.len()];
    for _ in 0..1 + grid.len() / 300 {
        let centre: [f32; 3] = std::array::from_fn(|i| random.between(0.0, grid.dims[i] as f32));
        let (r, a) = (random.between(0.5, 3.5), random.between(0.05, 1.2).min(1.0));
        for (i, value) in field.iter_mut().enumerate() {
            let d: f32 = grid.voxel(i).iter().zip(centre).map(|(&v, c)| (v as f32 - c).powi(2)).sum();
            if d < r * r {
                *value = (a * 65535.0).round() as u16;
            }
        }
    }
    field
}

/// Of these rays by each rule, lengths in smallest spacings.
fn settings(
    grid: &Grid,
    rays: RaySet,
    quadrature: Quadrature,
    [radius, offset, step]: [Option<f64>; 3],
) -> Occlusion {
    let mm = |voxels: f64| (voxels * grid.min_spacing()) as f32;
    let radius_mm = mm(radius.unwrap_or(0.0));
    Occlusion {
        rays,
        quadrature,
        radius_mm,
        offset_mm: offset.map(mm),
        step_mm: step.map(mm),
        ..Occlusion::paper(1.0)
    }
}

/// `nearest` bit for bit; the filter's rules closely. The same bits whatever the order of bricks, slices and directions.
#[test]
fn every_rule_equals_its_twin_in_any_order() {
    let mut random = Random::new(12);
    let extra = [
        Grid { dims: [33, 27, 21], spacing: [1.0; 3] },
        Grid { dims: [26, 20, 19], spacing: [1.0, 0.5, 0.8] },
    ];
    let (mut worst, mut sum, mut count) = ([0.0_f64; 3], [0.0; 3], 0.0);
    for grid in GRIDS.iter().chain(&extra) {
        let state = State::new(grid);
        for (rays_of, lengths, reference) in [
            (RaySet::W26, [Some(9.0), None, None], 1.0),
            (RaySet::Spiral(14), [Some(12.0), None, None], 1.0),
            (RaySet::Spiral(50), [Some(20.0), None, None], 1.0),
            (RaySet::Spiral(2), [Some(5.4), None, None], 1.0),
            (RaySet::Spiral(6), [Some(3.0), None, None], 1.0),
            (RaySet::Spiral(6), [Some(1.0), Some(0.0), None], 1.0),
            (RaySet::Spiral(8), [Some(8.0), None, None], 2.5),
            (RaySet::Spiral(10), [Some(7.0), Some(1.3), Some(0.6)], 1.0),
            (RaySet::R6, [Some(11.0), Some(0.2), Some(1.7)], 0.7),
        ] {
            let opacity = blobs(&mut random, grid);
            let image = state.opacity(&opacity);
            let scope = if random.below(2) == 0 { Scope::Needed } else { Scope::All };
            let mut bricks = state.all();
            for (r, rule) in Quadrature::BRICK.into_iter().enumerate() {
                let occlusion = settings(grid, rays_of, rule, lengths);
                let reference_mm = reference * occlusion.step(grid.min_spacing());
                let asked = Asked { opacity: &image, reference_mm, scope };
                let mut plan = state.plan(&occlusion);
                let found = state.computed(&plan, asked, &bricks, &[]);
                let expected = rays(grid, &opacity, &occlusion, reference_mm, scope == Scope::All);
                if rule == Quadrature::Nearest && reference == 1.0 {
                    assert_eq!(found, expected, "{grid:?} {occlusion:?}");
                }
                for (i, (f, e)) in found.iter().zip(&expected).enumerate() {
                    let error = f64::from(f.abs_diff(*e)) / 65535.0;
                    (worst[r], sum[r]) = (worst[r].max(error), sum[r] + error);
                    let allowed = DARK
                        + OF_FILTER[0] * filter_error(&state.gpu)
                        + of_opaque_cells(&state.gpu, occlusion.samples(grid.min_spacing()));
                    assert!(error <= allowed, "{occlusion:?} {:?} of {grid:?}: {f} {e}", grid.voxel(i));
                }
                bricks.reverse();
                let middle = bricks.len() as u32 / 3;
                let again = state.computed(&plan, asked, &bricks, &[middle..bricks.len() as u32, 0..middle]);
                assert_eq!(found, again, "{rule:?}: list reversed, in slices, the last first");
                for i in (1..bricks.len()).rev() {
                    bricks.swap(i, random.below(i as u64 + 1) as usize);
                }
                plan.directions.reverse();
                let again = state.computed(&plan, asked, &bricks, &[]);
                assert_eq!(found, again, "{rule:?}: list mixed and directions reversed");
            }
            count += opacity.len() as f64;
        }
        let allowed = MEAN + OF_FILTER[1] * filter_error(&state.gpu);
        assert!(sum.iter().all(|s| s / count < allowed), "mean {sum:?} of {count}");
        state.close();
    }
    println!("worst {worst:?}, mean {:?}", sum.map(|s| s / count));
}

/// In coloured light one walk has the values of three grey ones, to the bit; `nearest` those of the twin. What needs no value is white.
#[test]
fn colours_are_three_grey_lights_of_the_twin() {
    let mut random = Random::new(16);
    let grid = Grid { dims: [26, 20, 19], spacing: [1.0, 0.5, 0.8] };
    let state = State::new(&grid);
    let opacity = blobs(&mut random, &grid);
    let image = state.opacity(&opacity);
    for (rays_of, light) in [
        (RaySet::Spiral(14), coloured_light()),
        (RaySet::W26, coloured_light().turned(third_turn())),
        // Some directions have no light of one colour, and some none at all.
        (RaySet::Spiral(20), AmbientLight::harmonics(&[[0.0; 3], [1.0, 0.0, 0.5], [0.0, 1.0, 0.5]]).unwrap()),
    ] {
        for rule in Quadrature::BRICK {
            let occlusion = settings(&grid, rays_of, rule, [Some(7.0), None, None]);
            let (reference_mm, scope) = (occlusion.step(grid.min_spacing()), Scope::Needed);
            let asked = Asked { opacity: &image, reference_mm, scope };
            let lit = |light| Occlusion { light, ..occlusion };
            let found = state.coloured(&state.plan(&lit(light)), asked, &state.all());
            for c in 0..3 {
                let grey = lit(light.channel(c));
                let own = state.computed(&state.plan(&grey), asked, &state.all(), &[]);
                assert!(found.iter().map(|v| v[c]).eq(own.iter().copied()), "{rule:?} {rays_of:?} {c}");
                if rule == Quadrature::Nearest {
                    assert_eq!(own, rays(&grid, &opacity, &grey, reference_mm, false), "{rays_of:?} {c}");
                }
            }
            assert!(found.iter().all(|v| v[3] == 65535));
            assert!(found.iter().any(|v| v[0] != v[1] && v[1] != v[2]), "{rule:?}: no colours");
        }
    }
    drop(image);
    state.close();
}

#[test]
fn known_answers() {
    let grid = Grid { dims: [40, 40, 40], spacing: [1.0; 3] };
    let state = State::new(&grid);
    let empty = state.opacity(&vec![0; grid.len()]);
    let half: Vec<u16> = (0..grid.len()).map(|i| if grid.voxel(i)[2] < 20 { 65535 } else { 0 }).collect();
    let half = state.opacity(&half);
    let of = |opacity, scope| Asked { opacity, reference_mm: 1.0, scope };
    for rule in Quadrature::BRICK {
        let plan = state.plan(&settings(&grid, RaySet::Spiral(254), rule, [Some(12.0), None, None]));
        let found = state.computed(&plan, of(&empty, Scope::All), &state.all(), &[]);
        assert!(found.iter().all(|&v| v == 65535), "{rule:?}: empty");
        let found = state.computed(&plan, of(&half, Scope::Needed), &state.all(), &[]);
        let value = |v| f64::from(found[grid.index(v)]) / 65535.0;
        // The converged integral of a half-space, from half a voxel out.
        assert!((value([20, 20, 20]) - 0.569).abs() < 0.03, "{rule:?}: {}", value([20, 20, 20]));
        assert_eq!(value([20, 20, 10]), 0.0, "{rule:?}: inside");
        assert_eq!(value([20, 20, 30]), 1.0, "{rule:?}: not needed");
        // Bricks that are not listed keep what they hold.
        let one = state.computed(&plan, of(&half, Scope::Needed), &state.all()[..1], &[]);
        assert_eq!(one[grid.index([20, 20, 20])], 7, "{rule:?}");
        // A ray without cells meets nothing.
        let none = state.plan(&settings(&grid, RaySet::Spiral(254), rule, [Some(0.0), None, None]));
        let found = state.computed(&none, of(&half, Scope::All), &state.all(), &[]);
        assert!(found.iter().all(|&v| v == 65535), "{rule:?}: radius 0");
    }
    drop((empty, half));
    state.close();
}

/// Rays of 256 voxels, which leave the volume, and along them: what lies at the far end is seen, what lies a voxel farther is not.
#[test]
fn rays_of_256_voxels_end_where_they_should() {
    let grid = Grid { dims: [300, 3, 3], spacing: [1.0; 3] };
    let state = State::new(&grid);
    for rule in Quadrature::BRICK {
        let plan = state.plan(&settings(&grid, RaySet::R6, rule, [Some(256.0), None, None]));
        for (wall, seen) in [(20 + 254, true), (20 + 258, false)] {
            let mut opacity = vec![0; grid.len()];
            for (i, a) in opacity.iter_mut().enumerate() {
                *a = if grid.voxel(i)[0] == wall { 65535 } else { 0 };
            }
            let image = state.opacity(&opacity);
            let asked = Asked { opacity: &image, reference_mm: 1.0, scope: Scope::All };
            let found = state.computed(&plan, asked, &state.all(), &[]);
            assert_eq!(found[grid.index([20, 1, 1])] < 65535, seen, "{rule:?} {wall}");
        }
    }
    state.close();
}
