//! Compaction for the line sweep (method.md §4, sparse sweeps): for each direction and tile of 8×8 lines, the runs of chunks
//! in which some voxel's brick is to do, each followed by those in which these voxels' rays backwards are found; each
//! direction's run count is the argument of its indirect dispatch.
//!
//! In: `todo` (a u32 a brick). Out: `list`. Cost: a few reads a brick and direction.

use crate::field::Field;
use crate::host::device_buffer;
use crate::sweep::sweep::SweepPlan;
use bytemuck::{Pod, Zeroable};
use cao_gpu::Result;
use cao_gpu::layout_check;
use cao_gpu::{Access, Bind, Buffer, BufferUse, Gpu, Pipeline, Recorder};
use cao_kernels as shaders;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    dims: [u32; 3],
    amend: u32,
    bricks: [u32; 3],
    cell: i32,
}
layout_check!(Params => shaders::sweep_list::LIST_PARAMS { dims, amend, bricks, cell });

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Direction {
    step: [i32; 3],
    axis: u32,
    tiles: [u32; 2],
    count: u32,
    window: u32,
    beside: u32,
    pad: [u32; 3],
}
layout_check!(Direction => shaders::sweep_list::DIRECTION { step, axis, tiles, count, window, beside });

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Head {
    groups_x: u32,
    groups_y: u32,
    groups_z: u32,
    count: u32,
    at: u32,
}
layout_check!(Head => shaders::sweep_list::COUNTED_HEAD { groups_x, groups_y, groups_z, count, at });
layout_check!(super::near::Chosen => shaders::sweep_list::CHOSEN { bricks, low, high });
layout_check!(Head => shaders::sweep::SWEEP_HEAD { groups_x, groups_y, groups_z, count, at });

/// Bytes of the head of one direction, which are first in the list; each begins with the arguments of an indirect dispatch.
pub const HEAD_BYTES: u64 = size_of::<Head>() as u64;
/// Heads in a list.
const HEADS: usize = 54;
/// Bytes of a run: tile, first chunk, chunks.
const RUN_BYTES: u64 = 12;

/// Device memory of the list of one plan.
pub struct SweepLists {
    /// Heads, then runs.
    pub list: Buffer,
    directions: Buffer,
    heads: [Head; HEADS],
    /// Most tiles of a direction.
    tiles: u32,
}

impl SweepLists {
    /// Memory for every run that a plan can have. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, plan: &SweepPlan) -> Result<Self> {
        let mut heads = [Head { groups_x: 0, groups_y: 0, groups_z: 1, count: 0, at: 0 }; HEADS];
        let mut at = 0;
        let mut directions = Vec::new();
        for (head, walk) in heads.iter_mut().zip(&plan.walks) {
            head.at = at;
            at += walk.runs;
            directions.push(Direction {
                step: walk.ray.step,
                axis: walk.axis as u32,
                tiles: walk.tiles,
                count: walk.tile_count(),
                window: walk.window,
                beside: u32::from(walk.pieces > 1),
                pad: [0; 3],
            });
        }
        directions.resize(directions.len().max(1), Direction::zeroed());
        let bytes = HEAD_BYTES * HEADS as u64 + RUN_BYTES * u64::from(at.max(1));
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
        Ok(Self { pipeline: gpu.compute(&shaders::sweep_list::SHADER, "main")? })
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
        let params = Params {
            dims: field.dims,
            amend: u32::from(amend),
            bricks: field.bricks(),
            cell: if amend { 4 } else { 8 },
        };
        let binds = [
            ("directions", Bind::Buffer(&b.lists.directions)),
            ("todo", Bind::Buffer(b.todo)),
            ("list", Bind::Buffer(&b.lists.list)),
            ("chosen", Bind::Buffer(b.chosen)),
        ];
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
