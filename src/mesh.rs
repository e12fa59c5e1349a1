//! Triangle meshes.
use glam::Vec3;
/// A triangle mesh.
#[derive(Clone, Debug)]
pub struct TriangleMesh {
    /// Name.
    pub name: String,
    /// Vertices.
    pub vertices: Vec<Vec3>,
    /// Triangles.
    pub triangles: Vec<[u32; 3]>,
}
impl TriangleMesh {
    /// Bounds.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        (Vec3::ZERO, Vec3::ONE)
    }
}
