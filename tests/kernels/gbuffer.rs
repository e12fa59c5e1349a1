//! The kernel `gbuffer` against its twin.

use cao_gpu::Gpu;
use cao_kernels::shared::hits::ON_CAP;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::mesh::TriangleMesh;
use cao_model::surface::World;
use cao_model::view::View;
use cao_testing::worlds::{self, Pixels, corner, corner_eyes, floats, solids, solids_eyes};
use cao_testing::*;
use cao_twin::mesh::gbuffer::gbuffer;
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashSet;
use std::sync::Arc;

/// No multiple of a workgroup.
const SIZE: [u32; 2] = [61, 45];

/// Share of pixels that may show something else: rays that pass an edge or the border of a mask within rounding.
const OTHER: f64 = 5e-3;

/// Relative error of a depth in f32: some roundings of numbers that are ten times larger than their differences.
const DEPTH: f64 = 2e-5;

#[test]
fn both_eyes_show_what_the_twin_does() {
    let gpu = open();
    let (world, views) = (corner(), corner_eyes(SIZE));
    let mut worlds = Vec::new();
    for clips in [vec![], worlds::clips()] {
        let pixels = Pixels::clipped(&gpu, &world, &clips, &views, SIZE);
        let (seen, _) = compared(&gpu, &world, &clips, &views, &pixels, Caps { slope: 0.0, ..EXACT });
        worlds.push((seen, floats(&gpu, &pixels.geometry.pixels)));
    }
    assert_eq!(worlds[0].0, 6, "every surface is to be seen, the needle too");
    assert_ne!(worlds[0].1, worlds[1].1, "clips change nothing");
    close(gpu);
}

/// How far pixels may be from the twin's. Depths are held to [`DEPTH`] where a surface is seen less aslant than by this cosine. Of caps: mm across the surface
/// beside rounding, the least cosine between normals, and the share of pixels that show something else.
#[derive(Clone, Copy)]
struct Caps {
    slope: f64,
    off_mm: f64,
    cosine: f64,
    other: f64,
}

/// Of analytic clips; normals differ at their edges.
const EXACT: Caps = Caps { slope: 0.1, off_mm: 0.0, cosine: 0.999_99, other: OTHER };

/// Of a clip mesh: two pixels of its map, 60 mm / 510 each, and so are its edges; its normals are means over 13 pixels.
const OF_MESH: Caps = Caps { slope: 0.1, off_mm: 0.25, cosine: 0.98, other: 0.03 };

/// Compares what pixels show with the twin; how many surfaces are seen, and how many pixels on caps of how many meshes.
fn compared(
    gpu: &Gpu,
    world: &World,
    clips: &[Clip],
    views: &[View],
    pixels: &Pixels,
    caps: Caps,
) -> (usize, [usize; 2]) {
    let geometry = floats(gpu, &pixels.geometry.pixels);
    let hits: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &pixels.hits));
    let (mut other, mut all, mut seen, mut on_caps, mut cut) = (0, 0, HashSet::new(), 0, HashSet::new());
    for (view, eye) in views.iter().enumerate() {
        for (i, expected) in gbuffer(world, clips, eye, SIZE).into_iter().enumerate() {
            let at = view * (SIZE[0] * SIZE[1]) as usize + i;
            let pixel = &geometry[4 * at..4 * at + 4];
            all += 1;
            let Some(expected) = expected else {
                other += u32::from(pixel[3] != 0.0);
                continue;
            };
            let found = pixels.surfaces.ordered.get(hits[at][0] as usize);
            let depth = expected.hit.t;
            let normal = DVec3::from_array([0, 1, 2].map(|axis| f64::from(pixel[axis])));
            let uv = Vec2::new((i as u32 % SIZE[0]) as f32 + 0.5, (i as u32 / SIZE[0]) as f32 + 0.5);
            let (_, direction) = eye.ray(uv / Vec2::new(SIZE[0] as f32, SIZE[1] as f32));
            let slope = direction.as_dvec3().normalize().dot(expected.normal).abs();
            if expected.cap {
                let material = world.triangles[expected.hit.triangle].material;
                let off = (f64::from(pixel[3]) - depth).abs() * slope;
                let same = found.is_some_and(|triangle| triangle.material == material)
                    && hits[at][1] == ON_CAP
                    && off < DEPTH * depth + caps.off_mm
                    && normal.dot(expected.normal) > caps.cosine;
                other += u32::from(!same);
                on_caps += 1;
                cut.insert(material);
                continue;
            }
            let triangle = &world.triangles[expected.hit.triangle];
            if hits[at][1] == ON_CAP || found != Some(triangle) || slope < caps.slope {
                other += 1;
                continue;
            }
            seen.insert(world.triangles[expected.hit.triangle].material);
            assert!((f64::from(pixel[3]) - depth).abs() < DEPTH * depth, "{pixel:?}, expected {depth}");
            assert!((normal - expected.normal).abs().max_element() < 1e-5, "{pixel:?}");
            let weights = [hits[at][1] & 0xffff, hits[at][1] >> 16].map(|bits| f64::from(bits) / 65535.0);
            for (found, expected) in weights.iter().zip(expected.hit.at) {
                assert!((found - expected).abs() < 1e-3, "{weights:?}");
            }
        }
    }
    assert!(f64::from(other) < caps.other * f64::from(all), "{other} of {all}");
    (seen.len(), [on_caps, cut.len()])
}

