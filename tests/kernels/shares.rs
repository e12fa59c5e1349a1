//! The kernel `shares` against its twin, and clip meshes against the shapes that they are of.

use cao_model::clip::{Clip, Pose, Shape};
use cao_model::mesh::TriangleMesh;
use cao_testing::worlds::{Pixels, clips, corner, corner_eyes, floats};
use cao_testing::*;
use cao_twin::mesh::shares::shares;
use glam::Vec3;
use std::sync::Arc;

const SIZE: [u32; 2] = [9, 7];

/// A point of 136 that rounding puts on the other side.
const POINT: f64 = 1.01 / 136.0;

#[test]
fn triangles_keep_what_clips_and_masks_leave() {
    let gpu = open();
    let world = corner();
    let device = |clips: &[Clip]| {
        let pixels = Pixels::clipped(&gpu, &world, clips, &corner_eyes(SIZE), SIZE);
        let values = floats(&gpu, &pixels.surfaces.shares);
        // In the order of the world.
        let place = |triangle| pixels.surfaces.ordered.iter().position(|other| other == triangle).unwrap();
        world.triangles.iter().map(|triangle| f64::from(values[place(triangle)])).collect::<Vec<_>>()
    };
    for clips in [vec![], clips(), clips()[..1].to_vec()] {
        let expected = shares(&world, &clips);
        let found = device(&clips);
        let worst = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < POINT, "{worst} with {} clips", clips.len());
        let cut = expected.iter().filter(|share| **share > 0.01 && **share < 0.9).count();
        assert!(clips.is_empty() || cut > 0, "no triangle is cut");
    }
    // A box as a mesh is the box, but for the pixels of its layers.
    let pose = Pose {
        translate_mm: Vec3::new(60.0, 70.0, 15.0),
        scale: Vec3::new(30.0, 20.0, 25.0),
        ..Pose::default()
    };
    let of = |shape| device(&[Clip { pose, ..Clip::remove(shape) }]);
    let (shape, mesh) = (of(Shape::Box), of(Shape::Mesh(Arc::new(TriangleMesh::cuboid()))));
    let worst = shape.iter().zip(&mesh).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 0.1 && shape != device(&[]), "{worst}");
    close(gpu);
}
