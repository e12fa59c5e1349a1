//! The kernel `gather` against its twin, and against known answers.

use cao::mesh::gather::{Blocks, Gather, Scene};
use cao_gpu::Access;
use cao_model::surface::Material;
use cao_model::view::{Tangents, View};
use cao_testing::worlds::{Pixels, corner, corner_eyes, cuboid, floats, sheet, world_of};
use cao_testing::*;
use cao_twin::mesh::gather::gathered;
use cao_twin::mesh::gbuffer::gbuffer;
use glam::{Quat, Vec3};

/// No multiple of a workgroup.
const SIZE: [u32; 2] = [45, 35];

/// Largest difference at places that both see alike: angles of f32 and a driver's arc tangent.
const ERROR: f64 = 2e-4;

/// Share of pixels beyond it: other triangles at edges, and faces that are passed within rounding.
const OTHER: f64 = 5e-3;

fn sums_of(gpu: &cao_gpu::Gpu, pixels: &Pixels, delta: f32) -> Vec<f32> {
    let volumes = pixels.surfaces.volumes(gpu, delta).unwrap();
    let (gather, accessibility) = (Gather::new(gpu).unwrap(), pixels.values(gpu));
    let scene =
        Scene { geometry: &pixels.geometry, surfaces: &pixels.surfaces, volumes: &volumes, delta_mm: delta };
    run(gpu, |rec| gather.record_full(rec, scene, 0..pixels.geometry.size()[1], &accessibility).unwrap());
    floats(gpu, &accessibility)
}

#[test]
fn every_pixel_is_as_the_twin_has_it() {
    let gpu = open();
    let (world, views) = (corner(), corner_eyes(SIZE));
    let pixels = Pixels::new(&gpu, &world, &views, SIZE);
    for delta in [6.0, 40.0] {
        let found = sums_of(&gpu, &pixels, delta);
        let (mut other, mut all, mut darkest) = (0, 0, 1.0f64);
        for (view, eye) in views.iter().enumerate() {
            for (i, shown) in gbuffer(&world, &[], eye, SIZE).into_iter().enumerate() {
                let found = f64::from(found[view * (SIZE[0] * SIZE[1]) as usize + i]);
                let occlusion = shown.map_or(0.0, |s| gathered(&world, s.place, s.normal, f64::from(delta)));
                let expected = 1.0 - occlusion.min(1.0);
                darkest = darkest.min(expected);
                all += 1;
                other += u32::from((found - expected).abs() > ERROR);
            }
        }
        assert!(f64::from(other) < OTHER * f64::from(all), "delta {delta}: {other} of {all}");
        assert!(darkest < 0.7, "nothing to be seen: {darkest}");
    }
    drop(pixels);
    close(gpu);
}

/// A view straight along +y from `place`, of one pixel.
fn ahead(place: Vec3) -> View {
    View {
        position: place,
        orientation: Quat::from_rotation_x(std::f32::consts::FRAC_PI_2),
        tan: Tangents { left: -0.01, right: 0.01, up: 0.01, down: -0.01 },
        near_mm: 0.1,
        far_mm: 1e5,
        reversed: false,
    }
}

/// What the issue asks of known answers.
const KNOWN: f32 = 1e-4;

#[test]
fn known_answers_are_met() {
    let gpu = open();
    let two_sided = || Material { two_sided: true, ..Material::default() };
    // The place seen is (0, 10, 0) on a wall that faces -y. Over it squares in planes of constant y, which do not hide it: the eye is between.
    let wall = || sheet(Vec3::new(-5.0, 10.0, -5.0), Vec3::X * 10.0, Vec3::Z * 10.0, 1, Material::default());
    let square = |half: f32, away: f32, n: u32| {
        let low = Vec3::new(-half, 10.0 - away, -half);
        sheet(low, Vec3::X * 2.0 * half, Vec3::Z * 2.0 * half, n, two_sided())
    };
    // delta so large that falloff is 1 to within 1e-6.
    let all = 2e6;
    let dark = |surfaces, view: View, delta| {
        let pixels = Pixels::new(&gpu, &world_of(surfaces), &[view], [1, 1]);
        1.0 - sums_of(&gpu, &pixels, delta)[0]
    };
    let near = |found: f32, expected: f32| {
        assert!((found - expected).abs() < KNOWN, "{found}, expected {expected}");
    };
    let eye = ahead(Vec3::new(0.0, 9.5, 0.0));
    near(dark(vec![wall(), square(1.0, 1.0, 1)], eye, all), 0.554_126_4);
    // However it is divided, without falloff.
    near(dark(vec![wall(), square(1.0, 1.0, 7)], eye, all), 0.554_126_4);
    // Two behind each other are counted twice (AOV §7): 0.554126 and 0.239456.
    near(dark(vec![wall(), square(1.0, 1.0, 1), square(1.0, 2.0, 1)], eye, all), 0.793_582);
    // A closed room, seen from inside, is dark everywhere: its faces inward.
    let mut room = cuboid(Vec3::new(-3.0, 0.0, -2.0), Vec3::new(4.0, 10.0, 5.0));
    room.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    for at in [Vec3::new(0.0, 5.0, 0.0), Vec3::new(3.0, 1.0, 4.9), Vec3::new(-2.9, 9.0, -1.0)] {
        near(dark(vec![room.clone()], ahead(at), all), 1.0);
    }
    // Nothing faces it, nothing is near: open.
    near(dark(vec![wall(), square(1.0, 1.0, 1)], eye, 0.9), 0.0);
    close(gpu);
}

#[test]
fn blocks_are_their_middle_pixels() {
    let gpu = open();
    let pixels = Pixels::new(&gpu, &corner(), &corner_eyes(SIZE), SIZE);
    let full = sums_of(&gpu, &pixels, 40.0);
    let volumes = pixels.surfaces.volumes(&gpu, 40.0).unwrap();
    let gather = Gather::new(&gpu).unwrap();
    for step in [3, 5, 15] {
        let blocks = Blocks::new(&gpu, &pixels.geometry, step).unwrap();
        let scene = Scene {
            geometry: &pixels.geometry,
            surfaces: &pixels.surfaces,
            volumes: &volumes,
            delta_mm: 40.0,
        };
        run(&gpu, |rec| {
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
            gather.record_sparse(rec, scene, &blocks).unwrap();
        });
        let sums = floats(&gpu, &blocks.sums);
        let [columns, rows] = blocks.count;
        assert_eq!(sums.len() as u32, 2 * columns * rows);
        for (i, sum) in sums.iter().enumerate() {
            let (i, middle) = (i as u32, |block: u32, size: u32| (block * step + step / 2).min(size - 1));
            let (view, x, y) = (i / (columns * rows), i % columns, i / columns % rows);
            let at = (view * SIZE[1] + middle(y, SIZE[1])) * SIZE[0] + middle(x, SIZE[0]);
            assert_eq!(1.0 - sum.min(1.0), full[at as usize]);
        }
    }
    drop((pixels, volumes));
    close(gpu);
}
