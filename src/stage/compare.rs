//! Bitwise comparison of two ambient volumes on every voxel that has a value (CAO §4: "exactly the same").
//!
//! In: `expected`, `actual` (3D r32float), `mask`, `opacity`. Out: [`Difference`]. Cost: up to 56 reads for each voxel of the list.

use super::bricks::BrickList;
use super::field::Field;
use super::lao::Scope;
use crate::Result;
use crate::gpu::{Access, Bind, BufferUse, Gpu, Image, Pipeline, shaders};
use crate::layout_check;
use bytemuck::{Pod, Zeroable};

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    dims: [u32; 3],
    only_needed: u32,
    bricks: [u32; 3],
    pad: u32,
}
layout_check!(Params => shaders::compare::COMPARE_PARAMS { dims, only_needed, bricks });

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Counters {
    compared: u32,
    different: u32,
    largest: u32,
    recomputed: u32,
}
layout_check!(Counters => shaders::compare::DIFFERENCE { compared, different, largest, recomputed });

/// Outcome of a comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// Voxels that have a value.
    pub compared: u64,
    /// Of these, voxels whose 32 bits are not the same, or that are not within 0 … 1.
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
        Ok(Self { pipeline: gpu.compute(&shaders::compare::SHADER, "main")? })
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
        mask: &Image,
        expected: &Image,
        actual: &Image,
    ) -> Result<Difference> {
        let bytes = size_of::<Counters>() as u64;
        let difference = gpu.buffer("difference", bytes, BufferUse::Device)?;
        let read_back = gpu.buffer("difference read-back", bytes, BufferUse::Readback)?;
        let mut rec = gpu.recorder("compare")?;
        rec.fill(&difference, 0, bytes, 0)?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
        let params = Params {
            dims: field.dims,
            only_needed: u32::from(scope == Scope::Needed),
            bricks: field.bricks(),
            pad: 0,
        };
        let binds = [
            ("opacity", Bind::Image(opacity)),
            ("mask", Bind::Image(mask)),
            ("expected", Bind::Image(expected)),
            ("actual", Bind::Image(actual)),
            ("list", Bind::Buffer(&list.buffer)),
            ("difference", Bind::Buffer(&difference)),
        ];
        rec.dispatch_indirect(&self.pipeline, &binds, bytemuck::bytes_of(&params), &list.buffer, 0)?;
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        rec.copy_buffer(&difference, 0, &read_back, 0, bytes)?;
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        rec.submit_and_wait()?;
        let c: Counters = bytemuck::pod_read_unaligned(&read_back.read(0, bytes)?);
        Ok(Difference {
            compared: c.compared.into(),
            different: c.different.into(),
            largest: f32::from_bits(c.largest),
            recomputed: c.recomputed.into(),
        })
    }
}
