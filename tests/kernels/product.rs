//! The kernel `product` against its twin, over levels that the kernel `level` made; the answers that are known without either.

use cao::drive::Take;
use cao::field::bricks::BrickList;
use cao::field::volume_image;
use cao::pyramid::levels::{LevelImages, MakeLevels};
use cao::pyramid::plan::Plan;
use cao::spao::product::{Bindings, Product};
use cao_gpu::{Access, Format, Gpu};
use cao_measure::random::Random;
use cao_model::options::{Levels, Options};
use cao_model::settings::Scope;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::spao::product::product;

/// A level is off by less than half a 65535th for each one that it was made of, and a shell by 8/7 and 1/7 of its two; a look-up's
/// place is off by its rounding, 64 cells at 2⁻²³ in f32.
const ROUNDING: f64 = 2e-5;
/// Of the filter of each look-up.
const OF_FILTER: f64 = 9.0 / 7.0;

struct State {
    gpu: Gpu,
    make: MakeLevels,
    kernel: Product,
}

impl State {
    fn new() -> Self {
        let gpu = open();
        Self { make: MakeLevels::new(&gpu).unwrap(), kernel: Product::new(&gpu).unwrap(), gpu }
    }

    /// V_AO of every voxel, the bricks in this order.
    #[expect(clippy::too_many_arguments, reason = "what is computed of what, each named once")]
    fn computed(
        &self,
        grid: &Grid,
        opacity: &[u16],
        radius_mm: f64,
        options: &Options,
        reference_mm: f64,
        scope: Scope,
        reverse: bool,
    ) -> Vec<u16> {
        let field = blank(&self.gpu, grid);
        let image = volume_image(&self.gpu, "test opacity", &field, Format::R16Unorm).unwrap();
        write_image(&self.gpu, &image, bytemuck::cast_slice(opacity));
        let ambient = volume_image(&self.gpu, "test ambient", &field, Format::R16Unorm).unwrap();
        write_image(&self.gpu, &ambient, bytemuck::cast_slice(&vec![7_u16; grid.len()]));
        let mut bricks: Vec<u32> = (0..field.brick_count()).collect();
        if reverse {
            bricks.reverse();
        }
        let list = BrickList::of(&self.gpu, &bricks).unwrap();
        let (dims, spacing) = (field.dims, field.spacing);
        let plan = Plan::new(dims, spacing, radius_mm as f32, options.levels, options.normal).unwrap();
        let levels = LevelImages::new(&self.gpu, plan).unwrap();
        let exponent = field.min_spacing() / reference_mm as f32;
        run(&self.gpu, |rec| {
            self.make.record_table(rec, &levels.plan).unwrap();
            for part in self.make.parts(exponent, &levels, &image, None) {
                part.record(rec, &Take::All).unwrap();
            }
            let b = Bindings {
                opacity: &image,
                make: &self.make,
                levels: &levels,
                list: &list,
                ambient: &ambient,
            };
            let lifted = options.normal > 0.0;
            self.kernel.record(rec, &field, reference_mm as f32, lifted, scope, b, &Take::All).unwrap();
            rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        });
        bytemuck::pod_collect_to_vec(&read_image(&self.gpu, &ambient))
    }

    fn close(self) {
        let Self { gpu, make, kernel } = self;
        drop((make, kernel));
        close(gpu);
    }
}

const FORMS: [Levels; 5] =
    [Levels::Nbuffer, Levels::Mip, Levels::Mixed(1), Levels::Mixed(2), Levels::Reversed(2)];

fn options(levels: Levels, normal: f32) -> Options {
    Options { levels, normal, ..Options::DEFAULT }
}

/// Blocks of soft and of opaque matter, and nothing between them.
fn blocks(random: &mut Random, grid: &Grid) -> Vec<u16> {
    let opacities: Vec<u16> =
        (0..64).map(|_| [0, 0, 65535, random.below(65536) as u16][random.below(4) as usize]).collect();
    let of = |v: [usize; 3]| v[0] / 5 % 4 + 4 * (v[1] / 4 % 4) + 16 * (v[2] / 3 % 4);
    (0..grid.len()).map(|i| opacities[of(grid.voxel(i))]).collect()
}

