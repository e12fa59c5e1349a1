//! What changed bricks held before an edit (method.md §5.2). A value of V_AO is a sum of whole 65535ths, one for each ray; where few
//! bricks changed, the rays that meet them are walked once through the former opacities, to take back what they contributed,
//! and once through the new ones.
//!
//! In and out: `opacity` V_o (3D r16unorm) and `past`, which [`super::carve`] fills: exchanged. Cost: a read and a write of both a voxel
//! of the changed bricks.

use crate::field::Field;
use crate::field::bricks::BrickList;
use bytemuck::{Pod, Zeroable};
use cao_gpu::Result;
use cao_gpu::layout_check;
use cao_gpu::{Access, Bind, Buffer, BufferUse, Gpu, Image, Pipeline, Recorder};
use cao_kernels as shaders;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    dims: [u32; 3],
    pad: u32,
}
layout_check!(Params => shaders::past::PAST_PARAMS { dims });

/// One brick in so many can change before all values within reach are computed anew: there, walking the rays that meet them
/// twice is no cheaper, and this much memory, an eighth of a byte a voxel, is enough.
const SHARE: u32 = 16;
/// But so many always.
const LEAST: u32 = 64;

/// Changed bricks and their former opacities.
pub struct PastBricks {
    /// The changed bricks; their number counts on beyond `capacity`.
    pub list: BrickList,
    /// Former V_o of the listed bricks in 65535ths, 256 u32 each: the voxels of slices z and z + 4 in one.
    pub opacities: Buffer,
    /// Most bricks kept.
    pub capacity: u32,
}

impl PastBricks {
    /// Memory for a sixteenth of a field's bricks, or the few of a small one.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        let capacity = (field.brick_count() / SHARE).max(LEAST);
        Ok(Self {
            list: BrickList::with_room(gpu, capacity)?,
            opacities: gpu.buffer("past opacities", 1024 * u64::from(capacity), BufferUse::Device)?,
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
        Ok(Self { pipeline: gpu.compute(&shaders::past::SHADER, "main")? })
    }

    /// Exchanges them, and makes them visible to compute shaders.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        past: &PastBricks,
        opacity: &Image,
    ) -> Result<()> {
        let binds = [
            ("changed", Bind::Buffer(&past.list.buffer)),
            ("past", Bind::Buffer(&past.opacities)),
            ("opacity", Bind::Image(opacity)),
        ];
        let params = Params { dims: field.dims, pad: 0 };
        rec.dispatch_indirect(&self.pipeline, &binds, bytemuck::bytes_of(&params), &past.list.buffer, 0)?;
        let all = [Access::StorageRead, Access::StorageWrite];
        rec.barrier(&all, &all);
        Ok(())
    }
}
