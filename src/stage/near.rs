//! Which bricks an edit concerns (method.md §5.2): `todo(b) ⇔ needed(b) ∧ min_{b' changed} d(b, b') ≤ reach`, with d the
//! distance in mm of the nearest voxels of two bricks, by a separable Euclidean distance transform.
//!
//! In and out: `change` (f32 a brick: squared distance, 0 where changed, [`FAR`] elsewhere; holds [`FAR`] again afterwards).
//! In: `contact` of [`super::carve`]. Out: `todo`, a u32 a brick, and `count`. Cost: a few reads a brick and axis.

use super::field::Field;
use super::lao::Scope;
use super::row_of_groups;
use crate::Result;
use crate::gpu::{Access, Bind, Buffer, Gpu, Pipeline, Recorder, shaders};
use crate::layout_check;
use bytemuck::{Pod, Zeroable};

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    bricks: [u32; 3],
    axis: u32,
    spacing: [f32; 3],
    reach: f32,
    unneeded: u32,
    pad: [u32; 3],
}
layout_check!(Params => shaders::near::NEAR_PARAMS { bricks, axis, spacing, reach, unneeded });

/// Bits of a squared distance that is farther than any volume reaches.
pub const FAR: u32 = 0x7e00_0000;

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// Squared distance in mm² to the nearest changed brick.
    pub change: &'a Buffer,
    /// As large; for the passes.
    pub other: &'a Buffer,
    /// Where each brick's opacity lies.
    pub contact: &'a Buffer,
    /// Bricks to compute, u32 each.
    pub todo: &'a Buffer,
    /// Their number, one u32.
    pub count: &'a Buffer,
}

/// The kernel `near`.
pub struct Near {
    spread: Pipeline,
    choose: Pipeline,
}

impl Near {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let shader = &shaders::near::SHADER;
        Ok(Self { spread: gpu.compute(shader, "spread")?, choose: gpu.compute(shader, "choose")? })
    }

    /// Chooses the bricks and makes the choice visible to compute shaders.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        scope: Scope,
        reach_mm: f32,
        b: Bindings,
    ) -> Result<()> {
        let groups = row_of_groups(field.brick_count().div_ceil(64));
        let mut params = Params {
            bricks: field.bricks(),
            axis: 0,
            spacing: field.spacing,
            reach: reach_mm,
            unneeded: u32::from(scope == Scope::All),
            pad: [0; 3],
        };
        let between = [Access::StorageRead, Access::StorageWrite];
        let (mut before, mut after) = (b.change, b.other);
        rec.barrier(&[Access::TransferRead, Access::StorageRead], &[Access::TransferWrite]);
        rec.fill(b.count, 0, 4, 0)?;
        rec.barrier(&[Access::TransferWrite], &between);
        for axis in 0..3 {
            params.axis = axis;
            let binds = [("before", Bind::Buffer(before)), ("after", Bind::Buffer(after))];
            rec.dispatch(&self.spread, &binds, bytemuck::bytes_of(&params), groups)?;
            rec.barrier(&between, &between);
            (before, after) = (after, before);
        }
        let binds = [
            ("before", Bind::Buffer(before)),
            ("contact", Bind::Buffer(b.contact)),
            ("todo", Bind::Buffer(b.todo)),
            ("count", Bind::Buffer(b.count)),
        ];
        rec.dispatch(&self.choose, &binds, bytemuck::bytes_of(&params), groups)?;
        rec.barrier(
            &between,
            &[Access::StorageRead, Access::StorageWrite, Access::TransferRead, Access::TransferWrite],
        );
        rec.fill(b.change, 0, b.change.bytes(), FAR)?;
        rec.barrier(&[Access::TransferWrite], &between);
        Ok(())
    }
}
