//! The kernel `peel` against its twin: depth layers of clip meshes.

use cao::clip::peel::{Layers, MAX_PAIRS, MAX_SURFACES, Peel};
use cao_gpu::Gpu;
use cao_measure::random::Random;
use cao_model::clip::ClipCamera;
use cao_model::mesh::TriangleMesh;
use cao_testing::meshes::{join, winding_number};
use cao_testing::*;
use cao_twin as twin;
use cao_twin::clip::clips::{MeshLayers, NO_BACK, NO_FRONT};
use glam::{Quat, Vec3};

/// Vertices of a rasterizer lie on a grid of 2^-8 pixel, the twin's on 2^-16: a surface's depth may be off by what it
/// changes over that distance in x and y, and a pixel on an edge may be covered by one of them alone.
const SNAP_PIXELS: f32 = 2.0 / 256.0;

/// Rounding of a depth in 0 ... 1 that is interpolated from f32 plane equations over the whole map.
const DEPTH_ROUNDING: f32 = 4e-6;

/// Share of the covered pixels whose two faces may come in the wrong order: on an outline both are seen almost edge-on, where
/// the plane equations divide by an area near 0.
const GRAZING: f32 = 0.005;

/// Layers of the device as the twin has them.
fn as_twin(layers: &Layers) -> MeshLayers {
    let size = (layers.camera.resolution * layers.camera.resolution) as usize;
    let map = |n: usize, none: f32| -> Vec<f32> {
        let depths = &layers.depth[n * size..(n + 1) * size];
        let front = &layers.depth[(n & !1) * size..];
        depths.iter().zip(front).map(|(&z, &front)| if front >= 1.0 { none } else { z }).collect()
    };
    let pairs = 0..layers.pairs as usize;
    MeshLayers {
        camera: layers.camera,
        front: pairs.clone().map(|k| map(2 * k, NO_FRONT)).collect(),
        back: pairs.map(|k| map(2 * k + 1, NO_BACK)).collect(),
    }
}

fn compare(gpu: &Gpu, peel: &Peel, mesh: &TriangleMesh, scale: Vec3, resolution: u32, pairs: u32) {
    let context = format!("{} {scale} {resolution}", mesh.name);
    // A margin that puts no edge of a box through the centres of pixels, where either side may own it.
    let camera = ClipCamera::around(mesh, scale, 0.2347 * scale.max_element(), resolution);
    let found = peel.run(gpu, mesh, scale, camera, MAX_PAIRS).unwrap_or_else(|e| panic!("{context}: {e}"));
    assert_eq!((found.pairs, found.camera), (pairs, camera), "{context}");
    assert_eq!(found.depth.len(), (2 * pairs * resolution * resolution) as usize);
    let found = as_twin(&found);
    let (expected, report) = twin::clip::peel::peel(mesh, scale, &camera, pairs as usize);
    assert_eq!((report.open_pixels, report.unresolved_pixels), (0, 0), "{context}");

    let edge = resolution as usize;
    let (mut outlines, mut differ) = (0, 0);
    for k in 0..pairs as usize {
        for (found, expected, none) in
            [(&found.front[k], &expected.front[k], NO_FRONT), (&found.back[k], &expected.back[k], NO_BACK)]
        {
            for pixel in 0..edge * edge {
                let (f, e) = (found[pixel], expected[pixel]);
                let (x, y) = (pixel % edge, pixel / edge);
                let around = (y.saturating_sub(1)..=(y + 1).min(edge - 1))
                    .flat_map(|y| (x.saturating_sub(1)..=(x + 1).min(edge - 1)).map(move |x| y * edge + x));
                // On an outline, of the mesh or of what lies before it, layers change places: only the outermost
                // pixel may differ there.
                let steps: Vec<f32> = around.map(|p| (expected[p] - e).abs()).collect();
                let outline = steps.iter().any(|&s| s > 0.3);
                outlines += usize::from(outline);
                if (f == none) != (e == none) {
                    assert!(outline, "{context}: layer {k} pixel ({x}, {y}) is {f}, not {e}");
                    differ += 1;
                } else if f != none {
                    let steepest = steps.into_iter().fold(0.0, f32::max);
                    let tolerance = DEPTH_ROUNDING + SNAP_PIXELS * steepest;
                    if (f - e).abs() > tolerance {
                        assert!(
                            outline,
                            "{context}: layer {k} pixel ({x}, {y}) is {f}, not {e} ± {tolerance:e}"
                        );
                        differ += 1;
                    }
                }
            }
        }
    }
    assert!(outlines > 0, "{context}");
    assert!(differ <= 2 + outlines / 10, "{context}: {differ} pixels differ of {outlines} on outlines");
}

