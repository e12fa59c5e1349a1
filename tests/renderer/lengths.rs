//! Lengths are relative to the volume: the same scene in other units is the same picture.

use cao::renderer::{COLOUR, Renderer, StereoImage};
use cao_formats::Picture;
use cao_gpu::Gpu;
use cao_measure::exactness::{Plan, verify};
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::fit::Fitting;
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::{StereoRig, View};
use cao_testing::*;
use glam::Vec3;

/// What a scene shows: ambient factors, opacities, both eyes as they frame the box, and as they frame what is visible. Its renderer holds pipelines,
/// so that those after it compile none.
type Shown = (Vec<f32>, Vec<f32>, StereoImage<4>, Renderer);

/// A scene with every length that there is, each times `unit`.
fn shown(gpu: &Gpu, method: Method, unit: f32) -> Shown {
    let spacing = [1.0, 1.25, 0.75].map(|s| s * f64::from(unit));
    let volume = builtin_box("engine", [26, 24, 30], spacing).unwrap();
    let mut transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    transfer.reference_mm = Some(1.5 * unit);
    let mut setup = Setup::of(method, volume.min_spacing());
    let o = &mut setup.occlusion;
    (o.radius_mm, o.offset_mm, o.step_mm) = (6.0 * unit, Some(0.25 * unit), Some(unit));
    (setup.maps.resolution, setup.maps.cells) = (128, 64);
    let clip = |shape, mode, at: [f32; 3], size: f32| {
        let pose = Pose {
            translate_mm: Vec3::from_array(at) * unit,
            rotate_deg: Vec3::new(20.0, -35.0, 50.0),
            scale: Vec3::new(1.0, 0.8, 1.2) * size * unit,
        };
        Clip { shape, mode, pose }
    };
    let clips = [
        clip(Shape::Mesh(concave()), Mode::Remove, [4.0, -3.0, 2.0], 5.0),
        clip(Shape::Sphere, Mode::Remove, [-7.0, -7.0, 7.0], 6.0),
        clip(Shape::Cone, Mode::Remove, [8.0, 6.0, -4.0], 4.0),
        clip(Shape::Box, Mode::Keep, [0.0, 0.0, 0.0], 13.0),
        // A half-space has no size: its scale says nothing.
        Clip {
            pose: Pose { translate_mm: Vec3::Z * 8.0 * unit, ..Pose::default() },
            ..Clip::remove(Shape::Plane)
        },
    ];
    let mut renderer = renderer_of(gpu, &volume, transfer, setup, COLOUR).unwrap();
    renderer.set_clips(&clips).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let fitting = Fitting {
        azimuth_deg: 30.0,
        elevation_deg: 25.0,
        fov_deg: None,
        aspect: 1.0,
        distance_mm: None,
        ipd_mm: None,
        screen_mm: None,
    };
    let fitted = fitting.rig(|ways| renderer.visible_extent(ways)).unwrap().unwrap();
    let eyes = [StereoRig::framing(volume.size_mm(), 30.0, 25.0), fitted].map(|rig| {
        let reach = 3.0 * rig.position.length();
        rig.views(1.0, 1e-3 * reach, reach).unwrap()
    });
    let views: [View; 4] = [eyes[0][0], eyes[0][1], eyes[1][0], eyes[1][1]];
    let look = Look { step_mm: Some(0.3 * unit), ..Look::default() };
    let (image, _) = renderer.draw(&views, &look, [40, 36]).unwrap();
    (renderer.read_ambient().unwrap(), renderer.read_opacity().unwrap(), image, renderer)
}

/// All of them; of methods that have the lengths of another the first and the last.
fn every<T>(all: impl IntoIterator<Item = T>, method: Method) -> Vec<T> {
    let mut all: Vec<T> = all.into_iter().collect();
    if !kinds().contains(&method) {
        all.drain(1..all.len() - 1);
    }
    all
}

#[test]
fn a_scene_in_units_of_a_power_of_two_is_the_same_to_the_bit() {
    let gpu = open();
    for method in methods() {
        let (ambient, opacity, image, _held) = shown(&gpu, method, 1.0);
        // Means of neighbourhoods are nowhere as dark as rays are.
        let dark = if kinds().contains(&method) { 0.5 } else { 0.9 };
        assert!(ambient.iter().any(|a| *a < dark) && opacity.iter().any(|a| *a > 0.5), "{}", method.name());
        assert!(image.colour.iter().all(|eye| eye.iter().filter(|p| p[3] > 0.5).count() > 200));
        // From 2 pm to a thousand kilometres.
        for power in every([-29, -20, -3, 1, 13, 20, 29], method) {
            let found = shown(&gpu, method, 2.0_f32.powi(power));
            let context = format!("{} 2^{power}", method.name());
            assert!(found.0 == ambient, "ambient {context}");
            assert!(found.1 == opacity, "opacity {context}");
            assert!(found.2.colour == image.colour && found.2.depth == image.depth, "picture {context}");
        }
    }
    close(gpu);
}

