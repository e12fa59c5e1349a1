//! The kernel `lao` against its twin: CAO eq. (2) and (3) and the two better rules, every ray set.

use cao::cast::lao::{Bindings, Work};
use cao::cast::volumes::{Kernels, Volumes};
use cao::drive::{self, Pace, Part};
use cao::field::Field;
use cao::field::bricks::Which;
use cao::field::volume_image;
use cao::stages::{BRICKS, LAO};
use cao_gpu::{Access, Format, Gpu, Image};
use cao_measure::random::Random;
use cao_model::light::AmbientLight;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::Scope;
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;

/// How far a sample's position may be off, in voxels a voxel of the volume's longest axis: normalised coordinates up to 1
/// round to f32 (6e-8) at the ray's start, after its step, and once more in the sampler.
const POSITION: f64 = 3.0 * 6e-8;

/// Rounding of the functions along a ray, relative, as the shader has them: `pow`, `exp` and `log` of a software driver are
/// good to some 1e-6, the segment rule's series to 3e-7, and its closed form loses a digit at its end.
const FUNCTIONS: f64 = 1e-5;

/// Error of an ambient value whose rays have `samples` samples of opacity at most `largest`. Every sample moves by
/// [`POSITION`] along three axes, over which opacity changes by at most `largest` a voxel, and is filtered; a
/// transmittance, a product of factors up to 1, is off by the sum of what they are off by, independently of each other; a
/// mean of transmittances no more. q^(Δ/ℓ), with q >= 1 - largest, steepens that by `steepness`.
fn tolerance(gpu: &Gpu, grid: &Grid, occlusion: &Occlusion, reference_mm: f64, largest: f64) -> f64 {
    let samples = f64::from(occlusion.samples(grid.min_spacing()));
    let longest = grid.dims.into_iter().max().unwrap() as f64;
    let exponent = f64::from(occlusion.step(grid.min_spacing())) / reference_mm;
    let steepness = exponent * (1.0 - largest).powf((exponent - 1.0).min(0.0));
    let sample = largest * (3.0 * POSITION * longest + filter_error(gpu));
    samples.sqrt() * steepness.max(1.0) * sample + FUNCTIONS
}

#[derive(Clone, Copy)]
struct Settings {
    occlusion: Occlusion,
    scope: Scope,
    reference_mm: f32,
}

struct Bench<'a> {
    gpu: &'a Gpu,
    kernels: &'a Kernels,
    field: Field,
    volumes: Volumes,
}

impl<'a> Bench<'a> {
    fn new(gpu: &'a Gpu, kernels: &'a Kernels, grid: &Grid) -> Self {
        let field = blank(gpu, grid);
        Self { gpu, kernels, volumes: Volumes::new(gpu, &field).unwrap(), field }
    }

