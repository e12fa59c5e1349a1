//! Bitwise comparison of two ambient volumes on every voxel that has a value (CAO §4: "exactly the same").
//!
//! In: `expected`, `actual` (3D r32float, r16unorm or rgba16unorm), `mask` or `todo`, `opacity`. Out: [`Difference`]. Cost: up to 56 reads for each voxel of the list.

use crate::ambient::Recomputed;
use crate::field::Field;
use crate::field::bricks::BrickList;
use cao_gpu::Result;
use cao_gpu::{Access, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse, Pipeline};
use cao_kernels::compare as kernel;
use cao_model::settings::Scope;

/// Outcome of a comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// Voxels that have a value.
    pub compared: u64,
    /// Of these, voxels whose bits are not the same, or that are not within 0 … 1.
    pub different: u64,
    /// Largest |expected − actual| among those.
    pub largest: f32,
    /// Of the compared, voxels that the contextual update recomputed.
    pub recomputed: u64,
}

/// The kernel `compare`.
pub struct Compare {
    pipeline: Pipeline,
}

impl Compare {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Compares two ambient volumes on the bricks of the list that the full computation worked on. Uses the device's queue and waits for it.
    #[expect(clippy::too_many_arguments, reason = "each is one binding or parameter of the kernel")]
    pub fn run(
        &self,
        gpu: &Gpu,
        field: &Field,
        scope: Scope,
        list: &BrickList,
        opacity: &Image,
        recomputed: Recomputed,
        expected: &Image,
        actual: &Image,
    ) -> Result<Difference> {
        field.countable()?;
        let bytes = size_of::<kernel::Difference>() as u64;
        let difference = gpu.buffer("difference", bytes, BufferUse::Device)?;
        let read_back = gpu.buffer("difference read-back", bytes, BufferUse::Readback)?;
        let mut rec = gpu.recorder("compare")?;
        rec.fill(&difference, 0, bytes, 0)?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
        let params = kernel::CompareParams {
            dims: field.dims,
            only_needed: u32::from(scope == Scope::Needed),
            bricks: field.bricks(),
            by_brick: u32::from(matches!(recomputed, Recomputed::Bricks(_))),
        };
        // What is not read still has to be bound.
        let no_mask = gpu.image(
            "no mask",
            &ImageDesc {
                dims: [1; 3],
                layers: 1,
                format: Format::R8Uint,
                kind: ImageKind::D3,
                usage: ImageUse::SAMPLED,
            },
        )?;
        rec.discard(&no_mask);
        let (mask, todo) = match recomputed {
            Recomputed::Mask(mask) => (mask, &list.buffer),
            Recomputed::Bricks(todo) => (&no_mask, todo),
        };
        let binds = kernel::MainBindings {
            opacity,
            mask,
            expected,
            actual,
            list: &list.buffer,
            difference: &difference,
            todo,
        };
        rec.dispatch_indirect(&self.pipeline, &binds, bytemuck::bytes_of(&params), &list.buffer, 0)?;
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        rec.copy_buffer(&difference, 0, &read_back, 0, bytes)?;
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        rec.submit_and_wait()?;
        let c: kernel::Difference = bytemuck::pod_read_unaligned(&read_back.read(0, bytes)?);
        Ok(Difference {
            compared: c.compared.into(),
            different: c.different.into(),
            largest: f32::from_bits(c.largest),
            recomputed: c.recomputed.into(),
        })
    }
}