/// Units that are no power of two round: a level of 255 at most.
#[test]
fn a_scene_in_any_units_is_the_same_picture() {
    let gpu = open();
    let pixels = |image: &StereoImage<4>| -> Vec<u8> {
        let eyes = image.colour.iter().map(|eye| Picture::over(image.size[0], image.size[1], eye, [0.0; 3]));
        eyes.flat_map(|eye| eye.pixels).flatten().collect()
    };
    for method in methods() {
        let (ambient, _, image, _held) = shown(&gpu, method, 1.0);
        for unit in every([1.5e-9, 1e-6, 1e-3, 1e3, 1e6, 0.7e9], method) {
            let found = shown(&gpu, method, unit);
            let worst = found.0.iter().zip(&ambient).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst <= 1.0 / 255.0, "{} {unit:e}: ambient factors are {worst} apart", method.name());
            let (found, expected) = (pixels(&found.2), pixels(&image));
            let worst = found.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(worst <= Some(1), "{} {unit:e}: pictures are {worst:?} levels apart", method.name());
        }
    }
    close(gpu);
}

/// Clips of any size in the volume's units leave nothing stale.
#[test]
fn clips_are_exact_in_any_units() {
    let gpu = open();
    // Pipelines last from one to the next.
    let mut held = None;
    for method in methods() {
        let poses = if kinds().contains(&method) { 5 } else { 2 };
        for unit in every([1e-9, 1e-6, 1e6], method) {
            let volume = builtin_box("fruit", [24; 3], [unit; 3]).unwrap();
            let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
            let setup = Setup::of(method, unit);
            let mut renderer = renderer_of(&gpu, &volume, transfer, setup, COLOUR).unwrap();
            let plan =
                Plan { shapes: vec![Shape::Sphere, Shape::Plane, Shape::Mesh(concave())], poses, seed: 1 };
            let report = verify(&mut renderer, &plan, &mut |_| ()).unwrap();
            assert!(report.exact(), "{} {unit:e}: {:?} {:?}", method.name(), report.total(), report.stereo);
            assert!(report.affected() > 0.0);
            held = Some(renderer);
        }
    }
    drop(held);
    close(gpu);
}

/// The largest and the smallest clips that are taken, and those that are refused, are shares of the volume.
#[test]
fn limits_of_clips_are_relative_to_the_volume() {
    let gpu = open();
    let mut held = None;
    for method in kinds() {
        for unit in [1.1e-9_f32, 1.0, 0.9e9] {
            let volume = builtin_box("engine", [16; 3], [f64::from(unit); 3]).unwrap();
            let half = 8.0 * unit * 3.0_f32.sqrt();
            let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
            let mut renderer =
                renderer_of(&gpu, &volume, transfer, Setup::of(method, unit.into()), COLOUR).unwrap();
            let clip = |shape: &Shape, scale: f32, at: f32| {
                let pose = Pose {
                    scale: Vec3::splat(scale * half),
                    translate_mm: Vec3::X * at * half,
                    ..Pose::default()
                };
                Clip { pose, ..Clip::remove(shape.clone()) }
            };
            for shape in [Shape::Sphere, Shape::Torus, Shape::Mesh(convex())] {
                for (scale, at) in [(1.1e-7, 0.0), (0.9e7, 0.0), (0.9e7, 0.9e7), (1.1e-7, -0.9e7), (0.5, 0.5)]
                {
                    renderer.set_clips(&[clip(&shape, scale, at)]).unwrap();
                    renderer.update(&mut |_| ()).unwrap();
                    let (found, _) = cao::verify::verify(&renderer, &mut |_| ()).unwrap();
                    let context = || format!("{} {} {unit:e} {scale:e} {at:e}", method.name(), shape.name());
                    assert_eq!(found.different, 0, "{}", context());
                    if at == 0.0 && !matches!(shape, Shape::Torus) {
                        let shown = renderer.read_opacity().unwrap().iter().any(|a| *a > 0.0);
                        assert_eq!(shown, scale < 1.0, "all of it or nothing: {}", context());
                    }
                }
                for (scale, at, said) in
                    [(0.9e-7, 0.0, "scale"), (1.1e7, 0.0, "scale"), (1.0, 1.1e7, "translation")]
                {
                    let error = renderer.set_clips(&[clip(&shape, scale, at)]).unwrap_err().to_string();
                    assert!(error.contains(said) && error.contains("this volume"), "{error}");
                }
            }
            // A half-space has no size.
            renderer.set_clips(&[Clip::remove(Shape::Plane), clip(&Shape::Plane, 1e-20, 0.1)]).unwrap();
            held = Some(renderer);
        }
    }
    drop(held);
    close(gpu);
}
