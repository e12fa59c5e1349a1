//! The kernel `fdao` against its twin: bit for bit where a rule of rays is whole numbers only, closely where it filters; and against the
//! kernel `rays`, whose values it has where all matter is of one feature.

use crate::rays::of_opaque_cells;
use cao::drive::Take;
use cao::features::fdao::{self, Fdao};
use cao::features::mask::{Mask, Masked};
use cao::field::Field;
use cao::field::bricks::BrickList;
use cao::field::volume_image;
use cao::rays::rays::{Bindings, RayPlan, Rays};
use cao_gpu::{Access, Format, Gpu, Image};
use cao_measure::random::Random;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::options::Combine;
use cao_model::settings::Scope;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::features::fdao::{Matter, fdao};

const RULES: [Combine; 4] = [Combine::Own, Combine::Neighbours, Combine::Max, Combine::Sample];

/// As `tests/kernels/rays.rs` has them: a ray that is just dark on one side, and the error of filters.
const DARK: f64 = 2.0 / 1024.0;
const OF_FILTER: f64 = 3.0;
const MEAN: f64 = 1e-5;
/// A mean of neighbours is rounded once more, from f32.
const ROUNDED: u16 = 1;

struct State {
    gpu: Gpu,
    kernel: Fdao,
    mask: Mask,
    field: Field,
}

/// What is computed.
#[derive(Clone, Copy)]
struct Asked<'a> {
    opacity: &'a Image,
    labels: &'a Image,
    masked: &'a Masked,
    reference_mm: f32,
    scope: Scope,
}

impl State {
    fn new(grid: &Grid) -> Self {
        let gpu = open();
        let field = blank(&gpu, grid);
        Self { kernel: Fdao::new(&gpu).unwrap(), mask: Mask::new(&gpu, &field).unwrap(), field, gpu }
    }

    /// Another field.
    fn take(&mut self, grid: &Grid) {
        self.field = blank(&self.gpu, grid);
        self.mask = Mask::new(&self.gpu, &self.field).unwrap();
    }

    /// Opacities of so many features.
    fn masked(&self, opacity: &Image, labels: &Image, features: usize) -> Masked {
        let masked = Masked::new(&self.gpu, &self.field, features).unwrap();
        let change = buffer(&self.gpu, "change", &vec![0; 4 * self.field.brick_count() as usize]);
        run(&self.gpu, |rec| {
            self.mask.record(rec, &self.field, true, opacity, labels, &change, &masked).unwrap();
        });
        masked
    }

    fn image(&self, format: Format, content: &[u8]) -> Image {
        let image = volume_image(&self.gpu, "test", &self.field, format).unwrap();
        write_image(&self.gpu, &image, content);
        image
    }

    fn all(&self) -> Vec<u32> {
        (0..self.field.brick_count()).collect()
    }

    /// V_AO with 7 in what is not written.
    fn computed(&self, plan: &RayPlan, rule: Combine, asked: Asked, bricks: &[u32]) -> Vec<[u16; 4]> {
        let voxels = self.field.dims.iter().product::<u32>() as usize;
        let ambient = self.image(Format::Rgba16Unorm, bytemuck::cast_slice(&vec![[7_u16; 4]; voxels]));
        let list = BrickList::of(&self.gpu, bricks).unwrap();
        let Asked { opacity, labels, masked, reference_mm, scope } = asked;
        let b = fdao::Bindings { opacity, labels, masked, list: &list, ambient: &ambient };
        run(&self.gpu, |rec| {
            self.kernel.record_directions(rec, plan).unwrap();
            let (field, all) = (&self.field, Take::All);
            self.kernel.record(rec, field, plan, rule, reference_mm, scope, b, &all).unwrap();
            rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        });
        bytemuck::pod_collect_to_vec(&read_image(&self.gpu, &ambient))
    }

