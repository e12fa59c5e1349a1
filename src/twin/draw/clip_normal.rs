//! Normals of cut faces: of the shape itself, whatever depth maps make of it.

use cao_model::clip::{Clip, Mode, Shape};
use glam::{DMat3, DVec3};

/// Unit normal, in the world, of the surface of a clip at or very near a world point (mm). It points out of what is left, into what is
/// hidden; a mesh's towards the eye, where what is hidden is when a ray comes out of it.
pub fn clip_normal(clip: &Clip, world: DVec3, towards_eye: DVec3) -> DVec3 {
    let rotation = rotation(clip);
    let scale = clip.pose.scale.as_dvec3();
    let local = |world: DVec3| rotation.transpose() * (world - clip.pose.translate_mm.as_dvec3()) / scale;
    if let Shape::Mesh(mesh) = &clip.shape {
        let rigid = local(world) * scale;
        let corners = |t: &[u32; 3]| t.map(|v| mesh.vertices[v as usize].as_dvec3() * scale);
        let distance = |t: &&[u32; 3]| distance_to(corners(t), rigid);
        let nearest = mesh.triangles.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let [a, b, c] = corners(nearest.expect("meshes have triangles"));
        let normal = rotation * (b - a).cross(c - a).normalize();
        return if normal.dot(towards_eye) < 0.0 { -normal } else { normal };
    }
    // Differences in the world, so that pose and scale need no rule of their own.
    let h = 1e-6 * scale.min_element();
    let gradient = DVec3::from_array(std::array::from_fn(|axis| {
        let mut step = DVec3::ZERO;
        step[axis] = h;
        level(&clip.shape, local(world + step)) - level(&clip.shape, local(world - step))
    }));
    let outwards = gradient.normalize_or_zero();
    if clip.mode == Mode::Keep { outwards } else { -outwards }
}

/// `Rz·Ry·Rx` of the pose.
fn rotation(clip: &Clip) -> DMat3 {
    let [x, y, z] = clip.pose.rotate_deg.as_dvec3().to_array().map(f64::to_radians);
    DMat3::from_rotation_z(z) * DMat3::from_rotation_y(y) * DMat3::from_rotation_x(x)
}

/// Something that is 0 on the surface of an analytic shape and grows outwards.
fn level(shape: &Shape, p: DVec3) -> f64 {
    let ring = p.truncate().length();
    match shape {
        Shape::Box => p.abs().max_element(),
        Shape::Sphere => p.length(),
        Shape::Cylinder => ring.max(p.z.abs()),
        Shape::Cone => (-1.0 - p.z).max((2.0 * ring + p.z - 1.0) / 5_f64.sqrt()),
        Shape::Torus => (ring - 1.0).hypot(p.z),
        Shape::Plane | Shape::Mesh(_) => -p.z,
    }
}

/// Distance of a point to a triangle.
fn distance_to([a, b, c]: [DVec3; 3], p: DVec3) -> f64 {
    let normal = (b - a).cross(c - a);
    let inside = |from: DVec3, to: DVec3| (to - from).cross(p - from).dot(normal) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) {
        return (p - a).dot(normal.normalize()).abs();
    }
    let to_edge = |from: DVec3, to: DVec3| {
        let edge = to - from;
        let along = ((p - from).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        (p - from - along * edge).length()
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use cao_model::clip::Pose;
    use cao_model::mesh::TriangleMesh;
    use glam::Vec3;
    use std::sync::Arc;

    /// A step along the normal leaves what is left, one against it stays: for every shape, at any pose, at points on its surface.
    #[test]
    fn normals_point_out_of_what_is_left() {
        let mut random = Random(12);
        for shape in Shape::ANALYTIC {
            for mode in [Mode::Remove, Mode::Keep] {
                let mut found = 0;
                while found < 100 {
                    let pose = Pose {
                        translate_mm: random.vector(-5.0, 5.0),
                        rotate_deg: random.vector(-180.0, 180.0),
                        scale: random.vector(3.0, 8.0),
                    };
                    let clip = Clip { shape: shape.clone(), mode, pose };
                    let [mut hidden, mut shown] = [random.vector(-15.0, 15.0), random.vector(-15.0, 15.0)];
                    if clip.hides(hidden) != Some(true) || clip.hides(shown) != Some(false) {
                        continue;
                    }
                    for _ in 0..20 {
                        let middle = (hidden + shown) / 2.0;
                        if clip.hides(middle) == Some(true) { hidden = middle } else { shown = middle }
                    }
                    let normal = clip_normal(&clip, shown.as_dvec3(), DVec3::X).as_vec3();
                    assert!((normal.length() - 1.0).abs() < 1e-5);
                    assert_eq!(clip.hides(shown + 0.01 * normal), Some(true), "{clip:?} {shown}");
                    assert_eq!(clip.hides(shown - 0.01 * normal), Some(false), "{clip:?} {shown}");
                    found += 1;
                }
            }
        }
    }

    /// A mesh of a ball and a box has their normals.
    #[test]
    fn meshes_have_the_normals_of_their_triangles() {
        let pose = Pose { rotate_deg: Vec3::new(20.0, 50.0, -10.0), ..Pose::default() };
        let mut random = Random(13);
        for (mesh, shape, limit) in
            [(TriangleMesh::cuboid(), Shape::Box, 1e-6), (TriangleMesh::sphere(5), Shape::Sphere, 0.06)]
        {
            let meshed = Clip { shape: Shape::Mesh(Arc::new(mesh)), mode: Mode::Remove, pose };
            let exact = Clip { shape, ..meshed.clone() };
            for _ in 0..100 {
                let direction = random.vector(-1.0, 1.0);
                let size = level(&exact.shape, rotation(&exact).transpose() * direction.as_dvec3());
                let on_surface = direction.as_dvec3() / size * 0.999;
                let expected = clip_normal(&exact, on_surface, DVec3::ZERO);
                let found = clip_normal(&meshed, on_surface, expected);
                assert!(found.distance(expected) < limit, "{found} {expected}");
            }
        }
    }
}
