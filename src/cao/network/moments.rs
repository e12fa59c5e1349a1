//! Mean and deviation of every channel of a tensor (DVAO eq. (2); `cao_twin::network::moments` has the equations).
//!
//! In: a tensor. Out: an entry of the norms for each of its blocks, 64 bytes. Cost: it is read twice.

use cao_gpu::Result;
use cao_gpu::{Access, Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::moments as kernel;
use std::ops::Range;

/// The kernel `moments`.
pub struct Moments {
    partial: Pipeline,
    merge: Pipeline,
}

/// Bytes of an entry of the norms.
pub const NORM: u64 = size_of::<kernel::Norm>() as u64;
/// Bytes of the moments of a part.
pub const PARTIAL: u64 = size_of::<kernel::Moments>() as u64;

/// Parts of a block of so many voxels.
pub fn parts(voxels: u32) -> u32 {
    voxels.div_ceil(kernel::PART)
}

/// The entry of a block that is not normalised.
pub fn plain() -> kernel::Norm {
    kernel::Norm { mean_low: [0.0; 4], mean_high: [0.0; 4], by_low: [1.0; 4], by_high: [1.0; 4] }
}

impl Moments {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self { partial: pipeline("partial")?, merge: pipeline("merge")? })
    }

    /// Some parts of a tensor of `blocks` blocks of so many voxels; with the last of them all blocks, whose entries begin at `norm`.
    #[expect(clippy::too_many_arguments, reason = "settings and bindings of the kernel, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        source: &Buffer,
        voxels: u32,
        blocks: u32,
        norm: u32,
        [partials, norms]: [&Buffer; 2],
        items: Range<u32>,
    ) -> Result<()> {
        let params = kernel::MomentsParams { voxels, parts: parts(voxels), norm, base: items.start };
        let push = bytemuck::bytes_of(&params);
        let binds = kernel::PartialBindings { source, partials };
        rec.dispatch(&self.partial, &binds, push, [items.len() as u32, 1, 1])?;
        if items.end == blocks * params.parts {
            rec.barrier(
                &[Access::StorageRead, Access::StorageWrite],
                &[Access::StorageRead, Access::StorageWrite],
            );
            let binds = kernel::MergeBindings { partials, norms };
            rec.dispatch(&self.merge, &binds, push, [blocks, 1, 1])?;
        }
        Ok(())
    }
}
