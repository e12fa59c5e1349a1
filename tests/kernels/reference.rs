//! The converged references: the kernel against its twin, stated errors that hold, samples, the image, refusals.

use cao::field::Field;
use cao_gpu::Gpu;
use cao_measure::error::{counting, errors};
use cao_measure::kernels::reference::{Points, Reference, upload_clearance};
use cao_measure::random::Random;
use cao_measure::reference;
use cao_measure::reference::Plan;
use cao_model::light::AmbientLight;
use cao_model::look::Look;
use cao_model::occlusion::{Integral, Occlusion, Quadrature, RaySet};
use cao_model::transfer::TransferFunction;
use cao_model::view::{StereoRig, View};
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;
use cao_twin::draw::raycast::{Frame, Image, ambient_positions, raycast, raycast_lit};
use glam::Vec3;

/// How far f32 may be from f64. Positions round to 6e-8 of coordinates up to 32, three times on each of three axes, over
/// which opacity changes by up to 1 a voxel: 2e-5 a sample at the very most and rarely a tenth of it, either way, in a mean
/// over a hundred rays; `log` and `exp` are good to 1e-6.
const ROUNDING: f64 = 5e-6;

/// Random opacities inside a rim of one transparent voxel, a quarter of them opaque.
fn rimmed(random: &mut Random, inner: &Grid) -> (Grid, Vec<f32>) {
    let grid = Grid { dims: inner.dims.map(|d| d + 2), ..*inner };
    let opacity = (0..grid.len()).map(|i| {
        let inside = (0..3).all(|a| (1..=inner.dims[a]).contains(&grid.voxel(i)[a]));
        let value = random.between(-1.0, 1.5).clamp(0.0, 1.0);
        // Blocks of clear voxels, so that there is something to skip.
        if inside && grid.voxel(i)[0] % 9 < 4 { value } else { 0.0 }
    });
    (grid, opacity.collect())
}

#[test]
fn kernel_and_twin_agree_at_any_point_whoever_interpolates() {
    let gpu = open();
    let mut random = Random::new(11);
    let mut kernel = Reference::new(&gpu).unwrap();
    for inner in GRIDS {
        let (grid, opacity) = rimmed(&mut random, &inner);
        let field = Field::upload(&gpu, &volume_of(&grid, opacity.clone())).unwrap();
        let clearance = upload_clearance(&gpu, &field, &opacity).unwrap();
        let smallest = grid.min_spacing();
        // Centres of voxels and points between them, in index coordinates of the volume without its rim.
        let points: Vec<[f64; 3]> = (0..90)
            .map(|i| {
                inner.dims.map(|d| {
                    let at = f64::from(random.between(-0.5, d as f32 - 0.5));
                    if i % 2 == 0 { at.round().clamp(0.0, d as f64 - 1.0) } else { at }
                })
            })
            .collect();
        let with_rim: Vec<[f64; 3]> = points.iter().map(|p| p.map(|c| c + 1.0)).collect();
        for integral in [
            Integral::ambient(6.0 * smallest, 0.5 * smallest, 8, 100, smallest),
            Integral::ambient(40.0 * smallest, 0.0, 3, 100, smallest),
            Integral::literal(6.0 * smallest, 100, smallest),
            Integral::end(6.0 * smallest, 100, smallest),
            Integral::ambient(0.0, 0.0, 8, 100, smallest),
            Integral {
                light: AmbientLight::Sky([1.0, -2.0, 0.5]),
                ..Integral::literal(6.0 * smallest, 100, smallest)
            },
        ] {
            let on_device = Points::upload(&gpu, &points, &integral).unwrap();
            let reference_mm = 1.3 * smallest;
            let expected =
                twin::measure::reference::reference(&grid, &opacity, &integral, reference_mm, &with_rim);
            let longer =
                Integral { step_mm: 1.01 * integral.step_mm, first_mm: 1.01 * integral.first_mm, ..integral };
            let other =
                twin::measure::reference::reference(&grid, &opacity, &longer, reference_mm, &with_rim);
            for filtered in [true, false] {
                // Only software drivers filter in f32.
                if filtered && filter_error(&gpu) > ROUNDING {
                    continue;
                }
                kernel.filtered = filtered;
                for (base, count) in [(0, 37), (37, 53)] {
                    run(&gpu, |rec| {
                        kernel
                            .record(rec, &field, &clearance, &integral, reference_mm, &on_device, base, count)
                            .unwrap();
                    });
                }
                let found = on_device.read(&gpu).unwrap();
                let worst = |expected: &[f64]| {
                    let off = found.iter().zip(expected).map(|(f, e)| (f64::from(*f) - e).abs());
                    off.fold(0.0, |a, b| if b.is_nan() { b } else { f64::max(a, b) })
                };
                let context = format!("{:?} {integral:?} {filtered}", grid.dims);
                assert!(worst(&expected) < ROUNDING, "{context}: {:e}", worst(&expected));
                // The tolerance tells rays apart that are a hundredth longer.
                assert!(
                    integral.samples == 0 || worst(&other) > 10.0 * ROUNDING,
                    "{context}: {:e}",
                    worst(&other)
                );
            }
        }
    }
    drop(kernel);
    close(gpu);
}