#[test]
fn every_form_equals_its_twin_and_the_order_of_bricks_does_not_matter() {
    let state = State::new();
    let mut random = Random::new(41);
    let extra = [
        Grid { dims: [29, 26, 21], spacing: [1.0; 3] },
        Grid { dims: [26, 20, 13], spacing: [1.0, 0.5, 0.8] },
    ];
    let mut worst = 0.0_f64;
    for grid in GRIDS.iter().chain(&extra) {
        for form in FORMS {
            for (normal, voxels, reference) in
                [(0.0, 8.0, 1.0), (1.0, 5.0, 1.0), (2.5, 4.0, 2.0), (0.5, 0.5, 1.0)]
            {
                let opacity = blocks(&mut random, grid);
                let options = options(form, normal);
                let (radius_mm, reference_mm) = (voxels * grid.min_spacing(), reference * grid.min_spacing());
                let scope = if random.below(2) == 0 { Scope::Needed } else { Scope::All };
                let of = |reverse| {
                    state.computed(grid, &opacity, radius_mm, &options, reference_mm, scope, reverse)
                };
                let found = of(false);
                assert_eq!(found, of(true));
                let floats: Vec<f32> = opacity.iter().map(|&a| f32::from(a) / 65535.0).collect();
                let expected = product(grid, &floats, radius_mm, &options, reference_mm, scope == Scope::All);
                let allowed = 4.0 * (ROUNDING + OF_FILTER * filter_error(&state.gpu));
                for (i, (&found, expected)) in found.iter().zip(expected).enumerate() {
                    let error = (f64::from(found) / 65535.0 - expected).abs();
                    worst = worst.max(error);
                    let context = || format!("{options:?} {grid:?} {:?}: {found} {expected}", grid.voxel(i));
                    assert!(error <= allowed, "{}", context());
                }
            }
        }
    }
    println!("worst {worst}");
    state.close();
}

/// Computed in float64 outside of this program, L = 1 … 5 (methods of 2 to 32 voxels' cubes).
#[test]
fn known_answers() {
    let state = State::new();
    let grid = Grid { dims: [40, 40, 40], spacing: [1.0; 3] };
    let value = |opacity: &[u16], levels: i32, options: &Options, voxel| {
        let found =
            state.computed(&grid, opacity, f64::from(1 << (levels - 1)), options, 1.0, Scope::All, false);
        f64::from(found[grid.index(voxel)]) / 65535.0
    };
    // As printed, to four digits; and the rounding of five levels.
    let close = |found: f64, expected: f64| (found - expected).abs() < 5e-5 + 5.0 * ROUNDING;
    let half: Vec<u16> = (0..grid.len()).map(|i| if grid.voxel(i)[2] < 20 { 65535 } else { 0 }).collect();
    for (layer, normal, levels, expected) in [
        (19, 0.0, 1, 0.2857),
        (19, 0.0, 3, 0.0501),
        (19, 0.5, 2, 0.3444),
        (19, 1.0, 3, 0.6639),
        (19, 2.0, 2, 1.0),
        (20, 0.0, 3, 0.2401),
        (20, 1.0, 3, 1.0),
    ] {
        let found = value(&half, levels, &options(Levels::Nbuffer, normal), [20, 20, layer]);
        assert!(close(found, expected), "layer {layer} factor {normal} L {levels}: {found} {expected}");
    }
    let uniform = vec![19_661; grid.len()];
    for form in FORMS {
        let found = value(&uniform, 4, &options(form, 0.0), [20; 3]);
        assert!(close(found, 0.7_f64.powi(4)), "{form:?}: {found}");
    }
    let mut one = vec![0; grid.len()];
    one[grid.index([20; 3])] = 65535;
    let own = options(Levels::Nbuffer, 0.0);
    for (levels, voxel, expected) in [(2, [20; 3], 1.0), (1, [21, 20, 20], 0.9286), (2, [21, 20, 20], 0.9203)]
    {
        let found = value(&one, levels, &own, voxel);
        assert!(close(found, expected), "{voxel:?} L {levels}: {found} {expected}");
    }
    state.close();
}