#[test]
fn layers_are_those_of_the_twin_at_every_resolution() {
    let gpu = open();
    let peel = Peel::new(&gpu).unwrap();
    let meshes = [
        (convex().as_ref().clone(), 1),
        (concave().as_ref().clone(), 2),
        (TriangleMesh::torus(24, 12), 1),
        (TriangleMesh::cuboid(), 1),
        (row_of_boxes(5), 5),
        (row_of_boxes(MAX_PAIRS), MAX_PAIRS),
    ];
    for (mesh, pairs) in &meshes {
        for (resolution, scale) in [
            (8, Vec3::ONE),
            (33, Vec3::new(3.0, 0.7, 1.4)),
            (64, Vec3::splat(0.02)),
            (130, Vec3::new(9.0, 9.5, 400.0)),
        ] {
            compare(&gpu, &peel, mesh, scale, resolution, *pairs);
        }
    }
    drop(peel);
    close(gpu);
}

/// A closed mesh has as many front as back faces at every pixel, however it stands and however thin its triangles are:
/// none may be taken for open.
#[test]
fn closed_meshes_are_never_taken_for_open() {
    const SEED: u64 = 9;
    let gpu = open();
    let peel = Peel::new(&gpu).unwrap();
    let mut random = Random::new(SEED);
    let meshes =
        [TriangleMesh::sphere(3), TriangleMesh::torus(40, 24), TriangleMesh::cuboid(), row_of_boxes(2)];
    for turn in 0..48 {
        let mut mesh = meshes[turn % meshes.len()].clone();
        let mut angle = || random.between(-3.2, 3.2);
        let turned =
            Quat::from_rotation_z(angle()) * Quat::from_rotation_y(angle()) * Quat::from_rotation_x(angle());
        mesh.vertices.iter_mut().for_each(|v| *v = turned * *v);
        let mut scale = || 10.0_f32.powf(random.between(-1.0, 2.0));
        let scale = Vec3::new(scale(), scale(), scale());
        let scale = scale.with_y(scale.y.clamp(0.3 * scale.x, 3.0 * scale.x));
        let resolution = 16 + random.below(150) as u32;
        // A margin that leaves the mesh a few pixels wide; what lies between all pixels cannot be seen.
        let margin = random.between(0.0, 0.4) * scale.truncate().min_element();
        let camera = ClipCamera::around(&mesh, scale, margin, resolution);
        let found = peel.run(&gpu, &mesh, scale, camera, MAX_PAIRS);
        let layers = found.unwrap_or_else(|e| panic!("seed {SEED} turn {turn}: {e}"));
        // Layers are sorted: a pair begins before it ends and after the pair before it began.
        let layers = as_twin(&layers);
        let (mut covered, mut disordered) = (0, 0);
        for pixel in 0..layers.front[0].len() {
            for k in 0..layers.front.len() {
                let (front, back) = (layers.front[k][pixel], layers.back[k][pixel]);
                assert_eq!(front == NO_FRONT, back == NO_BACK);
                if front != NO_FRONT {
                    covered += 1;
                    disordered += usize::from(front > back + DEPTH_ROUNDING);
                    assert!(k == 0 || layers.front[k - 1][pixel] < front, "seed {SEED} turn {turn}");
                }
            }
        }
        let allowed = 2.0 + GRAZING * covered as f32;
        assert!(disordered as f32 <= allowed, "seed {SEED} turn {turn}: {disordered} of {covered}");
    }
    drop(peel);
    close(gpu);
}

/// What lies between the layers is where the winding number is not 0, however parts touch, nest and overlap, and whichever of them are
/// inside out: against a count that knows no layers.
#[test]
fn layers_are_where_the_winding_number_is_not_0() {
    const SEED: u64 = 31;
    const RESOLUTION: u32 = 48;
    let gpu = open();
    let peel = Peel::new(&gpu).unwrap();
    let mut random = Random::new(SEED);
    let shapes = [TriangleMesh::cuboid(), TriangleMesh::torus(6, 5), TriangleMesh::sphere(1)];
    let (mut inside, mut outside) = (0, 0);
    for turn in 0..60 {
        let mut part = || {
            // Half of them on a grid, so that they often share faces, edges and corners.
            let step = if turn % 2 == 0 { 1.0 } else { 0.013 };
            let place = Vec3::from_array([(); 3].map(|()| (random.between(-2.0, 2.0) / step).round() * step));
            let scale = 0.5 * 2.0_f32.powi(random.below(3) as i32);
            (&shapes[random.below(3) as usize], scale, place, random.below(2) == 1)
        };
        let mesh = join(&[part(), part(), part(), part()]);
        if mesh.check_solid().is_err() {
            continue;
        }
        let camera = ClipCamera::around(&mesh, Vec3::ONE, 0.1234, RESOLUTION);
        let layers = peel.run(&gpu, &mesh, Vec3::ONE, camera, MAX_PAIRS);
        let layers = as_twin(&layers.unwrap_or_else(|e| panic!("seed {SEED} turn {turn}: {e}")));
        for _ in 0..200 {
            // In the middle of a pixel, off every surface by more than the device's grid of vertices.
            let pixel = [(); 2].map(|()| random.below(RESOLUTION.into()) as f32 + 0.5);
            let offset = Vec3::new(pixel[0], pixel[1], 0.0) * camera.pixel_mm;
            let point = camera.corner + offset + Vec3::Z * (camera.depth_mm * random.between(0.0, 1.0));
            let near = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
            let off = SNAP_PIXELS * camera.pixel_mm;
            let counts: Vec<f64> =
                near.map(|axis| winding_number(&mesh, (point + axis * off).as_dvec3()).round()).collect();
            if counts.iter().all(|count| *count == counts[0]) {
                let expected = counts[0] != 0.0;
                assert_eq!(
                    layers.inside(point),
                    expected,
                    "seed {SEED} turn {turn}: {point}, count {}",
                    counts[0]
                );
                *(if expected { &mut inside } else { &mut outside }) += 1;
            }
        }
    }
    assert!(inside > 1000 && outside > 1000, "{inside} {outside}");
    drop(peel);
    close(gpu);
}

