//! What views show of a world, without a renderer: normals and depths, for what is measured of pixels.

use crate::Result;
use cao::mesh::gbuffer::Gbuffer;
use cao::mesh::geometry::Geometry;
use cao::mesh::surfaces::Surfaces;
use cao_gpu::{BufferUse, Gpu};
use cao_model::view::View;

/// Of so many views of `size` pixels. Uses the device's queue and waits for it.
///
/// # Errors
/// Impossible views; a device without memory.
pub fn shown(gpu: &Gpu, surfaces: &Surfaces, size: [u32; 2], views: &[View]) -> Result<Geometry> {
    let geometry = Geometry::new(gpu, size, views.len())?;
    let pixels = geometry.pixels.bytes() / Geometry::BYTES;
    let hits = gpu.buffer("hits", Gbuffer::HIT * pixels, BufferUse::Device)?;
    let mut rec = gpu.recorder("geometry of meshes")?;
    geometry.record_eyes(&mut rec, views)?;
    Gbuffer::new(gpu)?.record(&mut rec, surfaces, &geometry, &hits)?;
    rec.submit_and_wait()?;
    Ok(geometry)
}
