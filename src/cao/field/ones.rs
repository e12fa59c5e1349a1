//! An ambient volume in which nothing is occluded: 1 in every voxel. On an H200 it takes 0.3 ms at 512³, where the command that clears
//! images takes 8.5 (docs/drivers.md).
//!
//! Out: a volume of V_AO's format, one write a voxel.

use crate::host::row_of_groups;
use cao_gpu::Result;
use cao_gpu::{Format, Gpu, Image, Pipeline, Recorder};
use cao_kernels::ones as kernel;
use cao_kernels::shared::bricks::BRICK;

/// The kernel `ones`.
pub struct Ones {
    halves: Pipeline,
    floats: Pipeline,
    fours: Pipeline,
}

impl Ones {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self { halves: pipeline("halves")?, floats: pipeline("floats")?, fours: pipeline("fours")? })
    }

    /// Fills a volume, r16unorm, r32float, or rgba16unorm where the device stores it.
    pub fn record(&self, rec: &mut Recorder, volume: &Image) -> Result<()> {
        let dims = volume.desc().dims;
        let params = kernel::OnesParams { dims, pad: Default::default() };
        let push = bytemuck::bytes_of(&params);
        let groups = row_of_groups(dims.map(|d| d.div_ceil(BRICK)).iter().product());
        match volume.desc().format {
            Format::R16Unorm => {
                rec.dispatch(&self.halves, &kernel::HalvesBindings { halves_out: volume }, push, groups)
            }
            Format::Rgba16Unorm => {
                rec.dispatch(&self.fours, &kernel::FoursBindings { fours_out: volume }, push, groups)
            }
            _ => rec.dispatch(&self.floats, &kernel::FloatsBindings { floats_out: volume }, push, groups),
        }
    }
}