fn clip(shape: Shape, mode: Mode, translate_mm: Vec3, rotate_deg: Vec3, scale: Vec3) -> Clip {
    Clip { shape, mode, pose: Pose { translate_mm, rotate_deg, scale } }
}

/// Meshes in and through one another, cut by every shape, alone and together, as the twin finds by steps and solid angles.
#[test]
fn caps_are_where_the_twin_finds_them() {
    let gpu = open();
    let world = solids();
    let (outside, inside) = (Vec3::new(50.0, -95.0, 60.0), Vec3::new(-8.0, 14.0, -6.0));
    let at = Vec3::new;
    let remove = |shape, place, turn, scale| clip(shape, Mode::Remove, place, turn, scale);
    // Whose faces are along none of the axes of its map.
    let turned = Pose { rotate_deg: at(25.0, 35.0, 10.0), ..Pose::default() }.rotation();
    let mut mesh = TriangleMesh::cuboid();
    mesh.vertices.iter_mut().for_each(|vertex| *vertex = turned * *vertex);
    let plane = |turn| remove(Shape::Plane, at(2.0, 0.0, 5.0), turn, Vec3::ONE);
    let ball = |mode| clip(Shape::Sphere, mode, at(4.0, -6.0, 3.0), Vec3::ZERO, at(24.0, 30.0, 22.0));
    let block =
        |mode| clip(Shape::Box, mode, at(16.0, -18.0, 12.0), at(20.0, 10.0, 35.0), at(18.0, 14.0, 16.0));
    let meshed = |mode| {
        clip(
            Shape::Mesh(Arc::new(mesh.clone())),
            mode,
            at(14.0, -14.0, 8.0),
            at(0.0, 20.0, 0.0),
            Vec3::splat(18.0),
        )
    };
    for (name, clips, eye, caps, least, meshes) in [
        ("plane", vec![plane(at(60.0, 15.0, 0.0))], outside, EXACT, 600, 3),
        (
            "two that overlap",
            vec![
                remove(Shape::Sphere, at(6.0, -24.0, 14.0), Vec3::ZERO, Vec3::splat(17.0)),
                block(Mode::Remove),
            ],
            outside,
            EXACT,
            500,
            2,
        ),
        ("kept", vec![ball(Mode::Keep)], outside, EXACT, 600, 2),
        ("kept and removed", vec![block(Mode::Keep), plane(at(75.0, 0.0, 0.0))], outside, EXACT, 100, 2),
        (
            "round",
            vec![
                remove(Shape::Cylinder, at(-8.0, -20.0, 6.0), at(50.0, 20.0, 0.0), at(11.0, 9.0, 22.0)),
                remove(Shape::Cone, at(22.0, -12.0, 10.0), at(120.0, 10.0, 30.0), at(16.0, 14.0, 20.0)),
                remove(Shape::Torus, at(4.0, -10.0, 12.0), at(40.0, 10.0, 0.0), at(20.0, 18.0, 16.0)),
            ],
            outside,
            EXACT,
            500,
            2,
        ),
        (
            "cone and torus kept",
            vec![clip(Shape::Cone, Mode::Keep, at(2.0, 0.0, 0.0), at(10.0, -20.0, 0.0), Vec3::splat(26.0))],
            outside,
            EXACT,
            200,
            1,
        ),
        (
            "torus kept",
            vec![clip(Shape::Torus, Mode::Keep, at(0.0, -2.0, 0.0), at(30.0, 10.0, 0.0), Vec3::splat(20.0))],
            outside,
            EXACT,
            200,
            1,
        ),
        ("mesh", vec![meshed(Mode::Remove)], outside, OF_MESH, 400, 2),
        ("mesh kept", vec![meshed(Mode::Keep), plane(at(60.0, 15.0, 0.0))], outside, OF_MESH, 100, 1),
        (
            "from inside",
            vec![
                plane(at(100.0, 15.0, 0.0)),
                remove(Shape::Sphere, at(8.0, -4.0, 2.0), Vec3::ZERO, Vec3::splat(6.0)),
            ],
            inside,
            EXACT,
            100,
            1,
        ),
    ] {
        let views = solids_eyes(eye, SIZE);
        let started = std::time::Instant::now();
        let pixels = Pixels::clipped(&gpu, &world, &clips, &views, SIZE);
        let drawn = started.elapsed();
        let (_, [on_caps, cut]) = compared(&gpu, &world, &clips, &views, &pixels, caps);
        println!("{name}: {on_caps} of {cut}, drawn by {drawn:?} of {:?}", started.elapsed());
        assert!(on_caps >= least && cut >= meshes, "{name}: {on_caps} pixels on caps of {cut} meshes");
    }
    close(gpu);
}
