//! Hierarchical clip classification (method.md §6): what the clips do to whole bricks of 8³ voxels, from bounds of
//! distances and depth layers over the brick, so that samples are taken only where a clip's surface passes.
//!
//! In: the clips with layers and dilation maps. Out: one u32 a brick, x fastest (`spirv/shared/clip_bounds.wgsl`): all
//! hidden, cut or all visible; none, some or all of its voxels within `reach` of something hidden; which clips leave it
//! open. Conservative: what is said of a brick holds for every clip sample of its voxels, so that who uses it computes the
//! same bits. Cost: one distance a brick and clip; for a mesh the blocks and cells under the brick's footprint.

use crate::clip::clips::ClipSet;
use crate::field::Field;
use crate::host::row_of_groups;
use bytemuck::{Pod, Zeroable};
use cao_gpu::Result;
use cao_gpu::layout_check;
use cao_gpu::{Bind, Buffer, BufferUse, Gpu, Pipeline, Recorder};
use cao_kernels as shaders;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    dims: [u32; 3],
    reach: f32,
    spacing: [f32; 3],
    pad: u32,
}
layout_check!(Params => shaders::clip_bricks::CLIP_BRICKS_PARAMS { dims, reach, spacing });

/// The word of a brick of which nothing is known: every voxel is tested and every sample taken.
pub const UNKNOWN: u32 = 0xffff7;

/// The kernel `clip_bricks`.
pub struct ClipBricks {
    pipeline: Pipeline,
}

impl ClipBricks {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&shaders::clip_bricks::SHADER, "main")? })
    }

    /// Memory for the words of a field's bricks.
    pub fn buffer(gpu: &Gpu, field: &Field) -> Result<Buffer> {
        gpu.buffer("clip bricks", 4 * u64::from(field.brick_count()), BufferUse::Device)
    }

    /// Writes the word of every brick. `reach` in mm is how far a clip's change reaches, as `classify` has it.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        clips: &ClipSet,
        reach: f32,
        clip_bricks: &Buffer,
    ) -> Result<()> {
        let params = Params { dims: field.dims, reach, spacing: field.spacing, pad: 0 };
        let binds = [
            ("clips", Bind::Buffer(&clips.clips)),
            ("layers", Bind::Buffer(&clips.layers)),
            ("dilation", Bind::Buffer(&clips.dilation)),
            ("clip_bricks", Bind::Buffer(clip_bricks)),
        ];
        let groups = row_of_groups(field.brick_count().div_ceil(64));
        rec.dispatch(&self.pipeline, &binds, bytemuck::bytes_of(&params), groups)
    }
}
