//! Compaction: the list of bricks that have something to compute, and the arguments of the dispatch over it, so that
//! nothing runs for the others (the paper dispatches every voxel and returns early, CAO §3.5 step 5).
//!
//! In: `opacity` (for [`Which::Needed`]), `mask` and `changed_before` (for [`Which::Changed`]). Out: `list`. Cost: at most
//! two reads a voxel.

use crate::drive::Items;
use crate::field::Field;
use crate::host::{device_buffer, row_of_groups, same_layout};
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Image, Pipeline, Recorder};
use cao_kernels::bricks as kernel;
use cao_kernels::shared::bricks::BrickList as Head;
use cao_kernels::shared::growing::GrowingList;
use std::mem::offset_of;

same_layout!(Head, GrowingList { groups_x, groups_y, groups_z, count });

/// Which bricks are listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// Every brick.
    All = kernel::ALL as isize,
    /// Bricks with opacity in a voxel or a neighbour of one.
    Needed = kernel::NEEDED as isize,
    /// Bricks in which the clips changed a voxel's neighbourhood, now or at the last update.
    Changed = kernel::CHANGED as isize,
}

/// A list of bricks in device memory.
pub struct BrickList {
    /// Group counts x, y, z for an indirect dispatch, number of bricks, their indices (x fastest) in no fixed order.
    pub buffer: Buffer,
}

impl BrickList {
    /// Byte offset of the number of bricks.
    pub const COUNT_AT: u64 = offset_of!(Head, count) as u64;

    /// Memory for all bricks of a field.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        Self::with_room(gpu, field.brick_count())
    }

    /// Memory for so many bricks.
    pub fn with_room(gpu: &Gpu, bricks: u32) -> Result<Self> {
        let bytes = Head::ITEMS_AT + size_of::<u32>() as u64 * u64::from(bricks);
        Ok(Self { buffer: gpu.buffer("brick list", bytes, BufferUse::Device)? })
    }

    /// A list of these bricks. Uses the device's queue and waits for it.
    pub fn of(gpu: &Gpu, bricks: &[u32]) -> Result<Self> {
        let count = bricks.len() as u32;
        let [groups_x, groups_y, groups_z] = row_of_groups(count);
        let head = Head { groups_x, groups_y, groups_z, count };
        let content = [bytemuck::bytes_of(&head), bytemuck::cast_slice(bricks)].concat();
        let buffer = device_buffer(gpu, "brick list", &content)?;
        // What is copied could be any number of groups; what is updated is looked at.
        let mut rec = gpu.recorder("brick list")?;
        rec.update(&buffer, 0, bytemuck::bytes_of(&[groups_x, groups_y, groups_z]))?;
        rec.submit_and_wait()?;
        Ok(Self { buffer })
    }

    /// As a part of an update works on it.
    pub fn items(&self, field: &Field) -> Items<'_> {
        Items { count: &self.buffer, at: Self::COUNT_AT, most: field.brick_count() }
    }

    /// Empties the list, for a kernel that fills it.
    pub fn record_clear(&self, rec: &mut Recorder) -> Result<()> {
        rec.barrier(
            &[Access::IndirectRead, Access::StorageRead],
            &[Access::TransferWrite, Access::StorageWrite],
        );
        rec.update(
            &self.buffer,
            0,
            bytemuck::bytes_of(&Head { groups_x: 0, groups_y: 0, groups_z: 1, count: 0 }),
        )?;
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
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
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
        let params = kernel::BricksParams {
            dims: field.dims,
            mode: which as u32,
            bricks: field.bricks(),
            pad: Default::default(),
        };
        let binds = kernel::MainBindings { opacity, mask, changed_before, growing: &list.buffer };
        let groups = row_of_groups(field.brick_count());
        rec.dispatch(&self.pipeline, &binds, bytemuck::bytes_of(&params), groups)?;
        rec.barrier(
            &[Access::StorageWrite],
            &[Access::IndirectRead, Access::StorageRead, Access::StorageWrite, Access::TransferRead],
        );
        Ok(())
    }
}
