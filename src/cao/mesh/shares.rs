//! What clips and masks leave of each triangle (AOV §5.3's ᾱ): the share of its area, for occlusion that is of whole triangles.
//!
//! In: a world, clips. Out: an f32 a triangle. Cost: 136 points a triangle against each clip.

use crate::Result;
use crate::clip::clips::ClipSet;
use crate::host::rows_over;
use cao_gpu::{Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::shares as kernel;

/// The kernel `shares`.
pub struct Shares {
    pipeline: Pipeline,
}

impl Shares {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Of all triangles; `shares` holds an f32 each.
    pub fn record(
        &self,
        rec: &mut Recorder,
        triangles: &Buffer,
        clips: &ClipSet,
        shares: &Buffer,
    ) -> Result<()> {
        let count = (shares.bytes() / 4) as u32;
        let params = kernel::SharesParams { triangles: count };
        let binds = kernel::MainBindings { triangles, clips: &clips.clips, layers: &clips.layers, shares };
        let groups = rows_over(count, kernel::MAIN_WORKGROUP);
        Ok(rec.dispatch(&self.pipeline, &binds, bytemuck::bytes_of(&params), groups)?)
    }
}
