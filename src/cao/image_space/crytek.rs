//! Crytek's ambient occlusion from depth (`cao_twin::image_space::crytek` has the equations).
//!
//! In: geometry and eyes. Out: accessibility before its blur, an f32 a pixel. Cost: 16 depths a pixel.

use crate::Result;
use crate::mesh::geometry::Geometry;
use cao_gpu::{Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::crytek as kernel;
use cao_model::image_space::Crytek;

/// The kernel `crytek`.
pub struct CrytekShading {
    pipeline: Pipeline,
}

impl CrytekShading {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Shades all views. `accessibility` is of [`Geometry::values`].
    pub fn record(
        &self,
        rec: &mut Recorder,
        geometry: &Geometry,
        settings: &Crytek,
        accessibility: &Buffer,
    ) -> Result<()> {
        let size = geometry.size();
        let params = kernel::CrytekParams { size, radius: settings.radius_mm, pad: Default::default() };
        let binds = kernel::MainBindings { geometry: &geometry.pixels, eyes: &geometry.eyes, accessibility };
        let over = [size[0], size[1], geometry.views() as u32];
        Ok(rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), over)?)
    }
}
