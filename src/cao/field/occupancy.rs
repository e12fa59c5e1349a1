//! Which bricks the ray cast may skip: those in which no value between the smallest and the largest of the brick's voxels
//! and their neighbours has opacity. Conservative, so skipping changes no picture.
//!
//! In: `volume`, `transfer`. Out: `occupancy`, one u32 a brick, x fastest. Cost: 1.6 reads a voxel.

use crate::field::Field;
use crate::field::features::FeatureSet;
use crate::field::transfer::TransferBuffer;
use cao_gpu::Result;
use cao_gpu::{Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::occupancy as kernel;

/// The kernel `occupancy`.
pub struct Occupancy {
    pipeline: Pipeline,
}

impl Occupancy {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Marks the bricks that can show something.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        transfer: &TransferBuffer,
        features: &FeatureSet,
        occupancy: &Buffer,
    ) -> Result<()> {
        let params = kernel::OccupancyParams {
            dims: field.dims,
            scale: field.scale,
            bricks: field.bricks(),
            bias: field.bias,
        };
        let binds = kernel::MainBindings {
            volume: &field.volume,
            transfer: &transfer.buffer,
            occupancy,
            features: &features.table,
            feature_index: &features.index,
        };
        let [x, y, z] = field.bricks();
        let groups = [x.div_ceil(kernel::TAKEN), y, z];
        rec.dispatch(&self.pipeline, &binds, bytemuck::bytes_of(&params), groups)
    }
}
