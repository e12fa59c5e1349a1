//! Horizon-based ambient occlusion (`cao_twin::image_space::hbao` has the equations).
//!
//! In: geometry and eyes. Out: accessibility before its filter, an f32 a pixel. Cost: six depths a direction.

use crate::Result;
use crate::mesh::geometry::Geometry;
use cao_gpu::{Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::hbao as kernel;
use cao_model::image_space::Hbao;

/// The kernel `hbao`.
pub struct HbaoShading {
    pipeline: Pipeline,
}

impl HbaoShading {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Shades all views. `accessibility` is of [`Geometry::values`].
    pub fn record(
        &self,
        rec: &mut Recorder,
        geometry: &Geometry,
        settings: &Hbao,
        accessibility: &Buffer,
    ) -> Result<()> {
        let size = geometry.size();
        let (sin, cos) = f64::from(settings.bias_deg).to_radians().sin_cos();
        let params = kernel::HbaoParams {
            size,
            radius: settings.radius_mm,
            directions: settings.directions,
            bias: [sin as f32, cos as f32],
            falloff: f32::from(u8::from(settings.falloff)),
            pad: Default::default(),
        };
        let binds = kernel::MainBindings { geometry: &geometry.pixels, eyes: &geometry.eyes, accessibility };
        let over = [size[0], size[1], geometry.views() as u32];
        Ok(rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), over)?)
    }
}