    /// The bricks in scope, then their rays, from `opacity` into `out`.
    fn parts<'b>(&'b self, opacity: &'b Image, out: &'b Image, settings: &'b Settings) -> [Part<'b>; 2] {
        let (field, k, v) = (&self.field, self.kernels, &self.volumes);
        let Settings { occlusion, scope, reference_mm } = settings;
        let (mask, precomputed) = (&v.mask, &v.full_opacity);
        let b = Bindings { opacity, list: &v.list, mask, precomputed, ambient: out };
        let listed = Part::short(BRICKS, move |rec| {
            rec.clear_image(out, [1.0; 4])?;
            rec.barrier(&[Access::TransferWrite], &[Access::StorageWrite]);
            let which = if *scope == Scope::All { Which::All } else { Which::Needed };
            Ok(k.bricks.record(rec, field, which, opacity, mask, &v.changed_before, &v.list)?)
        });
        // So few at first that there are several parts.
        let rays = Part::items(LAO, v.list.items(field), 5, move |rec, take| {
            Ok(k.lao.record(rec, field, occlusion, *reference_mm, *scope, Work::Full, b, take)?)
        });
        [listed, rays]
    }

    /// In parts, on the device's own queue.
    fn run(&self, opacity: &Image, settings: &Settings) -> Vec<f32> {
        let out = self.out();
        run(self.gpu, |rec| self.kernels.lao.record_rays(rec, &settings.occlusion).unwrap());
        let mut last = 0.0;
        drive::run(self.gpu, &self.parts(opacity, &out, settings), &mut Pace::default(), &mut |part| {
            assert!(part >= last && part <= 1.0);
            last = part;
        })
        .unwrap();
        assert_eq!(last, 1.0);
        read_floats(self.gpu, &out)
    }

    /// By one indirect dispatch.
    fn record(&self, opacity: &Image, settings: &Settings) -> Vec<f32> {
        let out = self.out();
        run(self.gpu, |rec| {
            self.kernels.lao.record_rays(rec, &settings.occlusion).unwrap();
            drive::record(rec, &self.parts(opacity, &out, settings)).unwrap();
        });
        read_floats(self.gpu, &out)
    }

    fn out(&self) -> Image {
        let out = volume_image(self.gpu, "out", &self.field, Format::R32Float).unwrap();
        run(self.gpu, |rec| {
            rec.discard(&out);
            rec.barrier(&[], &[Access::TransferWrite]);
        });
        out
    }
}

fn compare(grid: &Grid, found: &[f32], expected: &[f64], tolerance: f64, context: &str) {
    let mut worst = (0.0, 0);
    for i in 0..grid.len() {
        assert!(found[i].is_finite(), "{context}: voxel {:?} is {}", grid.voxel(i), found[i]);
        let error = (f64::from(found[i]) - expected[i]).abs();
        if error > worst.0 {
            worst = (error, i);
        }
    }
    let (error, i) = worst;
    assert!(
        error <= tolerance,
        "{context} {:?}: voxel {:?} is {} instead of {}: {error:e} off, tolerance {tolerance:e}",
        grid.dims,
        grid.voxel(i),
        found[i],
        expected[i]
    );
}

/// Rays inside and far beyond the volume, shorter than a step, other steps and offsets, other reference lengths; in
/// smallest spacings.
const LENGTHS: [(f32, Option<f32>, Option<f32>, f64); 8] = [
    (4.0, None, None, 1.0),
    (0.0, None, None, 1.0),
    (0.4, None, None, 1.0),
    (1.0, None, None, 1.0),
    (30.0, None, None, 1.0),
    (5.0, Some(0.6), None, 1.0),
    (5.0, Some(1.7), Some(2.5), 1.0),
    (6.0, Some(0.8), Some(0.0), 0.5),
];

fn occlusion(rays: RaySet, quadrature: Quadrature, turn: usize, smallest: f64) -> (Occlusion, f64) {
    let (radius, step, offset, reference) = LENGTHS[turn % LENGTHS.len()];
    let mm = |length: f32| length * smallest as f32;
    let (radius_mm, step_mm, offset_mm) = (mm(radius), step.map(mm), offset.map(mm));
    (
        Occlusion { rays, quadrature, radius_mm, offset_mm, step_mm, ..Occlusion::paper(1.0) },
        reference * smallest,
    )
}

/// Opacities up to this are far enough from 1 that no function along a ray has an unbounded slope there.
const LARGEST: f32 = 0.9;