/// Parts that touch are one stretch, so that as many as there may be surfaces need a single pair.
#[test]
fn parts_that_touch_need_one_pair() {
    let gpu = open();
    let peel = Peel::new(&gpu).unwrap();
    let cube = TriangleMesh::cuboid();
    let row = |count: u32| {
        let parts: Vec<_> = (0..count).map(|i| (&cube, 0.5, Vec3::Z * i as f32, i % 2 == 1)).collect();
        join(&parts)
    };
    let run = |mesh: &TriangleMesh| {
        let camera = ClipCamera::around(mesh, Vec3::ONE, 0.1, 32);
        peel.run(&gpu, mesh, Vec3::ONE, camera, 1)
    };
    // Three times the same: each surface is there three times, at one depth.
    let thrice = join(&[
        (&cube, 1.0, Vec3::ZERO, false),
        (&cube, 1.0, Vec3::ZERO, false),
        (&cube, 1.0, Vec3::ZERO, false),
    ]);
    assert_eq!(run(&thrice).unwrap().depth, run(&cube).unwrap().depth);
    assert_eq!(run(&row(MAX_SURFACES / 2)).unwrap().pairs, 1);
    let message = run(&row(MAX_SURFACES / 2 + 1)).err().map(|e| e.to_string()).unwrap();
    assert!(message.contains("more than 128 surfaces lie behind one another at "), "{message}");
    drop(peel);
    close(gpu);
}

/// As every detail below a pixel it is lost; it must not stop a program that shrinks a shape away.
#[test]
fn a_mesh_between_all_pixels_has_one_pair_of_empty_layers() {
    let gpu = open();
    let peel = Peel::new(&gpu).unwrap();
    let scale = Vec3::splat(0.01);
    let camera = ClipCamera::around(&TriangleMesh::cuboid(), scale, 5.0, 16);
    let layers = peel.run(&gpu, &TriangleMesh::cuboid(), scale, camera, MAX_PAIRS).unwrap();
    assert_eq!(layers.pairs, 1);
    assert_eq!(layers.depth, vec![1.0; 2 * 16 * 16]);
    drop(peel);
    close(gpu);
}

#[test]
fn open_meshes_and_too_many_layers_are_reported_with_what_was_found() {
    let gpu = open();
    let peel = Peel::new(&gpu).unwrap();
    let refusal = |mesh: &TriangleMesh, pairs: u32| {
        let camera = ClipCamera::around(mesh, Vec3::ONE, 0.5, 32);
        peel.run(&gpu, mesh, Vec3::ONE, camera, pairs).err().map(|e| e.to_string())
    };
    let boxes = row_of_boxes(3);
    assert_eq!(refusal(&boxes, 3), None);
    let message = refusal(&boxes, 2).unwrap();
    assert!(message.contains("row of boxes") && message.contains("more than 2 layer pairs"), "{message}");
    assert!(message.contains(": 3 found") && message.contains("allow up to 8 pairs"), "{message}");
    // At the limit the remedy is in the mesh: no more pairs can be allowed, and the clip camera turns with the clip.
    let message = refusal(&row_of_boxes(9), 8).unwrap();
    assert!(message.contains("more than 8") && message.contains(": 9 found"), "{message}");
    assert!(message.contains("several clips") && !message.contains("allow"), "{message}");

    let mut open_mesh = TriangleMesh::cuboid();
    // Without a triangle of the face at z = 1.
    open_mesh.triangles.pop();
    open_mesh.triangles.pop();
    let message = refusal(&open_mesh, 2).unwrap();
    assert!(message.contains("differ in number at") && message.contains("open"), "{message}");
    drop(peel);
    close(gpu);
}
