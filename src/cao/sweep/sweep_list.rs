//! Compaction for the line sweep (method.md §4, sparse sweeps): for each direction and tile of lines, the runs of chunks
//! in which some voxel's brick is to do, each followed by those in which these voxels' rays backwards are found; each
//! direction's run count is the argument of its indirect dispatch.
//!
//! In: `todo` (a u32 a brick). Out: `list`. Cost: a few reads a brick and direction.

use crate::field::{BRICK, Field};
use crate::host::{device_buffer, same_layout};
use crate::sweep::sweep::SweepPlan;
use bytemuck::Zeroable;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Pipeline, Recorder};
use cao_kernels::shared::sweep::{Run, SweepHead, SweepList as Heads};
use cao_kernels::shared::todo::OCTANT;
use cao_kernels::sweep_list as kernel;

same_layout!(kernel::Chosen, super::near::Chosen { bricks, low, high });
same_layout!(kernel::CountedHead, SweepHead { groups_x, groups_y, groups_z, count, at });
same_layout!(kernel::CountedList, Heads { head });
const _: () = assert!(kernel::CountedList::RUNS_AT == Heads::RUNS_AT);

/// Bytes of the head of one direction, which are first in the list; each begins with the arguments of an indirect dispatch.
pub const HEAD_BYTES: u64 = size_of::<SweepHead>() as u64;

/// Device memory of the list of one plan.
pub struct SweepLists {
    /// Heads, then runs.
    pub list: Buffer,
    directions: Buffer,
    heads: Heads,
    /// Most tiles of a direction.
    tiles: u32,
}

impl SweepLists {
    /// Memory for every run that a plan can have. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, plan: &SweepPlan) -> Result<Self> {
        let mut heads = Heads::zeroed();
        heads.head.iter_mut().for_each(|head| head.groups_z = 1);
        let mut at = 0;
        let mut directions = Vec::new();
        for (head, walk) in heads.head.iter_mut().zip(&plan.walks) {
            head.at = at;
            at += walk.runs;
            directions.push(kernel::Direction {
                step: walk.ray.step,
                axis: walk.axis as u32,
                tiles: walk.tiles,
                count: walk.tile_count(),
                window: walk.window,
                beside: u32::from(walk.pieces > 1),
                pad: Default::default(),
            });
        }
        directions.resize(directions.len().max(1), kernel::Direction::zeroed());
        let bytes = Heads::RUNS_AT + size_of::<Run>() as u64 * u64::from(at.max(1));
        Ok(Self {
            list: gpu.buffer("sweep list", bytes, BufferUse::Device)?,
            directions: device_buffer(gpu, "sweep directions", bytemuck::cast_slice(&directions))?,
            heads,
            tiles: plan.walks.iter().map(super::sweep::Walk::tile_count).max().unwrap_or(0),
        })
    }
}

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// What is to be done in each brick.
    pub todo: &'a Buffer,
    /// Where there is something to be done at all.
    pub chosen: &'a Buffer,
    /// The runs; filled here.
    pub lists: &'a SweepLists,
}

/// The kernel `sweep_list`.
pub struct SweepList {
    pipeline: Pipeline,
}

impl SweepList {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Fills the list, with the rays that meet a change or else with those of bricks to compute anew, and makes it visible to indirect dispatches and compute shaders.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        plan: &SweepPlan,
        amend: bool,
        b: Bindings,
    ) -> Result<()> {
        rec.barrier(
            &[Access::IndirectRead, Access::StorageRead],
            &[Access::TransferWrite, Access::StorageWrite],
        );
        rec.update(&b.lists.list, 0, bytemuck::bytes_of(&b.lists.heads))?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
        let directions = plan.walks.len() as u32;
        let params = kernel::ListParams {
            dims: field.dims,
            amend: u32::from(amend),
            bricks: field.bricks(),
            cell: if amend { OCTANT } else { BRICK } as i32,
        };
        let binds = kernel::MainBindings {
            directions: &b.lists.directions,
            todo: b.todo,
            list: &b.lists.list,
            chosen: b.chosen,
        };
        rec.dispatch_over(
            &self.pipeline,
            &binds,
            bytemuck::bytes_of(&params),
            [b.lists.tiles, directions, 1],
        )?;
        rec.barrier(
            &[Access::StorageWrite],
            &[Access::IndirectRead, Access::StorageRead, Access::StorageWrite, Access::TransferRead],
        );
        Ok(())
    }
}
