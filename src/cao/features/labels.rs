//! The features that V_AO is computed from: those of the scene as they were when the update began, and which bricks have others now
//! (method.md §5.2).
//!
//! In: `features` (3D r8uint). In and out: `labels` (the same). Out: `change` (f32 a brick: 0 where a feature changed, left alone elsewhere).
//! Cost: two reads a voxel, a write where it changed; only after edits that can change one.

use crate::field::{Field, volume_image};
use crate::host::row_of_groups;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, Format, Gpu, Image, Pipeline, Recorder};
use cao_kernels::labels as kernel;

/// The kernel `labels`, and what it writes.
pub struct Labels {
    pipeline: Pipeline,
    /// Feature of each voxel.
    pub image: Image,
}

impl Labels {
    /// Of a field, none of whose voxels has one. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        let image = volume_image(gpu, "labels", field, Format::R8Uint)?;
        let mut rec = gpu.recorder("clear labels")?;
        rec.discard(&image);
        rec.barrier(&[], &[Access::TransferWrite]);
        rec.clear_image(&image, [0.0; 4])?;
        rec.submit_and_wait()?;
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")?, image })
    }

    /// Takes the features of a scene.
    pub fn record(&self, rec: &mut Recorder, field: &Field, features: &Image, change: &Buffer) -> Result<()> {
        let all = [Access::StorageRead, Access::StorageWrite, Access::SampledRead];
        rec.barrier(&all, &[Access::StorageRead, Access::StorageWrite]);
        let params = kernel::LabelsParams { dims: field.dims, pad: Default::default() };
        let binds = kernel::MainBindings { features, labels: &self.image, change };
        let groups = row_of_groups(field.brick_count());
        rec.dispatch(&self.pipeline, &binds, bytemuck::bytes_of(&params), groups)?;
        rec.barrier(&[Access::StorageRead, Access::StorageWrite], &all);
        Ok(())
    }
}
