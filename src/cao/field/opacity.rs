//! Stage 1, opacity classification `V → V_o` (CAO §3.1): `V_o(x) = TF_o(V(x))`, per reference length, before clipping.
//!
//! In: `volume` (3D texture), `transfer`. Out: `full_opacity` (3D r32float), same dims. Cost: one read, one write a voxel.

use crate::field::Field;
use crate::field::transfer::TransferBuffer;
use bytemuck::{Pod, Zeroable};
use cao_gpu::Result;
use cao_gpu::layout_check;
use cao_gpu::{Bind, Gpu, Image, Pipeline, Recorder};
use cao_kernels as shaders;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    dims: [u32; 3],
    levels: f32,
    slope: f32,
    bias: f32,
    pad: [u32; 2],
}
layout_check!(Params => shaders::opacity::OPACITY_PARAMS { dims, levels, slope, bias });

/// The kernel `opacity`.
pub struct Opacity {
    pipeline: Pipeline,
}

impl Opacity {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&shaders::opacity::SHADER, "main")? })
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
        let params = Params { dims, levels, slope: field.scale / levels, bias, pad: [0; 2] };
        let binds = [
            ("volume", Bind::Image(&field.volume)),
            ("transfer", Bind::Buffer(&transfer.buffer)),
            ("full_opacity", Bind::Image(full_opacity)),
        ];
        rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), field.dims)
    }
}
