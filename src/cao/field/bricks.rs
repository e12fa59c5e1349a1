//! Compaction: the list of bricks that have something to compute, and the arguments of the dispatch over it, so that
//! nothing runs for the others (the paper dispatches every voxel and returns early, CAO §3.5 step 5).
//!
//! In: `opacity` (for [`Which::Needed`]), `mask` and `changed_before` (for [`Which::Changed`]). Out: `list`. Cost: at most
//! two reads a voxel.

use crate::field::Field;
use crate::host::{device_buffer, row_of_groups};
use bytemuck::{Pod, Zeroable};
use cao_gpu::Result;
use cao_gpu::layout_check;
use cao_gpu::{Access, Bind, Buffer, BufferUse, Gpu, Image, Pipeline, Recorder};
use cao_kernels as shaders;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    dims: [u32; 3],
    mode: u32,
    bricks: [u32; 3],
    pad: u32,
}
layout_check!(Params => shaders::bricks::BRICKS_PARAMS { dims, mode, bricks });

/// Which bricks are listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// Every brick.
    All = 0,
    /// Bricks with opacity in a voxel or a neighbour of one.
    Needed = 1,
    /// Bricks in which the clips changed a voxel's neighbourhood, now or at the last update.
    Changed = 2,
}

/// A list of bricks in device memory.
pub struct BrickList {
    /// Group counts x, y, z for an indirect dispatch, number of bricks, their indices (x fastest) in no fixed order.
    pub buffer: Buffer,
}

impl BrickList {
    /// Byte offset of the number of bricks.
    pub const COUNT_AT: u64 = 12;

    /// Memory for all bricks of a field.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        Self::with_room(gpu, field.brick_count())
    }

    /// Memory for so many bricks.
    pub fn with_room(gpu: &Gpu, bricks: u32) -> Result<Self> {
        let bytes = 16 + 4 * u64::from(bricks);
        Ok(Self { buffer: gpu.buffer("brick list", bytes, BufferUse::Device)? })
    }

    /// A list of these bricks. Uses the device's queue and waits for it.
    pub fn of(gpu: &Gpu, bricks: &[u32]) -> Result<Self> {
        let count = bricks.len() as u32;
        let [x, y, _] = row_of_groups(count);
        let mut content = vec![x, y, 1, count];
        content.extend(bricks);
        Ok(Self { buffer: device_buffer(gpu, "brick list", bytemuck::cast_slice(&content))? })
    }

    /// Empties the list, for a kernel that fills it.
    pub fn record_clear(&self, rec: &mut Recorder) -> Result<()> {
        rec.barrier(
            &[Access::IndirectRead, Access::StorageRead],
            &[Access::TransferWrite, Access::StorageWrite],
        );
        rec.update(&self.buffer, 0, bytemuck::bytes_of(&[0_u32, 0, 1, 0]))?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
        Ok(())
    }
}

/// The kernel `bricks`.
pub struct Bricks {
    pipeline: Pipeline,
}

impl Bricks {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&shaders::bricks::SHADER, "main")? })
    }

    /// Fills the list and makes it visible to indirect dispatches and compute shaders. `changed_before` holds a u32 a
    /// brick.
    #[expect(clippy::too_many_arguments, reason = "each is one binding or parameter of the kernel")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        which: Which,
        opacity: &Image,
        mask: &Image,
        changed_before: &Buffer,
        list: &BrickList,
    ) -> Result<()> {
        list.record_clear(rec)?;
        let params = Params { dims: field.dims, mode: which as u32, bricks: field.bricks(), pad: 0 };
        let binds = [
            ("opacity", Bind::Image(opacity)),
            ("mask", Bind::Image(mask)),
            ("changed_before", Bind::Buffer(changed_before)),
            ("list", Bind::Buffer(&list.buffer)),
        ];
        let groups = row_of_groups(field.brick_count());
        rec.dispatch(&self.pipeline, &binds, bytemuck::bytes_of(&params), groups)?;
        rec.barrier(
            &[Access::StorageWrite],
            &[Access::IndirectRead, Access::StorageRead, Access::StorageWrite, Access::TransferRead],
        );
        Ok(())
    }
}
