//! Where head and clip are in each frame: closed curves that depend on the frame's number alone, never on time or chance, so that
//! every method, run and machine sees the same frames.
//!
//! With `p = 2π·frame/90`, lengths in shares of the volume's edges, `d` the distance at which the volume fills a square picture:
//!
//! ```text
//! head   azimuth 30° + 20° sin p, elevation 25° + 8° cos p, distance d (1 + 0.1 sin p), looking at the centre
//! clip   at (0.25 cos p, 0.25 sin p, 0.15 sin 2p) · edges, turned by (30° sin p, 0°, 360°·frame/90)
//!        half-size 0.2 · shortest edge
//! ```

use anyhow::Result;
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::mesh::TriangleMesh;
use cao_model::view::{StereoRig, View, with_insets};
use glam::Vec3;
use std::f32::consts::TAU;
use std::sync::Arc;

/// Frames after which the path closes: a second at 90 Hz.
pub const PERIOD: u32 = 90;

/// Share of the field of view, along each direction, that insets show.
pub const INSET: f32 = 0.4;

/// The phase of a frame: 0 … 1.
fn turn(frame: i64) -> f32 {
    frame.rem_euclid(PERIOD.into()) as f32 / PERIOD as f32
}

/// One, two or four views of a volume of this size in mm, for pictures of this aspect (width / height): the middle of the head; both
/// eyes; both eyes and their insets.
pub fn views(size_mm: [f64; 3], aspect: f32, count: usize, frame: i64) -> Result<Vec<View>> {
    let (sin, cos) = (TAU * turn(frame)).sin_cos();
    let mut rig = StereoRig::framing(size_mm, 30.0 + 20.0 * sin, 25.0 + 8.0 * cos);
    rig.position *= 1.0 + 0.1 * sin;
    if count == 1 {
        rig.ipd_mm = 0.0;
    }
    // As `cao render` has them.
    let reach = rig.position.length() + size_mm.iter().map(|s| *s as f32).sum::<f32>();
    let eyes = rig.views(aspect, reach * 1e-4, reach * 2.0)?;
    Ok(match count {
        1 => vec![eyes[0]],
        2 => eyes.to_vec(),
        _ => with_insets(eyes, INSET)?.to_vec(),
    })
}

/// The clip in a volume of this size in mm.
pub fn clip(shape: &Shape, size_mm: [f64; 3], frame: i64) -> Clip {
    let edges = Vec3::from_array(size_mm.map(|s| s as f32));
    // A mesh has the size that its file says, other shapes a half-edge or radius of 1 mm.
    let unit = match shape {
        Shape::Mesh(mesh) => {
            let (low, high) = mesh.bounds();
            0.5 * (high - low).max_element()
        }
        _ => 1.0,
    };
    let phase = TAU * turn(frame);
    let pose = Pose {
        translate_mm: edges * Vec3::new(0.25 * phase.cos(), 0.25 * phase.sin(), 0.15 * (2.0 * phase).sin()),
        rotate_deg: Vec3::new(30.0 * phase.sin(), 0.0, 360.0 * turn(frame)),
        scale: Vec3::splat(0.2 * edges.min_element() / unit),
    };
    Clip { pose, ..Clip::remove(shape.clone()) }
}

/// The form of a mesh in a frame: a wave along z that swells and shrinks it by 15 %, three times a turn. Other shapes have one form.
pub fn deformed(shape: &Shape, frame: i64) -> Result<Shape> {
    let Shape::Mesh(mesh) = shape else { return Ok(shape.clone()) };
    let (low, high) = mesh.bounds();
    let (middle, size) = (0.5 * (low + high), high - low);
    let wave = |v: &Vec3| {
        let along = TAU * (v.z - middle.z) / size.z.max(f32::MIN_POSITIVE);
        middle + (*v - middle) * (1.0 + 0.15 * (3.0 * TAU * turn(frame) + along).sin())
    };
    let vertices: Vec<_> = mesh.vertices.iter().map(wave).collect();
    Ok(Shape::Mesh(Arc::new(TriangleMesh::new(mesh.name.clone(), &vertices, &mesh.triangles)?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_path_closes_and_every_frame_of_it_is_another() {
        let (size, shape) = ([100.0, 80.0, 120.0], Shape::Box);
        let at = |frame| (views(size, 1.2, 4, frame).unwrap(), clip(&shape, size, frame).pose);
        for frame in 0..i64::from(PERIOD) {
            assert_eq!(at(frame), at(frame + i64::from(PERIOD)));
            assert_eq!(at(frame - i64::from(PERIOD)), at(frame));
            let (now, next) = (at(frame), at(frame + 1));
            assert!(now.0 != next.0 && now.1 != next.1, "frame {frame} stands still");
            // Smoothly: no more than a twentieth of the volume a frame.
            assert!(now.1.translate_mm.distance(next.1.translate_mm) < 6.0, "frame {frame} jumps");
        }
    }

    #[test]
    fn a_mesh_has_another_form_in_every_frame_and_stays_a_solid() {
        let shape = Shape::Mesh(Arc::new(TriangleMesh::torus(24, 12)));
        let form = |frame| match deformed(&shape, frame).unwrap() {
            Shape::Mesh(mesh) => mesh,
            other => panic!("{other:?}"),
        };
        let solid = form(0);
        for frame in 1..30 {
            let (now, before) = (form(frame), form(frame - 1));
            assert!(now.check_solid().is_ok() && now.vertices != before.vertices, "frame {frame}");
            assert_eq!(now.triangles, solid.triangles);
        }
        assert_eq!(*form(PERIOD.into()), *solid);
        assert!(matches!(deformed(&Shape::Sphere, 3), Ok(Shape::Sphere)));
    }

    #[test]
    fn one_view_is_between_the_two_and_four_begin_with_them() {
        let size = [100.0, 80.0, 120.0];
        let [one, two, four] = [1, 2, 4].map(|count| views(size, 1.0, count, 17).unwrap());
        assert_eq!([one.len(), two.len(), four.len()], [1, 2, 4]);
        assert_eq!(four[..2], two);
        assert!((one[0].position - 0.5 * (two[0].position + two[1].position)).length() < 1e-3);
        assert!(four[2].tan.right < four[0].tan.right && four[2].position == four[0].position);
    }
}