#[test]
fn every_ray_set_and_rule_at_every_length_and_size() {
    let gpu = open();
    let kernels = Kernels::new(&gpu).unwrap();
    let mut random = Random::new(5);
    let mut turn = 0;
    for (g, grid) in GRIDS.iter().enumerate() {
        let bench = Bench::new(&gpu, &kernels, grid);
        let opacity = opacities(&mut random, grid, LARGEST);
        let image = float_image(&gpu, &bench.field, &opacity);
        for rays in RaySet::ALL {
            for quadrature in Quadrature::CAST {
                // All lengths with each set and rule on the small odd size, two of them in turn on the others.
                for _ in 0..if g == 3 { LENGTHS.len() } else { 2 } {
                    let (occlusion, reference_mm) = occlusion(rays, quadrature, turn, grid.min_spacing());
                    turn += 1;
                    let settings =
                        Settings { occlusion, scope: Scope::All, reference_mm: reference_mm as f32 };
                    let expected = twin::cast::lao::lao(grid, &opacity, &occlusion, reference_mm);
                    let tolerance = tolerance(&gpu, grid, &occlusion, reference_mm, LARGEST.into());
                    let context = format!("{occlusion:?}");
                    compare(grid, &bench.run(&image, &settings), &expected, tolerance, &context);
                }
            }
            turn += 1;
        }
    }
    drop(kernels);
    close(gpu);
}

/// In light from above, and in one of harmonics, by the same tolerance; in another light they are not those values.
#[test]
fn directions_weigh_as_light_comes_from_them() {
    let gpu = open();
    let kernels = Kernels::new(&gpu).unwrap();
    let grid = GRIDS[3];
    let bench = Bench::new(&gpu, &kernels, &grid);
    let opacity = opacities(&mut Random::new(8), &grid, LARGEST);
    let image = float_image(&gpu, &bench.field, &opacity);
    for quadrature in Quadrature::CAST {
        let (even, reference_mm) = occlusion(RaySet::W26, quadrature, 0, grid.min_spacing());
        for light in [AmbientLight::SKY, coloured_light().channel(2)] {
            let occlusion = Occlusion { light, ..even };
            let settings = Settings { occlusion, scope: Scope::All, reference_mm: reference_mm as f32 };
            let expected = twin::cast::lao::lao(&grid, &opacity, &occlusion, reference_mm);
            let tolerance = tolerance(&gpu, &grid, &occlusion, reference_mm, LARGEST.into());
            let found = bench.run(&image, &settings);
            compare(&grid, &found, &expected, tolerance, &format!("{occlusion:?}"));
            let other = twin::cast::lao::lao(&grid, &opacity, &even, reference_mm);
            let rms = |values: &[f64]| {
                let squares = found.iter().zip(values).map(|(f, v)| (f64::from(*f) - v).powi(2));
                (squares.sum::<f64>() / found.len() as f64).sqrt()
            };
            // The bound is for the worst voxel, and with a filter of hardware as wide as any light's change of one.
            assert!(rms(&expected) < 0.25 * rms(&other), "{} {}", rms(&expected), rms(&other));
        }
    }
    drop((bench, image));
    drop(kernels);
    close(gpu);
}

/// Solid blocks, where rays end. Left and cell rules with a step of one reference length are as good as elsewhere: there
/// q^1 = q. The segment rule's logarithm is not: see [`OPAQUE_SEGMENT`].
#[test]
fn opaque_blocks() {
    /// Share of a step that the segment rule may give or take where both ends of a segment are opaque but for rounding:
    /// 1/λ at the smallest q that it does not take for 0, 1e-6, and 1/λ of the next; once a ray, in the mean over rays.
    const OPAQUE_SEGMENT: f64 = 2.0 / 13.8;

    let gpu = open();
    let kernels = Kernels::new(&gpu).unwrap();
    let mut random = Random::new(6);
    for grid in &GRIDS[3..] {
        let bench = Bench::new(&gpu, &kernels, grid);
        let mut opacity = vec![0.0; grid.len()];
        for _ in 0..12 {
            let corner: [usize; 3] = std::array::from_fn(|a| random.below(grid.dims[a] as u64) as usize);
            let edge = 1 + random.below(4) as usize;
            for (i, a) in opacity.iter_mut().enumerate() {
                let voxel = grid.voxel(i);
                if (0..3).all(|axis| (corner[axis]..corner[axis] + edge).contains(&voxel[axis])) {
                    *a = 1.0;
                }
            }
        }
        let image = float_image(&gpu, &bench.field, &opacity);
        for quadrature in Quadrature::CAST {
            let occlusion = Occlusion {
                rays: RaySet::W50,
                quadrature,
                radius_mm: 7.0 * grid.min_spacing() as f32,
                offset_mm: None,
                step_mm: None,
                ..Occlusion::paper(1.0)
            };
            let reference_mm = grid.min_spacing();
            let settings = Settings { occlusion, scope: Scope::All, reference_mm: reference_mm as f32 };
            let expected = twin::cast::lao::lao(grid, &opacity, &occlusion, reference_mm);
            let found = bench.run(&image, &settings);
            let mut tolerance = tolerance(&gpu, grid, &occlusion, reference_mm, 1.0);
            if quadrature == Quadrature::Segment {
                let off = |i: &usize| (f64::from(found[*i]) - expected[*i]).abs() > tolerance;
                assert!((0..grid.len()).filter(off).count() <= grid.len() / 50, "{:?}", grid.dims);
                tolerance += OPAQUE_SEGMENT / f64::from(occlusion.samples(grid.min_spacing()));
            }
            compare(grid, &found, &expected, tolerance, &format!("{quadrature:?}"));
        }
    }
    drop(kernels);
    close(gpu);
}

