//! Which cells of the volumes of means an edit concerns, in tiles as large as bricks: those that a mean of a changed brick went into, level by level.
//!
//! In: `change` of [`crate::clip::carve`], 0 in changed bricks. Out: a list of tiles of each level, two of which are kept. Cost: a read a
//! brick, 64 marks a tile that is concerned. Memory: 12 bytes a tile of 512 cells of the largest level.

use super::level::Means;
use super::plan::{Cells, Plan};
use crate::field::bricks::BrickList;
use crate::host::rows_over;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Pipeline, Recorder};
use cao_kernels::tiles as kernel;

/// What the kernel writes lists of.
pub struct TileLists {
    /// Of the level before and of this one, in turn.
    lists: [BrickList; 2],
    /// Of each tile whether it is listed, u32 each; 0 between levels.
    pub marks: Buffer,
}

impl TileLists {
    /// Memory for the levels of a plan, content undefined. Never uses the device's queue.
    pub fn new(gpu: &Gpu, plan: &Plan) -> Result<Self> {
        let most = plan.cells.iter().map(Cells::tile_count).max().unwrap_or(1);
        let list = || BrickList::with_room(gpu, most);
        let marks = gpu.buffer("marks of tiles", 4 * u64::from(most), BufferUse::Device)?;
        Ok(Self { lists: [list()?, list()?], marks })
    }

    /// Takes all marks away: once before the first edit.
    pub fn record_clear(&self, rec: &mut Recorder) -> Result<()> {
        let used = [Access::StorageRead, Access::StorageWrite];
        rec.barrier(&used, &[Access::TransferWrite]);
        rec.fill(&self.marks, 0, self.marks.bytes(), 0)?;
        rec.barrier(&[Access::TransferWrite], &used);
        Ok(())
    }

    /// The list of a level; that of level 0 is of bricks.
    pub fn of(&self, level: usize) -> &BrickList {
        &self.lists[level % 2]
    }
}

/// The kernel `tiles`.
pub struct Tiles {
    changed: Pipeline,
    mark: Pipeline,
}

impl Tiles {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self { changed: pipeline("changed")?, mark: pipeline("mark")? })
    }

    /// Lists the changed bricks as the tiles of level 0.
    pub fn record_changed(
        &self,
        rec: &mut Recorder,
        plan: &Plan,
        change: &Buffer,
        lists: &TileLists,
    ) -> Result<()> {
        let cells = &plan.cells[0];
        let params = params([cells; 2]);
        let list = lists.of(0);
        list.record_clear(rec)?;
        let binds = kernel::ChangedBindings { change, growing: &list.buffer };
        let groups = rows_over(cells.tile_count(), kernel::CHANGED_WORKGROUP);
        rec.dispatch(&self.changed, &binds, bytemuck::bytes_of(&params), groups)?;
        listed(rec);
        Ok(())
    }

    /// Lists the tiles of a level, 1 or more, from those of the level before; marks are 0 before.
    pub fn record_marks(
        &self,
        rec: &mut Recorder,
        plan: &Plan,
        level: usize,
        lists: &TileLists,
    ) -> Result<()> {
        let params = params([&plan.cells[level - 1], &plan.cells[level]]);
        let (before, now) = (&lists.of(level - 1).buffer, lists.of(level));
        now.record_clear(rec)?;
        let binds = kernel::MarkBindings { list: before, marks: &lists.marks, growing: &now.buffer };
        rec.dispatch_indirect(&self.mark, &binds, bytemuck::bytes_of(&params), before, 0)?;
        listed(rec);
        Ok(())
    }
}

/// Makes a list visible to dispatches over it.
fn listed(rec: &mut Recorder) {
    rec.barrier(
        &[Access::StorageRead, Access::StorageWrite],
        &[Access::IndirectRead, Access::StorageRead, Access::StorageWrite],
    );
}

fn params(cells: [&Cells; 2]) -> kernel::TilesParams {
    let Means { stride, first, second } = Means::of(cells);
    let [before, now] = cells;
    kernel::TilesParams {
        tiles: now.tiles(),
        before: before.tiles(),
        dims: now.dims.map(|n| n as i32),
        stride,
        first,
        second,
        pad: Default::default(),
        pad_1: Default::default(),
        pad_2: Default::default(),
        pad_3: Default::default(),
        pad_4: Default::default(),
        pad_5: Default::default(),
    }
}
