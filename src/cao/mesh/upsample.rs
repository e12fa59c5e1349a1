//! Occlusion of every pixel from that of one of each block (AOV §3.2): a joint bilateral mean; pixels that no block is like are listed for
//! [`Gather::record_failed`](crate::mesh::gather::Gather::record_failed).
//!
//! In: geometry, sums of blocks. Out: 1 − AO a pixel, and a list of those. Cost: taps² reads of geometry a pixel.

use crate::Result;
use crate::mesh::gather::{Blocks, Scene};
use cao_gpu::{Access, Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::upsample as kernel;

/// Blocks along an edge of the kernel, as the paper's 5×5.
pub const TAPS: u32 = 5;

/// The kernel `upsample`.
pub struct Upsample {
    pipeline: Pipeline,
}

impl Upsample {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// All pixels; `accessibility` holds an f32 each, and −1 of those that `blocks.failures` then lists.
    pub fn record(
        &self,
        rec: &mut Recorder,
        scene: Scene,
        blocks: &Blocks,
        accessibility: &Buffer,
    ) -> Result<()> {
        let geometry = scene.geometry;
        let [width, height] = geometry.size();
        let params = kernel::UpsampleParams {
            size: [width, height],
            blocks: blocks.count,
            step: blocks.step,
            taps: TAPS,
            delta: scene.delta_mm,
            pad: Default::default(),
        };
        let binds = kernel::MainBindings {
            eyes: &geometry.eyes,
            geometry: &geometry.pixels,
            sparse_sums: &blocks.sums,
            accessibility,
            failures: &blocks.failures,
        };
        rec.barrier(&[Access::StorageWrite, Access::TransferRead], &[Access::TransferWrite]);
        rec.update(&blocks.failures, 0, bytemuck::bytes_of(&0u32))?;
        rec.barrier(
            &[Access::TransferWrite, Access::StorageWrite],
            &[Access::StorageRead, Access::StorageWrite],
        );
        let over = [width, height, geometry.views() as u32];
        Ok(rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), over)?)
    }
}
