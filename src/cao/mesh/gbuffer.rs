//! What each pixel shows of a world: normal, depth, and which triangle where, or the cap of a mesh that is cut. One ray a pixel and view, all views in one
//! dispatch.

use crate::Result;
use crate::mesh::geometry::Geometry;
use crate::mesh::surfaces::{ByCaps, Surfaces};
use cao_gpu::{Buffer, Gpu, Recorder};
use cao_kernels::gbuffer as kernel;

/// The kernel `gbuffer`.
pub struct Gbuffer {
    pipelines: ByCaps,
}

impl Gbuffer {
    /// Bytes of a hit.
    pub const HIT: u64 = 8;

    /// Builds the pipeline for worlds without caps.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipelines: ByCaps::new(gpu, &kernel::SHADER)? })
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
        Ok(rec.dispatch_over(self.pipelines.of(surfaces)?, &binds, bytemuck::bytes_of(&params), over)?)
    }
}
