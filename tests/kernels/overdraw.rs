//! The kernel `overdraw` against its twin, and against volumes that are counted by hand.

use cao::mesh::gather::Scene;
use cao_gpu::Gpu;
use cao_measure::kernels::overdraw::Overdraw;
use cao_model::surface::Material;
use cao_testing::worlds::{Pixels, ahead, corner, corner_eyes, sheet, world_of};
use cao_testing::*;
use cao_twin::measure::overdraw::overdraw;
use cao_twin::mesh::gbuffer::gbuffer;
use cao_twin::mesh::occluder::Volume;
use glam::Vec3;

/// No multiple of a workgroup.
const SIZE: [u32; 2] = [45, 35];

/// Share of pixels that another triangle shows, or that lie within rounding of a volume's side: a pixel is beside some fifty volumes.
const OTHER: f64 = 1e-2;

fn counts(gpu: &Gpu, pixels: &Pixels, delta_mm: f32, clamped: bool) -> Vec<Option<u32>> {
    let volumes = pixels.surfaces.volumes(gpu, delta_mm, clamped).unwrap();
    let scene = Scene { geometry: &pixels.geometry, surfaces: &pixels.surfaces, volumes: &volumes, delta_mm };
    Overdraw::new(gpu).unwrap().read(gpu, scene).unwrap()
}

#[test]
fn every_pixel_lies_in_as_many_volumes_as_the_twin_counts() {
    let gpu = open();
    let (world, views) = (corner(), corner_eyes(SIZE));
    let pixels = Pixels::new(&gpu, &world, &views, SIZE);
    let mut sums = Vec::new();
    for (delta, clamped) in [(6.0, false), (40.0, false), (40.0, true)] {
        let found = counts(&gpu, &pixels, delta, clamped);
        let volume = Volume { delta: f64::from(delta), clamped };
        let shown = views.iter().flat_map(|eye| gbuffer(&world, &[], eye, SIZE));
        let expected: Vec<_> =
            shown.map(|shown| shown.map(|shown| overdraw(&world, shown.place, volume) as u32)).collect();
        let other = expected.iter().zip(&found).filter(|(a, b)| a != b).count() as f64 / found.len() as f64;
        assert!(other < OTHER, "delta {delta}, clamped {clamped}: {other}");
        sums.push(found.iter().flatten().sum::<u32>());
    }
    // The farther they reach, the more; and fewer where corners are clamped.
    assert!(sums[0] > 0 && 2 * sums[0] < sums[1] && sums[2] < sums[1] && 2 * sums[2] > sums[1], "{sums:?}");
    drop(pixels);
    close(gpu);
}

#[test]
fn known_volumes_are_counted() {
    let gpu = open();
    let wall = || sheet(Vec3::new(-5.0, 10.0, -5.0), Vec3::X * 10.0, Vec3::Z * 10.0, 1, Material::default());
    // Squares of two triangles that face the wall, so far before it, behind the eye.
    let square = |half: f32, away: f32, two_sided: bool| {
        let low = Vec3::new(-half, 10.0 - away, half);
        let material = Material { two_sided, ..Material::default() };
        sheet(low, Vec3::X * 2.0 * half, Vec3::NEG_Z * 2.0 * half, 1, material)
    };
    let count = |surfaces| {
        let view = ahead(Vec3::new(0.1, 9.5, 0.2));
        let pixels = Pixels::new(&gpu, &world_of(surfaces), &[view], [1, 1]);
        counts(&gpu, &pixels, 2.0, false)[0].unwrap()
    };
    assert_eq!(count(vec![wall()]), 0, "its own surface");
    assert_eq!(count(vec![wall(), square(1.0, 1.0, false)]), 2);
    assert_eq!(count(vec![wall(), square(1.0, 1.0, false), square(3.0, 1.5, true)]), 4);
    // Beyond δ.
    assert_eq!(count(vec![wall(), square(1.0, 2.1, false)]), 0);
    // What faces away occludes nothing, unless it has two sides, each of which has one volume.
    let turned = |two_sided| {
        let material = Material { two_sided, ..Material::default() };
        sheet(Vec3::new(-1.0, 9.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, 1, material)
    };
    assert_eq!(count(vec![wall(), turned(false)]), 0);
    assert_eq!(count(vec![wall(), turned(true)]), 2);
    close(gpu);
}