    /// That of rays by brick.
    fn of_all_matter(&self, rays: &Rays, plan: &RayPlan, asked: Asked) -> Vec<u16> {
        let voxels = self.field.dims.iter().product::<u32>() as usize;
        let ambient = self.image(Format::R16Unorm, bytemuck::cast_slice(&vec![7_u16; voxels]));
        let list = BrickList::of(&self.gpu, &self.all()).unwrap();
        let b = Bindings { opacity: asked.opacity, list: &list, ambient: &ambient };
        run(&self.gpu, |rec| {
            rays.record_directions(rec, plan).unwrap();
            let (field, reference_mm) = (&self.field, asked.reference_mm);
            rays.record(rec, field, plan, reference_mm, asked.scope, b, &Take::All).unwrap();
            rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        });
        bytemuck::pod_collect_to_vec(&read_image(&self.gpu, &ambient))
    }

    fn close(self) {
        let Self { gpu, kernel, mask, field } = self;
        drop((kernel, mask, field));
        close(gpu);
    }
}

/// Blobs of soft and of opaque matter, each of a feature, some of none; between them nothing, of whatever feature.
fn blobs(random: &mut Random, grid: &Grid, features: u8) -> (Vec<u16>, Vec<u8>) {
    let (mut opacity, mut labels) = (vec![0_u16; grid.len()], vec![0_u8; grid.len()]);
    for _ in 0..2 + grid.len() / 200 {
        let centre: [f32; 3] = std::array::from_fn(|i| random.between(0.0, grid.dims[i] as f32));
        let (r, a) = (random.between(0.5, 4.5), random.between(-0.3, 1.2).clamp(0.0, 1.0));
        let feature = random.below(u64::from(features) + 1) as u8;
        for i in 0..grid.len() {
            let d: f32 = grid.voxel(i).iter().zip(centre).map(|(&v, c)| (v as f32 - c).powi(2)).sum();
            if d < r * r {
                (opacity[i], labels[i]) = ((a * 65535.0).round() as u16, feature);
            }
        }
    }
    (opacity, labels)
}

