//! Opacities of each feature (fdAO eq. (6)): `V_o,k(x) = V_o(x) where f(x) = k, else 0`, kept from update to update.
//!
//! In: `opacity` V_o (3D r16unorm), `labels` f (3D r8uint), `change` (f32 a brick: 0 where either changed). In and out: a volume V_o,k a feature (3D
//! r16unorm), and whether each brick holds any of it (u32 a brick and feature). Cost: a read a brick; in changed bricks two reads and a write a voxel and
//! feature.

use crate::field::bricks::BrickList;
use crate::field::{Field, volume_image};
use crate::host::rows_over;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Format, Gpu, Image, Pipeline, Recorder};
use cao_kernels::mask as kernel;

/// The volumes of so many features.
pub struct Masked {
    /// V_o,k, k = 1, 2 …
    pub images: Vec<Image>,
    /// Bricks that hold some of it.
    pub held: Buffer,
}

impl Masked {
    /// Allocates them, content undefined. Never uses the device's queue.
    pub fn new(gpu: &Gpu, field: &Field, features: usize) -> Result<Self> {
        let image = |k| volume_image(gpu, &format!("opacity of feature {k}"), field, Format::R16Unorm);
        let bytes = 4 * u64::from(field.brick_count()) * features.max(1) as u64;
        Ok(Self {
            images: (1..=features).map(image).collect::<Result<_>>()?,
            held: gpu.buffer("bricks of features", bytes, BufferUse::Device)?,
        })
    }
}

/// The kernel `mask`.
pub struct Mask {
    list_bricks: Pipeline,
    main: Pipeline,
    list: BrickList,
}

impl Mask {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self {
            list_bricks: pipeline("list_bricks")?,
            main: pipeline("main")?,
            list: BrickList::new(gpu, field)?,
        })
    }

    /// Brings the volumes up to date: every brick if `all`, whatever they held, those that changed otherwise. Visible to all shaders.
    #[expect(clippy::too_many_arguments, reason = "bindings of the kernel, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        all: bool,
        opacity: &Image,
        labels: &Image,
        change: &Buffer,
        masked: &Masked,
    ) -> Result<()> {
        let list = &self.list.buffer;
        let mut params =
            kernel::MaskParams { dims: field.dims, feature: 0, all: u32::from(all), pad: Default::default() };
        self.list.record_clear(rec)?;
        let groups = rows_over(field.brick_count(), kernel::LIST_BRICKS_WORKGROUP);
        let binds = kernel::ListBricksBindings { change, growing: list };
        rec.dispatch(&self.list_bricks, &binds, bytemuck::bytes_of(&params), groups)?;
        rec.barrier(
            &[Access::StorageRead, Access::StorageWrite, Access::SampledRead],
            &[Access::IndirectRead, Access::StorageRead, Access::StorageWrite],
        );
        for (k, image) in (1..).zip(&masked.images) {
            if all {
                // Every texel is written.
                rec.discard(image);
            }
            // One buffer says which bricks hold any.
            rec.barrier(&[Access::StorageWrite], &[Access::StorageWrite]);
            params.feature = k;
            let binds = kernel::MainBindings { opacity, labels, list, held: &masked.held, masked: image };
            rec.dispatch_indirect(&self.main, &binds, bytemuck::bytes_of(&params), list, 0)?;
        }
        rec.barrier(&[Access::StorageWrite], &[Access::SampledRead, Access::StorageRead]);
        Ok(())
    }
}
