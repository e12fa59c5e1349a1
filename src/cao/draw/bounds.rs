//! The box of the bricks that show something, `[min b, max b]` over bricks `b` with distance 0: a ray that misses it ends at once.
//!
//! In: `distances` of `brick_distance`. Out: `bounds` (`spirv/shared/bounds.wgsl`). Cost: one read a brick.

use crate::field::Field;
use crate::host::{rows_over, same_layout};
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Pipeline, Recorder};
use cao_kernels::bounds as kernel;
use cao_kernels::shared::bounds::Bounds as Content;

same_layout!(Content, kernel::GrowingBounds { from_first, to_last });

/// The kernel `bounds`.
pub struct Bounds {
    pipeline: Pipeline,
}

impl Bounds {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Memory for the bounds.
    pub fn buffer(gpu: &Gpu) -> Result<Buffer> {
        gpu.buffer("bounds", size_of::<Content>() as u64, BufferUse::Device)
    }

    /// Writes the bounds. Distances may have been written right before: the barrier between is its own.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        distances: &Buffer,
        bounds: &Buffer,
    ) -> Result<()> {
        let params = kernel::BoundsParams { bricks: field.bricks(), pad: Default::default() };
        let params = bytemuck::bytes_of(&params);
        rec.fill(bounds, 0, bounds.bytes(), 0)?;
        rec.barrier(
            &[Access::TransferWrite, Access::StorageWrite],
            &[Access::StorageRead, Access::StorageWrite],
        );
        let groups = rows_over(field.brick_count(), kernel::MAIN_WORKGROUP);
        rec.dispatch(&self.pipeline, &kernel::MainBindings { distances, bounds }, params, groups)
    }
}
