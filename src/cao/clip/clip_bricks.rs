//! Hierarchical clip classification (method.md §6): what the clips do to whole bricks, from bounds of
//! distances and depth layers over the brick, so that samples are taken only where a clip's surface passes.
//!
//! In: the clips with layers and dilation maps. Out: one u32 a brick, x fastest (`spirv/shared/clip_codes.wgsl`): all
//! hidden, cut or all visible; none, some or all of its voxels within `reach` of something hidden; which clips leave it
//! open. Conservative: what is said of a brick holds for every clip sample of its voxels, so that who uses it computes the
//! same bits. Cost: one distance a brick and clip; for a mesh the blocks and cells under the brick's footprint.

use crate::clip::clips::ClipSet;
use crate::field::Field;
use crate::host::rows_over;
use cao_gpu::Result;
use cao_gpu::{Buffer, BufferUse, Gpu, Pipeline, Recorder};
use cao_kernels::clip_bricks as kernel;
use cao_model::settings::Support;

pub use cao_kernels::shared::clip_codes::UNKNOWN;

/// The kernel `clip_bricks`.
pub struct ClipBricks {
    pipeline: Pipeline,
}

impl ClipBricks {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Memory for the words of a field's bricks.
    pub fn buffer(gpu: &Gpu, field: &Field) -> Result<Buffer> {
        gpu.buffer("clip bricks", 4 * u64::from(field.brick_count()), BufferUse::Device)
    }

    /// Writes the word of every brick. `reach` in mm is how far a clip's change reaches, as `classify` has it, and `support` where
    /// the clip samples of voxels lie.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        clips: &ClipSet,
        reach: f32,
        support: Support,
        clip_bricks: &Buffer,
    ) -> Result<()> {
        let (dims, spacing) = (field.dims, field.spacing);
        let params = kernel::ClipBricksParams { dims, reach, spacing, beyond: support.corner() - 0.5 };
        let binds = kernel::MainBindings {
            clips: &clips.clips,
            layers: &clips.layers,
            dilation: &clips.dilation,
            clip_bricks,
        };
        let groups = rows_over(field.brick_count(), kernel::MAIN_WORKGROUP);
        rec.dispatch(&self.pipeline, &binds, bytemuck::bytes_of(&params), groups)
    }
}
