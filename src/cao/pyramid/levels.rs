//! The volumes of means on the device, and what makes them of V_o: whole, or after an edit the tiles that it concerns.

use super::level::MakeLevel;
use super::plan::{Cells, MOST, Plan};
use super::tiles::{TileLists, Tiles};
use crate::drive::Part;
use crate::field::volume_of;
use crate::stages;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Format, Gpu, Image, Recorder, Sampler, SamplerDesc};
use cao_kernels::shared::levels::{LEVELS, Level};

/// What is the same for every plan.
pub struct MakeLevels {
    make: MakeLevel,
    tiles: Tiles,
    /// Linear, transparent outside.
    pub field: Sampler,
    /// How levels are looked up.
    pub table: Buffer,
}

/// The volumes of one plan.
pub struct LevelImages {
    /// Which they are.
    pub plan: Plan,
    images: Vec<Image>,
    tiles: TileLists,
}

impl LevelImages {
    /// Allocates them, content undefined. Never uses the device's queue.
    pub fn new(gpu: &Gpu, plan: Plan) -> Result<Self> {
        let image =
            |(l, cells): (usize, &Cells)| volume_of(gpu, &format!("level {l}"), cells.dims, Format::R16Unorm);
        let images = plan.cells.iter().enumerate().skip(1).map(image).collect::<Result<_>>()?;
        Ok(Self { tiles: TileLists::new(gpu, &plan)?, plan, images })
    }

    /// Level 1, 2 … for the bindings of a kernel; V_o for those that there are not, which nobody looks up.
    pub fn bound<'a>(&'a self, opacity: &'a Image) -> [&'a Image; MOST as usize] {
        std::array::from_fn(|l| self.images.get(l).unwrap_or(opacity))
    }
}

impl MakeLevels {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let bytes = size_of::<Level>() as u64 * u64::from(LEVELS);
        Ok(Self {
            make: MakeLevel::new(gpu)?,
            tiles: Tiles::new(gpu)?,
            field: gpu.sampler("field", SamplerDesc { linear: true, border_zero: true })?,
            table: gpu.buffer("levels", bytes, BufferUse::Device)?,
        })
    }

    /// Writes how the levels are looked up; once after each change of the settings.
    pub fn record_table(&self, rec: &mut Recorder, plan: &Plan) -> Result<()> {
        rec.barrier(&[Access::StorageRead], &[Access::TransferWrite]);
        rec.update(&self.table, 0, bytemuck::cast_slice(&plan.table()))?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead]);
        Ok(())
    }

    /// Each level from the one before, the first from V_o: the cells that changed bricks go into, those that are 0 in `change`; all cells
    /// without it. `exponent` is the length of a voxel / that of the opacities.
    pub fn parts<'a>(
        &'a self,
        exponent: f32,
        levels: &'a LevelImages,
        opacity: &'a Image,
        change: Option<&'a Buffer>,
    ) -> Vec<Part<'a>> {
        let part = move |l: usize| {
            Part::long(stages::LEVELS[l], move |rec| {
                let (finer, exponent) =
                    if l == 0 { (opacity, exponent) } else { (&levels.images[l - 1], 1.0) };
                let coarser = &levels.images[l];
                let cells = [&levels.plan.cells[l], &levels.plan.cells[l + 1]];
                let tiles = &levels.tiles;
                if let Some(change) = change {
                    if l == 0 {
                        self.tiles.record_changed(rec, &levels.plan, change, tiles)?;
                    }
                    self.tiles.record_marks(rec, &levels.plan, l + 1, tiles)?;
                    let buffers = [&tiles.of(l + 1).buffer, &tiles.marks];
                    self.make.record_listed(rec, cells, exponent, [finer, coarser], buffers)?;
                } else {
                    if l == 0 {
                        tiles.record_clear(rec)?;
                    }
                    // Every cell is written.
                    rec.discard(coarser);
                    self.make.record(rec, cells, exponent, [finer, coarser])?;
                }
                rec.barrier(
                    &[Access::StorageRead, Access::StorageWrite],
                    &[Access::SampledRead, Access::StorageRead, Access::StorageWrite],
                );
                Ok(())
            })
        };
        (0..levels.images.len()).map(part).collect()
    }
}
