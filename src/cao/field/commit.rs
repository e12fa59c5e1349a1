//! A frame's share of a build that spans frames, and its end (method.md §5.5): how many bricks of the list are left is known to the device
//! alone, so it chooses `min(left, most)` for the slice, and commits the new values in the frame of the last slice, in no other.
//!
//! In: `list`; `made`, the values of the build (V_AO's format). Out: indirect arguments; `shown` V_AO, in the list's bricks or in all. Cost:
//! one invocation a frame; at the end one read and one write a voxel of these bricks.

use crate::field::Field;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Format, Gpu, Image, Pipeline, Recorder};
use cao_kernels::commit as kernel;
use std::mem::offset_of;

const SLICE_AT: u64 = offset_of!(kernel::Turn, slice_x) as u64;
const COMMIT_AT: u64 = offset_of!(kernel::Turn, commit_x) as u64;
// Arguments of a dispatch begin the buffer, for kernels that work on a list.
const _: () = assert!(SLICE_AT == 0);

/// Which bricks of the list are a slice's.
#[derive(Clone, Copy, Debug)]
pub struct Slice {
    /// From this one on.
    pub first: u32,
    /// So many at most.
    pub most: u32,
    /// Whether every brick is new, not only those of the list.
    pub all: bool,
}

/// The kernel `commit`.
pub struct Commit {
    choose: Pipeline,
    halves: Pipeline,
    fours: Pipeline,
    floats: Pipeline,
    /// Indirect arguments: from byte 0 on those of the slice.
    pub turn: Buffer,
}

impl Commit {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self {
            choose: pipeline("choose")?,
            halves: pipeline("halves")?,
            fours: pipeline("fours")?,
            floats: pipeline("floats")?,
            turn: gpu.buffer("turn", size_of::<kernel::Turn>() as u64, BufferUse::Device)?,
        })
    }

    /// Chooses the bricks of a slice, and whether it is the last.
    pub fn record_choice(
        &self,
        rec: &mut Recorder,
        field: &Field,
        list: &Buffer,
        slice: Slice,
    ) -> Result<()> {
        rec.barrier(&[Access::IndirectRead], &[Access::TransferWrite]);
        rec.fill(&self.turn, 0, self.turn.bytes(), 0)?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
        let binds = kernel::ChooseBindings { list, turn: &self.turn };
        rec.dispatch(&self.choose, &binds, bytemuck::bytes_of(&params(field, slice)), [1; 3])?;
        rec.barrier(&[Access::StorageWrite], &[Access::IndirectRead]);
        Ok(())
    }

    /// Shows what was made, if the slice chosen before was the last.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        list: &Buffer,
        slice: Slice,
        made: &Image,
        shown: &Image,
    ) -> Result<()> {
        let params = params(field, slice);
        let push = bytemuck::bytes_of(&params);
        match shown.desc().format {
            Format::R16Unorm => {
                let binds = kernel::HalvesBindings { list, made, half_shown: shown };
                rec.dispatch_indirect(&self.halves, &binds, push, &self.turn, COMMIT_AT)
            }
            Format::Rgba16Unorm => {
                let binds = kernel::FoursBindings { list, made, fours_shown: shown };
                rec.dispatch_indirect(&self.fours, &binds, push, &self.turn, COMMIT_AT)
            }
            _ => {
                let binds = kernel::FloatsBindings { list, made, shown };
                rec.dispatch_indirect(&self.floats, &binds, push, &self.turn, COMMIT_AT)
            }
        }
    }
}

fn params(field: &Field, slice: Slice) -> kernel::CommitParams {
    kernel::CommitParams {
        dims: field.dims,
        first: slice.first,
        most: slice.most,
        all: u32::from(slice.all),
        pad: Default::default(),
    }
}
