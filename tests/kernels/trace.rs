//! The kernel `trace` against its twin, and in pieces.

use cao::mesh::ambient::{ByRays, PixelAmbient, Pixels as On};
use cao::mesh::trace::{Rays, Trace};
use cao_gpu::{Access, Gpu};
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::surface::World;
use cao_model::view::View;
use cao_testing::worlds::{Pixels, clips, corner, corner_eyes, floats, solids, solids_eyes};
use cao_testing::*;
use cao_twin::mesh::gbuffer::gbuffer;
use cao_twin::mesh::trace::traced;
use glam::Vec3;

/// No multiple of a workgroup.
const SIZE: [u32; 2] = [37, 27];
const DELTA: f32 = 40.0;
/// Rays of the twin, along an edge of their grid, at each pixel of every so many.
const EDGE: u32 = 24;
const EVERY: usize = 11;

/// Mean of |difference| of two estimates by 576 and 512 rays each whose hits vary by less than one half: of random rays it would be
/// below 0.5/√512 = .022, and both sequences do better.
const MEAN: f64 = 0.01;

/// The same of 144 and 256 rays: below 0.5/√144 = .042 of random ones.
const FEWER: f64 = 0.02;

#[test]
fn rays_give_what_the_twin_integrates() {
    let gpu = open();
    let (world, views, clips) = (corner(), corner_eyes(SIZE), &clips()[..1]);
    let pixels = Pixels::clipped(&gpu, &world, clips, &views, SIZE);
    let accessibility = pixels.values(&gpu);
    let (surfaces, geometry) = (&pixels.surfaces, &pixels.geometry);
    let on = On { gpu: &gpu, geometry, surfaces, delta_mm: DELTA };
    let traced_by = |rays: u32| {
        let method = ByRays::walks(&gpu, rays).unwrap();
        for part in 0..method.parts(&on) {
            run(&gpu, |rec| {
                rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
                method.record(rec, &on, part, &accessibility).unwrap();
            });
        }
        floats(&gpu, &accessibility)
    };
    let found = traced_by(512);
    // In pieces, whatever those of the method are on this device: the same sums in the same order.
    let trace = Trace::new(&gpu).unwrap();
    for some in [0..100, 100..101, 101..512] {
        run(&gpu, |rec| {
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
            let rays = Rays { some, all: 512 };
            trace.record(rec, surfaces, geometry, DELTA, rays, &accessibility).unwrap();
        });
    }
    assert!(floats(&gpu, &accessibility) == found, "pieces are not the whole");
    let (mut sum, mut bias, mut count) = (0.0, 0.0, 0.0);
    for (view, eye) in views.iter().enumerate() {
        for (i, shown) in gbuffer(&world, clips, eye, SIZE).into_iter().enumerate().step_by(EVERY) {
            let found = f64::from(found[view * (SIZE[0] * SIZE[1]) as usize + i]);
            let Some(shown) = shown else {
                assert_eq!(found, 1.0);
                continue;
            };
            let expected = 1.0 - traced(&world, clips, shown.place, shown.normal, f64::from(DELTA), EDGE);
            (sum, bias, count) = (sum + (found - expected).abs(), bias + found - expected, count + 1.0);
        }
    }
    assert!(count > 80.0 && sum / count < MEAN, "mean difference {} of {count}", sum / count);
    assert!((bias / count).abs() < 0.3 * MEAN, "bias {}", bias / count);
    // More rays are nearer to more rays: it converges.
    let rms = |a: &[f32], b: &[f32]| {
        (a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
    };
    let fewer = [16, 128].map(|rays| rms(&traced_by(rays), &found));
    assert!(fewer[1] < 0.3 * fewer[0], "{fewer:?}");
    drop((pixels, accessibility, trace));
    close(gpu);
}

/// A bowl and a plane cut into solids: rays from caps and from what is beside them run into caps, too.
#[test]
fn caps_occlude_as_the_twin_finds_them() {
    let gpu = open();
    let bowl =
        Pose { translate_mm: Vec3::new(2.0, -26.0, 14.0), scale: Vec3::splat(22.0), ..Pose::default() };
    let plane =
        Pose { translate_mm: Vec3::Z * 20.0, rotate_deg: Vec3::new(10.0, 15.0, 0.0), ..Pose::default() };
    let clips = [
        Clip { pose: bowl, ..Clip::remove(Shape::Sphere) },
        Clip { pose: plane, ..Clip::remove(Shape::Plane) },
    ];
    let views = solids_eyes(Vec3::new(30.0, -95.0, 70.0), SIZE);
    let capped = solids();
    let mut bare = capped.clone();
    bare.materials.iter_mut().for_each(|material| material.cap = None);
    let found = [&capped, &bare].map(|world| all_rays(&gpu, world, &clips, &views));
    let (mut sum, mut bias, mut count, mut apart) = (0.0, 0.0, 0.0, 0);
    for (view, eye) in views.iter().enumerate() {
        for (i, shown) in gbuffer(&capped, &clips, eye, SIZE).into_iter().enumerate().step_by(5) {
            let [found, without] =
                [0, 1].map(|k| f64::from(found[k][view * (SIZE[0] * SIZE[1]) as usize + i]));
            let Some(shown) = shown else {
                assert_eq!(found, 1.0);
                continue;
            };
            let expected =
                1.0 - traced(&capped, &clips, shown.place, shown.normal, f64::from(DELTA), EDGE / 2);
            (sum, bias, count) = (sum + (found - expected).abs(), bias + found - expected, count + 1.0);
            apart += u32::from((without - expected).abs() > 0.1);
        }
    }
    assert!(count > 150.0 && sum / count < FEWER, "mean difference {} of {count}", sum / count);
    assert!((bias / count).abs() < 0.3 * FEWER, "bias {}", bias / count);
    assert!(apart > 20, "without caps it is the same but for {apart} pixels");
    close(gpu);
}

/// 1 - AO of all pixels by 256 rays.
fn all_rays(gpu: &Gpu, world: &World, clips: &[Clip], views: &[View]) -> Vec<f32> {
    let pixels = Pixels::clipped(gpu, world, clips, views, SIZE);
    let accessibility = pixels.values(gpu);
    let on = On { gpu, geometry: &pixels.geometry, surfaces: &pixels.surfaces, delta_mm: DELTA };
    let method = ByRays::new(gpu, 256).unwrap();
    for part in 0..method.parts(&on) {
        run(gpu, |rec| {
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
            method.record(rec, &on, part, &accessibility).unwrap();
        });
    }
    floats(gpu, &accessibility)
}
