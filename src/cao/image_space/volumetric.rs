//! Volumetric ambient occlusion (`cao_twin::image_space::volumetric` has the equations).
//!
//! In: geometry and eyes. Out: accessibility, an f32 a pixel. Cost: a depth a line.

use crate::Result;
use crate::mesh::geometry::Geometry;
use cao_gpu::{Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::volumetric as kernel;
use cao_model::image_space::Volumetric;

/// The kernel `volumetric`.
pub struct VolumetricShading {
    pipeline: Pipeline,
}

impl VolumetricShading {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Shades all views. `accessibility` is of [`Geometry::values`].
    pub fn record(
        &self,
        rec: &mut Recorder,
        geometry: &Geometry,
        settings: &Volumetric,
        accessibility: &Buffer,
    ) -> Result<()> {
        let size = geometry.size();
        let Volumetric { radius_mm: radius, samples } = *settings;
        let params = kernel::VolumetricParams { size, radius, samples };
        let binds = kernel::MainBindings { geometry: &geometry.pixels, eyes: &geometry.eyes, accessibility };
        let over = [size[0], size[1], geometry.views() as u32];
        Ok(rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), over)?)
    }
}
