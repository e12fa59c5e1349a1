//! Worlds of plane quadrilaterals with one side, two triangles each: what the trials of meshes are made of.

use crate::Result;
use cao_model::clip::Pose;
use cao_model::surface::{Instance, Material, Surface, World};
use glam::Vec3;
use std::sync::Arc;

/// Corners in mm, counter-clockwise seen from the front.
pub(super) type Quad = [Vec3; 4];

/// From a corner along two sides; its front is where `u × v` points.
pub(super) fn quad(corner: Vec3, u: Vec3, v: Vec3) -> Quad {
    [corner, corner + u, corner + u + v, corner + v]
}

/// The same in n × n parts.
pub(super) fn grid(corner: Vec3, u: Vec3, v: Vec3, n: u32) -> Vec<Quad> {
    let at = |i: u32, j: u32| corner + (u * i as f32 + v * j as f32) / n as f32;
    let parts = (0..n).flat_map(|j| (0..n).map(move |i| [i, j]));
    parts.map(|[i, j]| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]).collect()
}

/// A box but for its bottom, faces outward.
pub(super) fn block(low: Vec3, high: Vec3) -> [Quad; 5] {
    let [x, y, z] = Vec3::AXES.map(|axis| axis * (high - low));
    [
        quad(low + z, x, y),
        quad(low, x, z),
        quad(low + x, y, z),
        quad(low + x + y, -x, z),
        quad(low + y, -y, z),
    ]
}

/// All of them.
pub(super) fn world(quads: &[Quad]) -> Result<World> {
    let firsts = (0..quads.len() as u32).map(|n| 4 * n);
    let surface = Surface {
        name: "quads".into(),
        positions: quads.as_flattened().to_vec(),
        triangles: firsts.flat_map(|a| [[a, a + 1, a + 2], [a, a + 2, a + 3]]).collect(),
        material_of: vec![0; 2 * quads.len()],
        materials: vec![Material::default()],
        ..Surface::default()
    };
    Ok(World::new(&[Instance { surface: Arc::new(surface), pose: Pose::default() }])?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fronts_are_outward_and_towards_u_cross_v() {
        let front = |[a, b, c, _]: Quad| (b - a).cross(c - a);
        let (low, high) = (Vec3::new(1.0, -2.0, 0.0), Vec3::new(4.0, 3.0, 7.0));
        for face in block(low, high) {
            let middle = face.iter().sum::<Vec3>() / 4.0;
            assert!(front(face).dot(middle - 0.5 * (low + high)) > 0.0, "{face:?}");
        }
        let parts = grid(Vec3::ZERO, Vec3::X, Vec3::Y, 3);
        assert!(parts.len() == 9 && parts.iter().all(|part| front(*part).z > 0.0));
        assert_eq!(parts[8][2], Vec3::new(1.0, 1.0, 0.0));
    }
}
