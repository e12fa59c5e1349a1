//! Which bricks an edit concerns (method.md §5.2): `todo(b) ⇔ needed(b) ∧ min_{b' changed} d(b, b') ≤ reach`, with d the
//! distance in mm of the nearest voxels of two bricks, by a separable Euclidean distance transform.
//!
//! In and out: `change` (f32 a brick: squared distance, 0 where changed, [`FAR`] elsewhere; holds [`FAR`] again afterwards).
//! In: `contact` and `past` of [`super::carve`]. In and out: `valued`. Out: `todo` (a u32 a brick: to do or not; anew where there is no
//! value yet or more changed than `past` holds, amended elsewhere; changed itself), what was chosen in all, `chosen`, and `solid`. Cost: a few
//! reads a brick and axis.

use crate::field::Field;
use crate::host::row_of_groups;
use crate::sweep::past::PastBricks;
use bytemuck::{Pod, Zeroable};
use cao_gpu::Result;
use cao_gpu::layout_check;
use cao_gpu::{Access, Bind, Buffer, Gpu, Pipeline, Recorder};
use cao_kernels as shaders;
use cao_model::settings::Scope;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    bricks: [u32; 3],
    axis: u32,
    spacing: [f32; 3],
    reach: f32,
    unneeded: u32,
    anew: u32,
    capacity: u32,
    pad: u32,
}
layout_check!(Params => shaders::near::NEAR_PARAMS {
    bricks, axis, spacing, reach, unneeded, anew, capacity
});

/// In a brick's word: its values are to be computed or amended.
pub const TODO: u32 = 1;
/// In a brick's word: they are to be computed anew.
pub const ANEW: u32 = 2;
/// In a brick's word: the first of eight bits, one for each octant x + 2 y + 4 z, that an opacity in it changed.
pub const CHANGED: u32 = 256;

/// What was chosen, in all.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Chosen {
    /// Bricks to do.
    pub bricks: u32,
    /// Least place x, y, z of the bricks to compute anew, then of those that changed.
    pub low: [u32; 6],
    /// Greatest place of the same.
    pub high: [u32; 6],
}
layout_check!(Chosen => shaders::near::CHOSEN { bricks, low, high });

impl Chosen {
    const NONE: Self = Self { bricks: 0, low: [u32::MAX; 6], high: [0; 6] };
}

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
    /// [`TODO`], [`ANEW`], [`CHANGED`] of each brick, u32 each; the latter are read.
    pub todo: &'a Buffer,
    /// [`Chosen`].
    pub chosen: &'a Buffer,
    /// Where there is opacity, u32 a brick: bit sx + 2 sy + 4 sz for the bricks at (0 … sx, 0 … sy, 0 … sz) from it.
    pub solid: &'a Buffer,
    /// Bricks that have values, u32 each.
    pub valued: &'a Buffer,
    /// What changed.
    pub past: &'a PastBricks,
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

    /// Chooses the bricks and makes the choice visible to compute shaders. `anew`: no value counts any more.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        scope: Scope,
        reach_mm: f32,
        anew: bool,
        b: Bindings,
    ) -> Result<()> {
        let groups = row_of_groups(field.brick_count().div_ceil(64));
        let mut params = Params {
            bricks: field.bricks(),
            axis: 0,
            spacing: field.spacing,
            reach: reach_mm,
            unneeded: u32::from(scope == Scope::All),
            anew: u32::from(anew),
            capacity: b.past.capacity,
            pad: 0,
        };
        let between = [Access::StorageRead, Access::StorageWrite];
        let (mut before, mut after) = (b.change, b.other);
        rec.barrier(&[Access::TransferRead, Access::StorageRead], &[Access::TransferWrite]);
        rec.update(b.chosen, 0, bytemuck::bytes_of(&Chosen::NONE))?;
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
            ("chosen", Bind::Buffer(b.chosen)),
            ("solid", Bind::Buffer(b.solid)),
            ("valued", Bind::Buffer(b.valued)),
            ("changed", Bind::Buffer(&b.past.list.buffer)),
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