/// A built-in volume with soft and hard parts, as opacity.
fn fruit(size: usize) -> (Grid, Vec<f32>) {
    let volume = cao_formats::open(format!("builtin:fruit:{size}")).unwrap();
    let transfer = cao_model::transfer::TransferFunction::preset("auto", volume.range()).unwrap();
    let opacity = (0..volume.len()).map(|i| transfer.opacity_at(volume.value(i) as f32)).collect();
    (grid_of(&volume), opacity)
}

const RADIUS: f64 = 6.0;

#[test]
fn the_stated_error_is_the_error() {
    let gpu = open();
    let (grid, opacity) = fruit(20);
    let at = |directions, steps_per_voxel| {
        let plan = Plan { directions, steps_per_voxel, max_voxels: 400, ..Plan::FULL };
        reference::ambient(&gpu, &grid, &opacity, RADIUS, 0.5, 1.0, &plan, &mut |_| ()).unwrap()
    };
    let [rough, good, truth] = [at(30, 1), at(250, 4), at(2000, 8)];
    let states = |r: &reference::Reference| r.convergence.rmse;
    for coarse in [&rough, &good] {
        let actual = errors(&coarse.ambient, &truth.ambient, &truth.counts);
        assert_eq!(actual.count, 400);
        // What a doubling changes is most of what is missing: halves or better with each.
        assert!(actual.rmse < 2.0 * states(coarse) && actual.rmse > 0.5 * states(coarse), "{actual:?}");
    }
    assert!(states(&rough) > 5.0 * states(&good) && states(&good) > 2.0 * states(&truth));
    close(gpu);
}

/// A sample has as many voxels as asked for, of those that count, in all parts of the volume, and the same values.
#[test]
fn a_sample_is_part_of_the_whole() {
    let gpu = open();
    let (grid, opacity) = fruit(20);
    let at = |max_voxels| {
        let plan = Plan { directions: 40, steps_per_voxel: 1, max_voxels, ..Plan::FULL };
        let mut last = 0.0;
        let mut progress = |part: f64| {
            assert!(part >= last && part < 1.0 + 1e-9);
            last = part;
        };
        let found = reference::literal(&gpu, &grid, &opacity, RADIUS, 1.0, &plan, &mut progress).unwrap();
        assert!(last > 1.0 - 1e-9);
        found
    };
    let (whole, part) = (at(usize::MAX), at(160));
    let count = |counts: &[bool]| counts.iter().filter(|c| **c).count();
    assert_eq!(whole.counts, counting(&grid, &opacity));
    assert_eq!((part.counting, whole.counting), (count(&whole.counts), count(&whole.counts)));
    assert_eq!(count(&part.counts), 160);
    let mut octants = [0; 8];
    for i in 0..grid.len() {
        assert_eq!(part.ambient[i].is_finite(), part.counts[i]);
        if part.counts[i] {
            assert_eq!(part.ambient[i].to_bits(), whole.ambient[i].to_bits());
            octants[(0..3).map(|a| usize::from(grid.voxel(i)[a] >= 10) << a).sum::<usize>()] += 1;
        }
    }
    assert!(octants.iter().all(|n| *n > 8), "{octants:?}");
    close(gpu);
}

