//! The kernel `trace_queries` against `trace`, whose twin is the truth of both: the same rays, found by the device.

use cao::mesh::ambient::{ByRays, PixelAmbient, Pixels as On};
use cao_gpu::{Access, DeviceKind, Gpu, OpenOptions};
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::surface::World;
use cao_testing::worlds::{
    Pixels, clips, corner, corner_eyes, cuboid, floats, sheet, solids, solids_eyes, world_of,
};
use cao_testing::*;
use glam::Vec3;

/// No multiple of a workgroup.
const SIZE: [u32; 2] = [37, 27];
const DELTA: f32 = 40.0;
const RAYS: u32 = 128;

/// Where all rays of a pixel hit the same, its value differs by the rounding of a hit's way, some 1e-7 of the coordinates of 100 mm, of δ.
const SAME: f32 = 1e-5;
/// A ray that passes an edge of a triangle, a mask or a clip by less than rounding hits on one side or the other, and takes up to 1/RAYS along:
/// pixels and the mean of all. lavapipe 25.0 has none among 28,800 pixels of 64 rays in three built-in scenes; other devices may have one ray in
/// ten thousand.
const OTHERS: f64 = 1e-4 * RAYS as f64;
const MEAN: f64 = 1e-4;

/// Without masks: hits need no asking.
fn whole_corner() -> World {
    let (x, y) = (Vec3::X * 100.0, Vec3::Y * 100.0);
    world_of(vec![
        sheet(Vec3::ZERO, x, y, 4, Default::default()),
        sheet(y, x, Vec3::Z * 60.0, 2, Default::default()),
        cuboid(Vec3::new(45.0, 55.0, 0.0), Vec3::new(75.0, 85.0, 30.0)),
    ])
}

fn traced(gpu: &Gpu, pixels: &Pixels, mut method: ByRays) -> Vec<f32> {
    let accessibility = pixels.values(gpu);
    let (surfaces, geometry) = (&pixels.surfaces, &pixels.geometry);
    let on = On { gpu, geometry, surfaces, delta_mm: DELTA };
    method.prepare(&on).unwrap();
    for part in 0..method.parts(&on) {
        run(gpu, |rec| {
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
            method.record(rec, &on, part, &accessibility).unwrap();
        });
    }
    floats(gpu, &accessibility)
}

/// The share of pixels that differ by more than rounding, and the mean difference.
fn apart(a: &[f32], b: &[f32]) -> (f64, f64) {
    let differences = || a.iter().zip(b).map(|(a, b)| (a - b).abs());
    let others = differences().filter(|difference| *difference > SAME).count();
    let sum: f64 = differences().map(f64::from).sum();
    (others as f64 / a.len() as f64, sum / a.len() as f64)
}

