//! How far a ray may leap: the Chebyshev distance in bricks from each brick to the nearest that can show something
//! (distance-based empty-space skipping, after Deakin and Knackstedt 2020, on bricks),
//! `d(b) = min { max(|b_x − c_x|, |b_y − c_y|, |b_z − c_z|) : c shows something }`, in three passes, one an axis.
//!
//! In: `occupancy`, the words of `clip_bricks`. Out: `distances`, one u32 a brick, x fastest: bits 0 … 11 the distance to the
//! nearest brick with opacity, 12 … 23 to the nearest with opacity that the clips do not hide as a whole (4095: there
//! is none), 24 … 31 a bit for each clip that hides any of what a ray reads in the brick. Cost: bricks × the distances found.

use crate::field::Field;
use crate::host::row_of_groups;
use bytemuck::{Pod, Zeroable};
use cao_gpu::Result;
use cao_gpu::layout_check;
use cao_gpu::{Access, Bind, Buffer, BufferUse, Gpu, Pipeline, Recorder};
use cao_kernels as shaders;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    bricks: [u32; 3],
    axis: u32,
}
layout_check!(Params => shaders::brick_distance::BRICK_DISTANCE_PARAMS { bricks, axis });

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
            first: gpu.compute(&shaders::brick_distance::SHADER, "first")?,
            next: gpu.compute(&shaders::brick_distance::SHADER, "next")?,
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
        let groups = row_of_groups(field.brick_count().div_ceil(64));
        let params = |axis| Params { bricks: field.bricks(), axis };
        let binds = [
            ("occupancy", Bind::Buffer(occupancy)),
            ("clip_bricks", Bind::Buffer(clip_bricks)),
            ("distances", Bind::Buffer(distances)),
        ];
        rec.dispatch(&self.first, &binds, bytemuck::bytes_of(&params(0)), groups)?;
        for (axis, from, to) in [(1, distances, &self.between), (2, &self.between, distances)] {
            rec.barrier(
                &[Access::StorageRead, Access::StorageWrite],
                &[Access::StorageRead, Access::StorageWrite],
            );
            let binds = [("before", Bind::Buffer(from)), ("distances", Bind::Buffer(to))];
            rec.dispatch(&self.next, &binds, bytemuck::bytes_of(&params(axis)), groups)?;
        }
        Ok(())
    }
}