/// Where only needed voxels get a value, those have the same bits as when all have one, and the others 1.
#[test]
fn needed_voxels_have_the_same_bits_and_the_others_one() {
    let gpu = open();
    let kernels = Kernels::new(&gpu).unwrap();
    let mut random = Random::new(7);
    for grid in GRIDS {
        let bench = Bench::new(&gpu, &kernels, &grid);
        let mut opacity = vec![0.0; grid.len()];
        for _ in 0..3 {
            opacity[random.below(grid.len() as u64) as usize] = random.between(0.01, 1.0);
        }
        let image = float_image(&gpu, &bench.field, &opacity);
        for quadrature in Quadrature::CAST {
            let (occlusion, reference_mm) = occlusion(RaySet::R26, quadrature, 0, grid.min_spacing());
            let all = Settings { occlusion, scope: Scope::All, reference_mm: reference_mm as f32 };
            let every = bench.run(&image, &all);
            let needed = bench.run(&image, &Settings { scope: Scope::Needed, ..all });
            for i in 0..grid.len() {
                let near =
                    opacity[i] > 0.0 || grid.neighbours(grid.voxel(i)).any(|n| opacity[grid.index(n)] > 0.0);
                let expected = if near { every[i] } else { 1.0 };
                assert_eq!(needed[i].to_bits(), expected.to_bits(), "{:?} {:?}", grid.dims, grid.voxel(i));
            }
        }
    }
    drop(kernels);
    close(gpu);
}

/// How the list is dispatched, in parts by the program or at once by the device, decides no bit.
#[test]
fn parts_and_one_indirect_dispatch_give_the_same_bits() {
    let gpu = open();
    let kernels = Kernels::new(&gpu).unwrap();
    let mut random = Random::new(8);
    // 54 rays of 30 samples make parts of five bricks at first; here are 45.
    let grid = Grid { dims: [33, 17, 18], spacing: [1.0, 1.1, 0.9] };
    let bench = Bench::new(&gpu, &kernels, &grid);
    let opacity = opacities(&mut random, &grid, 1.0);
    let image = float_image(&gpu, &bench.field, &opacity);
    for (quadrature, scope) in Quadrature::CAST.into_iter().zip([Scope::All, Scope::Needed, Scope::All]) {
        let (occlusion, reference_mm) = occlusion(RaySet::R54, quadrature, 4, grid.min_spacing());
        let settings = Settings { occlusion, scope, reference_mm: reference_mm as f32 };
        let parts: Vec<u32> = bench.run(&image, &settings).into_iter().map(f32::to_bits).collect();
        let once: Vec<u32> = bench.record(&image, &settings).into_iter().map(f32::to_bits).collect();
        assert!(parts == once, "{quadrature:?}");
    }
    drop(bench);
    drop(image);
    drop(kernels);
    close(gpu);
}
