//! What each pixel shows of a world: normal, depth, and which triangle where, or the cap of a mesh that is cut. One ray a pixel and view, all views in one
//! dispatch.

use crate::Result;
use crate::mesh::geometry::Geometry;
use crate::mesh::surfaces::{Surfaces, built};
use cao_gpu::{Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::gbuffer as kernel;
use std::sync::OnceLock;

/// The kernel `gbuffer`.
pub struct Gbuffer {
    gpu: Gpu,
    plain: Pipeline,
    capped: OnceLock<Pipeline>,
}

impl Gbuffer {
    /// Bytes of a hit.
    pub const HIT: u64 = 8;

    /// Builds the pipeline for worlds without caps.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let plain = gpu.compute(&kernel::SHADER, "main")?;
        Ok(Self { gpu: gpu.clone(), plain, capped: OnceLock::new() })
    }

    /// Writes the geometry, whose eyes are there, and the hits, [`Self::HIT`] bytes a pixel.
    pub fn record(
        &self,
        rec: &mut Recorder,
        surfaces: &Surfaces,
        geometry: &Geometry,
        hits: &Buffer,
    ) -> Result<()> {
        let [width, height] = geometry.size();
        let params = kernel::GbufferParams { size: [width, height] };
        let binds = kernel::MainBindings {
            eyes: &geometry.eyes,
            tree: &surfaces.tree,
            triangles: &surfaces.triangles,
            looks: &surfaces.looks,
            materials: &surfaces.materials,
            texels: &surfaces.texels,
            clips: &surfaces.clips.clips,
            layers: &surfaces.clips.layers,
            geometry: &geometry.pixels,
            hits,
        };
        let over = [width, height, geometry.views() as u32];
        let pipeline =
            if surfaces.caps() { built(&self.gpu, &self.capped, &kernel::SHADER)? } else { &self.plain };
        Ok(rec.dispatch_over(pipeline, &binds, bytemuck::bytes_of(&params), over)?)
    }
}
