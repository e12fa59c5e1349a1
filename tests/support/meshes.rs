//! Meshes of several parts, and the independent count of what is inside them.

use cao_model::mesh::TriangleMesh;
use glam::{DVec3, Vec3};

/// Surfaces at different places and sizes in one mesh: (surface, scale, place, inside out).
pub fn join(parts: &[(&TriangleMesh, f32, Vec3, bool)]) -> TriangleMesh {
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for &(mesh, scale, place, turned) in parts {
        let first = positions.len() as u32;
        positions.extend(mesh.vertices.iter().map(|v| *v * scale + place));
        faces.extend(mesh.triangles.iter().map(|t| {
            let [a, b, c] = t.map(|v| v + first);
            if turned { [a, c, b] } else { [a, b, c] }
        }));
    }
    TriangleMesh::new("parts", &positions, &faces).unwrap()
}

/// Winding number of the surface around a point off it, from the solid angles of its triangles (Van Oosterom and Strackee 1983);
/// a whole number if and only if the surface has no border.
pub fn winding_number(mesh: &TriangleMesh, eye: DVec3) -> f64 {
    let angle = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize].as_dvec3() - eye);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * a.dot(b.cross(c)).atan2(below)
    };
    mesh.triangles.iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}