#[test]
fn every_rule_equals_its_twin_in_any_order() {
    let mut random = Random::new(22);
    let extra = Grid { dims: [20, 18, 17], spacing: [1.0, 0.5, 0.8] };
    let (mut sum, mut count, mut mixed) = (0.0, 0.0, 0);
    let mut state = State::new(&GRIDS[0]);
    for (case, grid) in GRIDS.iter().chain([&extra]).enumerate() {
        state.take(grid);
        for (turn, (rays_of, [radius, offset, step], reference, features)) in [
            (RaySet::Spiral(10), [Some(7.0), None, None], 1.0, 3),
            (RaySet::R6, [Some(5.0), None, None], 1.0, 8),
            (RaySet::Spiral(6), [Some(1.0), Some(0.0), None], 1.0, 4),
            (RaySet::R6, [Some(11.0), Some(0.2), Some(1.7)], 0.7, 2),
        ]
        .into_iter()
        .enumerate()
        {
            let (opacity, labels) = blobs(&mut random, grid, features);
            let images = [
                state.image(Format::R16Unorm, bytemuck::cast_slice(&opacity)),
                state.image(Format::R8Uint, &labels),
            ];
            let masked = state.masked(&images[0], &images[1], features.into());
            let scope = if random.below(2) == 0 { Scope::Needed } else { Scope::All };
            let matter = Matter { grid, opacity: &opacity, labels: &labels, features };
            for (c, combine) in RULES.into_iter().enumerate() {
                let rule = Quadrature::BRICK[(case + turn + c) % 3];
                let mm = |voxels: f64| (voxels * grid.min_spacing()) as f32;
                let occlusion = Occlusion {
                    rays: rays_of,
                    quadrature: rule,
                    radius_mm: mm(radius.unwrap_or(0.0)),
                    offset_mm: offset.map(mm),
                    step_mm: step.map(mm),
                    ..Occlusion::paper(1.0)
                };
                let reference_mm = reference * occlusion.step(grid.min_spacing());
                let [opacity, labels] = &images;
                let asked = Asked { opacity, labels, masked: &masked, reference_mm, scope };
                let mut plan = RayPlan::new(state.field.spacing, &occlusion).unwrap();
                let mut bricks = state.all();
                let found = state.computed(&plan, combine, asked, &bricks);
                let expected = fdao(matter, &occlusion, reference_mm, combine, scope == Scope::All);
                let exact = rule == Quadrature::Nearest && reference == 1.0;
                for (i, (f, e)) in found.iter().zip(&expected).enumerate() {
                    let apart = (0..4).map(|c| f[c].abs_diff(e[c])).max().unwrap();
                    let error = f64::from(apart) / 65535.0;
                    let rounded = if combine == Combine::Neighbours { ROUNDED } else { 0 };
                    let allowed = match exact {
                        true => f64::from(rounded) / 65535.0,
                        false => {
                            let cells = occlusion.samples(grid.min_spacing());
                            DARK + OF_FILTER * filter_error(&state.gpu) + of_opaque_cells(&state.gpu, cells)
                        }
                    };
                    assert!(
                        error <= allowed,
                        "{combine:?} {occlusion:?} of {features} {:?} in {grid:?}: {f:?} {e:?}",
                        grid.voxel(i)
                    );
                    (sum, count) = (sum + error, count + 1.0);
                    mixed += u64::from(f.iter().any(|v| *v != f[0]));
                }
                bricks.reverse();
                plan.directions.reverse();
                assert_eq!(
                    found,
                    state.computed(&plan, combine, asked, &bricks),
                    "list and directions reversed"
                );
            }
        }
    }
    state.close();
    assert!(sum / count < MEAN + 0.1 * 1.5 / 256.0, "mean {}", sum / count);
    assert!(mixed > 500, "features' values differ at {mixed} voxels only");
}

/// Where all matter is of one feature every rule has the values of rays by brick, to the bit. Where it is of two it has not.
#[test]
fn one_feature_has_the_values_of_rays_by_brick() {
    let grid = Grid { dims: [30, 22, 19], spacing: [0.9, 1.0, 1.3] };
    let state = State::new(&grid);
    let rays = Rays::new(&state.gpu).unwrap();
    let (opacity, two) = blobs(&mut Random::new(4), &grid, 2);
    let opacity = state.image(Format::R16Unorm, bytemuck::cast_slice(&opacity));
    let one = state.image(Format::R8Uint, &vec![1; grid.len()]);
    let two = state.image(Format::R8Uint, &two);
    let masks = [state.masked(&opacity, &one, 1), state.masked(&opacity, &two, 2)];
    for quadrature in Quadrature::BRICK {
        let occlusion = Occlusion {
            rays: RaySet::Spiral(20),
            quadrature,
            radius_mm: 9.0,
            offset_mm: None,
            step_mm: None,
            ..Occlusion::paper(1.0)
        };
        let plan = RayPlan::new(state.field.spacing, &occlusion).unwrap();
        let asked = |labels, masked| {
            let (reference_mm, scope) = (1.1, Scope::Needed);
            Asked { opacity: &opacity, labels, masked, reference_mm, scope }
        };
        let [of_one, of_two] = [asked(&one, &masks[0]), asked(&two, &masks[1])];
        let all = state.of_all_matter(&rays, &plan, of_one);
        for combine in RULES {
            let least = |asked| -> Vec<u16> {
                let found = state.computed(&plan, combine, asked, &state.all());
                found.into_iter().map(|v| v.into_iter().min().unwrap()).collect()
            };
            assert_eq!(least(of_one), all, "{quadrature:?} {combine:?}");
            assert_ne!(least(of_two), all, "{quadrature:?} {combine:?}");
        }
    }
    drop((rays, opacity, one, two, masks));
    state.close();
}