/// More rays take the paper's sum to the literal reference, and not to the ambient one.
#[test]
fn the_papers_sum_converges_to_the_literal_reference() {
    let gpu = open();
    let (grid, opacity) = fruit(16);
    let plan = Plan { directions: 1000, steps_per_voxel: 4, max_voxels: 500, ..Plan::FULL };
    let literal = reference::literal(&gpu, &grid, &opacity, RADIUS, 1.0, &plan, &mut |_| ()).unwrap();
    let ambient = reference::ambient(&gpu, &grid, &opacity, RADIUS, 0.5, 1.0, &plan, &mut |_| ()).unwrap();
    let error = |rays, to: &reference::Reference| {
        let settings = Occlusion {
            rays,
            quadrature: Quadrature::Left,
            radius_mm: RADIUS as f32,
            offset_mm: None,
            step_mm: None,
            ..Occlusion::paper(1.0)
        };
        let found: Vec<f32> =
            twin::cast::lao::lao(&grid, &opacity, &settings, 1.0).into_iter().map(|a| a as f32).collect();
        errors(&found, &to.ambient, &to.counts).rmse
    };
    let [six, many] = [RaySet::R6, RaySet::W50].map(|rays| error(rays, &literal));
    assert!(many < 0.1 * six, "{six} {many}");
    assert!(error(RaySet::W50, &ambient) > 5.0 * many);
    close(gpu);
}

/// A picture of 20 x 16 pixels of a small fruit.
struct Scene {
    grid: Grid,
    values: Vec<f32>,
    transfer: TransferFunction,
    opacity: Vec<f32>,
    view: View,
}

const SIZE: [usize; 2] = [20, 16];

impl Scene {
    fn new() -> Self {
        let volume = cao_formats::open("builtin:fruit:16").unwrap();
        let values: Vec<f32> = (0..volume.len()).map(|i| volume.value(i) as f32).collect();
        let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
        let opacity = values.iter().map(|v| transfer.opacity_at(*v)).collect();
        let [view, _] = StereoRig::framing(volume.size_mm(), 30.0, 20.0).views(1.2, 1.0, 300.0).unwrap();
        Self { grid: grid_of(&volume), values, transfer, opacity, view }
    }

    fn frame<'a>(&'a self, ambient: &'a [f32], step_mm: f64) -> Frame<'a> {
        let light = Vec3::new(-0.4, -0.7, 0.6).normalize();
        Frame {
            grid: self.grid,
            values: &self.values,
            parts: None,
            transfer: &self.transfer,
            reference_mm: 1.0,
            ambient,
            clips: &[],
            step_mm,
            look: Look { ambient: 0.3, diffuse: 0.3, light, ..Look::default() },
        }
    }

    fn reference(
        &self,
        gpu: &Gpu,
        ambient: &[f32],
        radius_mm: f64,
        directions: u32,
        steps_per_voxel: u32,
    ) -> reference::ImageReference {
        let plan = Plan { directions, steps_per_voxel, max_voxels: usize::MAX, ..Plan::FULL };
        reference::image(
            gpu,
            &self.frame(ambient, 1.0),
            &self.opacity,
            &self.view,
            SIZE,
            radius_mm,
            0.5,
            &plan,
            &mut |_| (),
        )
        .unwrap()
    }
}

/// Largest difference of two pictures' channels.
fn apart(a: &Image, b: &Image) -> f64 {
    let pixels = a.colour.as_flattened().iter().zip(b.colour.as_flattened());
    pixels.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
}

/// Light of the picture is at most 2 (the gain) times the ambient factor.
const IMAGE_ROUNDING: f64 = 2.0 * ROUNDING;

