//! The kernel `gbuffer` against its twin.

use cao_gpu::Gpu;
use cao_kernels::shared::hits::ON_CAP;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::mesh::TriangleMesh;
use cao_model::surface::World;
use cao_model::view::View;
use cao_testing::worlds::{self, Pixels, corner, corner_eyes, floats, solid, solids, solids_eyes, world_of};
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

/// Meshes in and through one another, cut by every shape, alone and together, as the twin finds by steps and solid angles; and a disc that is known.
#[test]
fn caps_are_where_the_twin_finds_them() {
    let gpu = open();
    let (world, at) = (solids(), Vec3::new);
    let remove = |shape, place, turn, scale| clip(shape, Mode::Remove, place, turn, scale);
    let keep = |shape, place, turn, scale| clip(shape, Mode::Keep, place, turn, scale);
    let plane = |place, turn| remove(Shape::Plane, place, turn, Vec3::ONE);
    let slope = plane(at(2.0, 0.0, 5.0), at(60.0, 15.0, 0.0));
    let block =
        |mode| clip(Shape::Box, mode, at(16.0, -18.0, 12.0), at(20.0, 10.0, 35.0), at(18.0, 14.0, 16.0));
    // Whose faces are along none of the axes of its map.
    let turned = Pose { rotate_deg: at(25.0, 35.0, 10.0), ..Pose::default() }.rotation();
    let mut mesh = TriangleMesh::cuboid();
    mesh.vertices.iter_mut().for_each(|vertex| *vertex = turned * *vertex);
    let mesh = Shape::Mesh(Arc::new(mesh));
    let meshed = |mode| clip(mesh.clone(), mode, at(14.0, -14.0, 8.0), at(0.0, 20.0, 0.0), Vec3::splat(18.0));
    let round = vec![
        remove(Shape::Cylinder, at(-8.0, -20.0, 6.0), at(50.0, 20.0, 0.0), at(11.0, 9.0, 22.0)),
        remove(Shape::Cone, at(22.0, -12.0, 10.0), at(120.0, 10.0, 30.0), at(16.0, 14.0, 20.0)),
        remove(Shape::Torus, at(4.0, -10.0, 12.0), at(40.0, 10.0, 0.0), at(20.0, 18.0, 16.0)),
    ];
    let overlapping =
        vec![remove(Shape::Sphere, at(6.0, -24.0, 14.0), Vec3::ZERO, Vec3::splat(17.0)), block(Mode::Remove)];
    let (outside, inside) = (at(50.0, -95.0, 60.0), at(-8.0, 14.0, -6.0));
    let hole = remove(Shape::Sphere, at(-4.0, 6.0, -3.0), Vec3::ZERO, Vec3::splat(5.0));
    for (name, clips, eye, least, meshes) in [
        ("plane", vec![slope.clone()], outside, 1000, 3),
        ("two that overlap", overlapping, outside, 600, 3),
        (
            "kept",
            vec![keep(Shape::Sphere, at(4.0, -6.0, 3.0), Vec3::ZERO, at(24.0, 30.0, 22.0))],
            outside,
            150,
            2,
        ),
        (
            "kept and removed",
            vec![block(Mode::Keep), plane(at(2.0, 0.0, 5.0), at(75.0, 0.0, 0.0))],
            outside,
            50,
            3,
        ),
        ("round", round, outside, 300, 3),
        (
            "cone kept",
            vec![keep(Shape::Cone, at(2.0, 0.0, 0.0), at(10.0, -20.0, 0.0), Vec3::splat(26.0))],
            outside,
            400,
            3,
        ),
        (
            "torus kept",
            vec![keep(Shape::Torus, at(0.0, -2.0, 0.0), at(30.0, 10.0, 0.0), Vec3::splat(20.0))],
            outside,
            500,
            3,
        ),
        ("mesh", vec![meshed(Mode::Remove)], outside, 500, 3),
        ("mesh kept", vec![meshed(Mode::Keep), slope], outside, 200, 3),
        ("over a hole, from within what is left", vec![hole], inside, 100, 1),
        ("from within what is hidden", vec![plane(at(0.0, 8.0, 0.0), at(-80.0, 0.0, 0.0))], inside, 1000, 1),
    ] {
        let views = solids_eyes(eye, SIZE);
        let pixels = Pixels::clipped(&gpu, &world, &clips, &views, SIZE);
        let caps =
            if clips.iter().any(|clip| matches!(clip.shape, Shape::Mesh(_))) { OF_MESH } else { EXACT };
        let (_, [on_caps, cut]) = compared(&gpu, &world, &clips, &views, &pixels, caps);
        assert!(on_caps >= least && cut >= meshes, "{name}: {on_caps} pixels on caps of {cut} meshes");
    }
    disc(&gpu);
    close(gpu);
}

/// A ball of 30 mm cut 10 mm over its middle shows a disc of radius √800 there.
fn disc(gpu: &Gpu) {
    let mut ball = solid(&TriangleMesh::sphere(4), [0.5; 3]);
    ball.positions.iter_mut().for_each(|position| *position *= 30.0);
    let plane = clip(Shape::Plane, Mode::Remove, Vec3::Z * 10.0, Vec3::ZERO, Vec3::ONE);
    let views = solids_eyes(Vec3::new(10.0, -40.0, 90.0), SIZE);
    let pixels = Pixels::clipped(gpu, &world_of(vec![ball]), &[plane], &views, SIZE);
    let geometry = floats(gpu, &pixels.geometry.pixels);
    let hits: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &pixels.hits));
    let radius = 800f32.sqrt();
    let (mut on_disc, count) = (0, (SIZE[0] * SIZE[1]) as usize);
    for (i, hit) in hits.iter().enumerate() {
        let eye = &views[i / count];
        let (x, y) = ((i % count) as u32 % SIZE[0], (i % count) as u32 / SIZE[0]);
        let uv = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / Vec2::new(SIZE[0] as f32, SIZE[1] as f32);
        let (origin, direction) = eye.ray(uv);
        let t = (10.0 - origin.z) / direction.z;
        let from_axis = (origin + t * direction).truncate().length();
        // Facets are up to 0.1 mm within the ball.
        if from_axis > radius - 0.1 {
            assert!(from_axis < radius || hit[1] != ON_CAP, "{from_axis} mm from the axis");
            continue;
        }
        let pixel = &geometry[4 * i..4 * i + 4];
        assert!(hit[1] == ON_CAP && (pixel[3] - t).abs() < 1e-3, "{pixel:?} at {from_axis} mm, not {t}");
        assert!((Vec3::from_slice(pixel) - Vec3::Z).length() < 1e-5, "{pixel:?}");
        on_disc += 1;
    }
    assert!(on_disc > 500, "{on_disc}");
}
