//! Files of surfaces: Wavefront OBJ with its materials, glTF 2.0; PNG textures.
//!
//! Lengths come out in mm, z up: OBJ is taken as it stands, glTF (metres, y up) is scaled and turned. Memory follows the file: what counts or
//! sizes claim is compared with what is there, and with limits that are said. Nothing is fetched from a network.

mod gltf;
mod gltf_data;
mod mtl;
mod obj;
mod place;
mod texture;

pub use place::moved;

use std::path::Path;

use crate::{Error, Result};
use cao_model::mesh::TriangleMesh;
use cao_model::surface::{Instance, Surface};

/// Longest file of geometry: some five million triangles as text.
const MAX_BYTES: u64 = 256 << 20;

/// The surfaces of a file, by the ending of its name: `.obj` is one, at the origin; `.gltf` and `.glb` are the nodes of
/// the default scene.
///
/// # Errors
/// [`Error::Io`] for a file that cannot be read; [`Error::File`] naming the file, its part, what was found and what would do, also for the
/// materials and textures that it names; [`cao_model::Error::Mesh`] for a mesh that is none
/// ([`Surface::check`](cao_model::surface::Surface::check)).
pub fn load(path: &Path) -> Result<Vec<Instance>> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    let instances = match ending.as_str() {
        "obj" => obj::load(path)?,
        "gltf" | "glb" => gltf::load(path)?,
        _ => {
            let problem =
                "is no mesh that is read; expected .obj, .gltf or .glb, or another format converted to it";
            return Err(Error::file(path, "name", problem));
        }
    };
    instances.iter().try_for_each(|instance| instance.surface.check())?;
    Ok(instances)
}

/// Gives what has no inside two sides: where the triangles without a mask do not close, each material without one.
fn two_sided(surface: &mut Surface) {
    let Surface { triangles, material_of, materials, .. } = &*surface;
    let opaque = triangles.iter().zip(material_of).filter(|(_, m)| materials[**m as usize].cutoff.is_none());
    let opaque: Vec<[u32; 3]> = opaque.map(|(corners, _)| *corners).collect();
    let closed = TriangleMesh::new("", &surface.positions, &opaque).is_ok_and(|mesh| mesh.closed().is_ok());
    surface.materials.iter_mut().for_each(|material| material.two_sided |= !closed);
}