#[test]
fn the_image_reference_is_the_ray_cast_with_the_integral_at_each_sample() {
    let gpu = open();
    let scene = Scene::new();
    // Without a radius nothing is occluded: the ordinary ray cast of a volume of ones.
    let ones = vec![1.0; scene.grid.len()];
    let bare = raycast(&scene.frame(&ones, 0.25), &scene.view, SIZE);
    let found = scene.reference(&gpu, &ones, 0.0, 10, 4);
    assert!(apart(&found.image, &bare) < 1e-6);
    assert_eq!(found.image.depth, bare.depth);

    let integral = Integral::ambient(RADIUS, 0.5, 4, 60, 1.0);
    let evaluate =
        |p: &Vec<_>| twin::measure::reference::reference(&scene.grid, &scene.opacity, &integral, 1.0, p);
    let centres: Vec<[f64; 3]> =
        (0..scene.grid.len()).map(|i| scene.grid.voxel(i).map(|c| c as f64)).collect();
    let volume: Vec<f32> = evaluate(&centres).into_iter().map(|a| a as f32).collect();
    let found = scene.reference(&gpu, &volume, RADIUS, 60, 4);
    let fine = scene.frame(&volume, 0.25);
    let pixels: Vec<usize> = (0..SIZE[0] * SIZE[1]).collect();
    let positions = ambient_positions(&fine, &scene.view, SIZE, &pixels);
    assert_eq!(found.points, positions.iter().map(Vec::len).sum::<usize>());
    assert_eq!(found.covered, positions.iter().filter(|p| !p.is_empty()).count());
    assert!(found.covered > 30);
    let ambient: Vec<Vec<f64>> = positions.iter().map(evaluate).collect();
    let expected = raycast_lit(&fine, &scene.view, SIZE, &pixels, &ambient);
    assert!(apart(&found.image, &expected) < IMAGE_ROUNDING, "{}", apart(&found.image, &expected));

    // A volume of the same integral, interpolated, looks alike and is not the same.
    let from_volume = raycast(&fine, &scene.view, SIZE);
    let difference = apart(&found.image, &from_volume);
    assert!(difference > 100.0 * IMAGE_ROUNDING && difference < 0.1, "{difference}");

    // More directions and shorter steps, less change.
    let better = scene.reference(&gpu, &volume, RADIUS, 120, 8);
    assert!(better.convergence.rmse < found.convergence.rmse, "{:?}", better.convergence);
    assert!(found.convergence.rmse < 0.05 && better.convergence.count > 100);
    close(gpu);
}

#[test]
fn what_makes_no_sense_is_refused_by_name() {
    let gpu = open();
    let grid = Grid { dims: [4, 3, 2], spacing: [1.0; 3] };
    let opacity = vec![0.5; 24];
    let plan = Plan { directions: 10, steps_per_voxel: 2, max_voxels: 10, ..Plan::FULL };
    let at = |opacity: &[f32], radius, offset, length, plan: &Plan| {
        reference::ambient(&gpu, &grid, opacity, radius, offset, length, plan, &mut |_| ())
    };
    assert!(at(&opacity, 3.0, 0.5, 1.0, &plan).is_ok());
    let mut broken = opacity.clone();
    broken[7] = f32::NAN;
    let none = Plan { directions: 0, ..plan };
    let still = Plan { steps_per_voxel: 0, ..plan };
    for (refused, name) in [
        (at(&opacity[1..], 3.0, 0.5, 1.0, &plan), "opacity of a reference: 23 values"),
        (at(&broken, 3.0, 0.5, 1.0, &plan), "opacity of a reference"),
        (at(&opacity, f64::NAN, 0.5, 1.0, &plan), "radius_mm"),
        (at(&opacity, 3.0, -0.5, 1.0, &plan), "offset_mm"),
        (at(&opacity, 3.0, 0.5, 0.0, &plan), "reference_mm"),
        (at(&opacity, 3.0, 0.5, 1.0, &none), "reference: 10 points and 0 directions"),
        (at(&opacity, 3.0, 0.5, 1.0, &still), "steps_per_voxel"),
        (at(&opacity, 1e6, 0.5, 1.0, &plan), "samples of a reference's ray"),
    ] {
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
    }
    // Nothing to compute is no error, and no success either.
    let empty = at(&[0.0; 24], 3.0, 0.5, 1.0, &plan).unwrap();
    assert_eq!((empty.counting, empty.convergence.count), (0, 0));
    assert!(empty.convergence.rmse.is_nan() && empty.ambient.iter().all(|a| a.is_nan()));
    close(gpu);
}
