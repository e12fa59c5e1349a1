//! How far a ray may leap: the Chebyshev distance in bricks from each brick to the nearest that can show something
//! (distance-based empty-space skipping, after Deakin and Knackstedt 2020, on bricks),
//! `d(b) = min { max(|b_x − c_x|, |b_y − c_y|, |b_z − c_z|) : c shows something }`, in three passes, one an axis.
//!
//! In: `occupancy`, the words of `clip_bricks`. Out: `distances`, one u32 a brick, x fastest (`spirv/shared/distances.wgsl`): the
//! distance to the nearest brick with opacity that the clips do not hide as a whole, and a bit for each clip that hides any of what a ray
//! reads in the brick. Cost: bricks × the distances found.

use crate::field::Field;
use crate::host::rows_over;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Pipeline, Recorder};
use cao_kernels::brick_distance as kernel;

/// The kernel `brick_distance`, and memory between its passes.
pub struct BrickDistance {
    first: Pipeline,
    next: Pipeline,
    between: Buffer,
}

impl BrickDistance {
    /// Builds the pipelines, for a field of this size.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        Ok(Self {
            first: gpu.compute(&kernel::SHADER, "first")?,
            next: gpu.compute(&kernel::SHADER, "next")?,
            between: Self::buffer(gpu, field)?,
        })
    }

    /// Memory for the words of a field's bricks.
    pub fn buffer(gpu: &Gpu, field: &Field) -> Result<Buffer> {
        gpu.buffer("brick distances", 4 * u64::from(field.brick_count()), BufferUse::Device)
    }

    /// Writes the word of every brick; barriers between the passes are its own.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        occupancy: &Buffer,
        clip_bricks: &Buffer,
        distances: &Buffer,
    ) -> Result<()> {
        const { assert!(kernel::FIRST_WORKGROUP[0] == kernel::NEXT_WORKGROUP[0]) };
        let groups = rows_over(field.brick_count(), kernel::FIRST_WORKGROUP);
        let params = |axis| kernel::BrickDistanceParams { bricks: field.bricks(), axis };
        let binds = kernel::FirstBindings { occupancy, clip_bricks, distances };
        rec.dispatch(&self.first, &binds, bytemuck::bytes_of(&params(0)), groups)?;
        for (axis, before, distances) in [(1, distances, &self.between), (2, &self.between, distances)] {
            rec.barrier(
                &[Access::StorageRead, Access::StorageWrite],
                &[Access::StorageRead, Access::StorageWrite],
            );
            let binds = kernel::NextBindings { before, distances };
            rec.dispatch(&self.next, &binds, bytemuck::bytes_of(&params(axis)), groups)?;
        }
        Ok(())
    }
}
