//! What changed bricks held before an edit (method.md §5.2). A value of V_AO is a sum of whole 65535ths, one for each ray; where few
//! bricks changed, the rays that meet them are walked once through the former opacities, to take back what they contributed,
//! and once through the new ones.
//!
//! In and out: `opacity` V_o (3D r16unorm) and `past`, which [`super::carve`] fills: exchanged. Cost: a read and a write of both a voxel
//! of the changed bricks.

use crate::field::Field;
use crate::field::bricks::BrickList;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Image, Pipeline, Recorder};
use cao_kernels::past as kernel;

/// One brick in so many can change before all values within reach are computed anew: there, walking the rays that meet them
/// twice is no cheaper, and this much memory, an eighth of a byte a voxel, is enough.
const SHARE: u32 = 16;
/// But so many always.
const LEAST: u32 = 64;

/// Changed bricks and their former opacities.
pub struct PastBricks {
    /// The changed bricks; their number counts on beyond `capacity`.
    pub list: BrickList,
    /// Former V_o of the listed bricks in 65535ths, [`kernel::PAST_WORDS`] u32 each: two voxels in one.
    pub opacities: Buffer,
    /// Most bricks kept.
    pub capacity: u32,
}

impl PastBricks {
    /// Memory for a sixteenth of a field's bricks, or the few of a small one.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        let capacity = (field.brick_count() / SHARE).max(LEAST);
        let brick = u64::from(kernel::PAST_WORDS) * size_of::<u32>() as u64;
        Ok(Self {
            list: BrickList::with_room(gpu, capacity)?,
            opacities: gpu.buffer("past opacities", brick * u64::from(capacity), BufferUse::Device)?,
            capacity,
        })
    }
}

/// The kernel `past`.
pub struct Past {
    pipeline: Pipeline,
}

impl Past {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Exchanges them, and makes them visible to compute shaders.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        past: &PastBricks,
        opacity: &Image,
    ) -> Result<()> {
        let binds = kernel::MainBindings { changed: &past.list.buffer, past: &past.opacities, opacity };
        let params = kernel::PastParams { dims: field.dims, pad: Default::default() };
        rec.dispatch_indirect(&self.pipeline, &binds, bytemuck::bytes_of(&params), &past.list.buffer, 0)?;
        let all = [Access::StorageRead, Access::StorageWrite];
        rec.barrier(&all, &all);
        Ok(())
    }
}