#[test]
fn queries_give_what_walks_through_the_tree_give() {
    let gpu = open();
    if !gpu.ray_queries() {
        eprintln!("skipped: this device has no ray queries");
        return close(gpu);
    }
    let ball = clips()[..1].to_vec();
    let cases: [(World, Vec<Clip>, bool); 4] = [
        (corner(), ball.clone(), false),
        (corner(), Vec::new(), false),
        (whole_corner(), ball.clone(), false),
        (whole_corner(), Vec::new(), true),
    ];
    for (n, (world, clips, whole)) in cases.iter().enumerate() {
        let pixels = Pixels::clipped(&gpu, world, clips, &corner_eyes(SIZE), SIZE);
        assert_eq!(pixels.surfaces.whole(), *whole);
        let walked = traced(&gpu, &pixels, ByRays::walks(&gpu, RAYS).unwrap());
        let queried = traced(&gpu, &pixels, ByRays::queries(&gpu, RAYS).unwrap());
        let (others, mean) = apart(&walked, &queried);
        assert!(others <= OTHERS && mean <= MEAN, "case {n}: {others} of all pixels, mean {mean}");
        let shaded = walked.iter().filter(|value| **value < 0.9).count();
        assert!(shaded > walked.len() / 16, "{shaded} pixels have any occlusion");
    }
    // Of caps the structure knows nothing: rays walk.
    let plane = Pose { translate_mm: Vec3::Z * 20.0, rotate_deg: Vec3::X * 10.0, ..Pose::default() };
    let cut = [Clip { pose: plane, ..Clip::remove(Shape::Plane) }];
    let views = solids_eyes(Vec3::new(30.0, -95.0, 70.0), SIZE);
    let capped = Pixels::clipped(&gpu, &solids(), &cut, &views, SIZE);
    assert!(capped.surfaces.caps());
    let both = [ByRays::walks, ByRays::queries].map(|way| traced(&gpu, &capped, way(&gpu, RAYS).unwrap()));
    assert!(both[0] == both[1]);
    drop(capped);
    // Controls: a kernel that did not ask clips, or masks.
    let pixels =
        |world: &World, clips: &[Clip]| Pixels::clipped(&gpu, world, clips, &corner_eyes(SIZE), SIZE);
    let of = |pixels: &Pixels| traced(&gpu, pixels, ByRays::queries(&gpu, RAYS).unwrap());
    let (unclipped, mut clipped) = (pixels(&corner(), &[]), pixels(&corner(), &ball));
    let right = of(&clipped);
    clipped.surfaces = unclipped.surfaces;
    let (others, mean) = apart(&right, &of(&clipped));
    assert!(others > 3.0 * OTHERS && mean > 3.0 * MEAN, "clips: {others}, {mean}");
    let mut world = corner();
    world.materials.iter_mut().for_each(|material| material.cutoff = None);
    let mut masked = pixels(&corner(), &[]);
    let right = of(&masked);
    masked.surfaces = pixels(&world, &[]).surfaces;
    let (others, mean) = apart(&right, &of(&masked));
    assert!(others > 3.0 * OTHERS && mean > 3.0 * MEAN, "masks: {others}, {mean}");
    drop((clipped, masked, unclipped.geometry, unclipped.hits));
    close(gpu);
}

#[test]
fn queries_are_refused_by_name_where_there_are_none_or_nothing_was_prepared() {
    let plain =
        Gpu::open(&OpenOptions { validation: validated(), plain: true, ..OpenOptions::default() }).unwrap();
    assert!(!plain.ray_queries());
    let refused = ByRays::queries(&plain, RAYS).map(drop).unwrap_err().to_string();
    assert!(refused.contains("Gpu::ray_queries"), "{refused}");
    let pixels = Pixels::new(&plain, &corner(), &corner_eyes(SIZE), SIZE);
    let refused = pixels.surfaces.structure(&plain).map(drop).unwrap_err().to_string();
    assert!(refused.contains("Gpu::ray_queries"), "{refused}");
    traced(&plain, &pixels, ByRays::new(&plain, 1).unwrap());
    drop(pixels);
    close(plain);
    let gpu = open();
    if gpu.ray_queries() {
        let pixels = Pixels::new(&gpu, &corner(), &corner_eyes(SIZE), SIZE);
        let accessibility = pixels.values(&gpu);
        let (surfaces, geometry) = (&pixels.surfaces, &pixels.geometry);
        let on = On { gpu: &gpu, geometry, surfaces, delta_mm: DELTA };
        let mut rec = gpu.recorder("test").unwrap();
        // Hardware takes them unasked, a software driver does not, and walks need no preparation.
        let chosen = ByRays::new(&gpu, RAYS).unwrap().record(&mut rec, &on, 0, &accessibility);
        assert_eq!(chosen.is_ok(), gpu.info().kind == DeviceKind::Cpu);
        let method = ByRays::queries(&gpu, RAYS).unwrap();
        let refused = method.record(&mut rec, &on, 0, &accessibility).unwrap_err().to_string();
        assert!(refused.contains("call prepare"), "{refused}");
    }
    close(gpu);
}
