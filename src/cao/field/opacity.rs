//! Stage 1, opacity classification `V → V_o` (CAO §3.1): `V_o(x) = TF_o(V(x))`, per reference length, before clipping.
//!
//! In: `volume` (3D texture), `transfer`. Out: `full_opacity` (3D r32float), same dims. Cost: one read, one write a voxel.

use crate::field::Field;
use crate::field::transfer::TransferBuffer;
use cao_gpu::Result;
use cao_gpu::{Gpu, Image, Pipeline, Recorder};
use cao_kernels::opacity as kernel;

/// The kernel `opacity`.
pub struct Opacity {
    pipeline: Pipeline,
}

impl Opacity {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Classifies every voxel.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        transfer: &TransferBuffer,
        full_opacity: &Image,
    ) -> Result<()> {
        let Field { dims, levels, bias, .. } = *field;
        let slope = field.scale / levels;
        let params = kernel::OpacityParams { dims, levels, slope, bias, pad: Default::default() };
        let binds = kernel::MainBindings { volume: &field.volume, transfer: &transfer.buffer, full_opacity };
        rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), field.dims)
    }
}
