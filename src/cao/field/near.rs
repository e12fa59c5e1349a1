//! Which bricks an edit concerns (method.md §5.2): `todo(b) ⇔ (needed(b) ∨ valued(b)) ∧ ∃ b' changed: near(b, b')`, by a separable distance
//! transform; *valued* are bricks that needed values so far, which hold 1 again where they no longer do. Between the nearest voxels of
//! bricks n > 0 apart along an axis lie `g = 8 (n − 1) + 1` voxels, 0 in the same row. By [`Reach`]:
//!
//! ```text
//! ball    |(g_x, g_y, g_z) · spacing| ≤ reach in mm           box    g_i ≤ reach_i in voxels, each axis for itself
//! ```
//!
//! In and out: `change` (f32 a brick: squared distance, 0 where changed, [`FAR`] elsewhere; holds [`FAR`] again afterwards).
//! In: `contact` of [`crate::clip::carve`]. In and out: `todo` (a u32 a brick: [`TODO`], [`VALUED`]). Out: their `list`. Cost: a few reads a brick and axis.

use crate::field::bricks::BrickList;
use crate::field::{BRICK, Field};
use crate::host::rows_over;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::near as kernel;
use cao_model::settings::Scope;

pub use cao_kernels::shared::todo::{TODO, VALUED};
pub use kernel::FAR;

/// How far a change of opacity can change values: to where, seen from the changed voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reach {
    /// So many mm in every direction: of methods that follow rays.
    Ball(f32),
    /// So many voxels along each axis from a changed brick: of methods that read boxes. The ball around a cube has 2.7 times its volume.
    Box([u32; 3]),
}

impl Reach {
    /// Bricks on each side that it can touch, of as many as there are.
    fn bricks(self, field: &Field) -> [u32; 3] {
        let touched = |i: usize| match self {
            // One for rounding; the kernel measures.
            Self::Ball(mm) => (mm / (BRICK as f32 * field.spacing[i])) as u32 + 2,
            Self::Box(voxels) => voxels[i].div_ceil(BRICK),
        };
        let count = field.bricks();
        std::array::from_fn(|i| touched(i).min(count[i]))
    }
}

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// Squared distance in mm² to the nearest changed brick.
    pub change: &'a Buffer,
    /// As large; for the passes.
    pub other: &'a Buffer,
    /// Where each brick's opacity lies.
    pub contact: &'a Buffer,
    /// [`TODO`] and [`VALUED`] of each brick, u32 each; 0 where V_AO holds 1.
    pub todo: &'a Buffer,
    /// The bricks to do.
    pub list: &'a BrickList,
}

/// The kernel `near`.
pub struct Near {
    spread: Pipeline,
    choose: Pipeline,
}

impl Near {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let shader = &kernel::SHADER;
        Ok(Self { spread: gpu.compute(shader, "spread")?, choose: gpu.compute(shader, "choose")? })
    }

    /// Chooses the bricks and makes the choice visible to indirect dispatches and compute shaders.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        scope: Scope,
        reach: Reach,
        b: Bindings,
    ) -> Result<()> {
        const { assert!(kernel::SPREAD_WORKGROUP[0] == kernel::CHOOSE_WORKGROUP[0]) };
        let groups = rows_over(field.brick_count(), kernel::CHOOSE_WORKGROUP);
        let mut params = kernel::NearParams {
            bricks: field.bricks(),
            axis: 0,
            spacing: if let Reach::Ball(_) = reach { field.spacing } else { [0.0; 3] },
            reach: if let Reach::Ball(mm) = reach { mm } else { 0.0 },
            most: reach.bricks(field),
            unneeded: u32::from(scope == Scope::All),
        };
        let between = [Access::StorageRead, Access::StorageWrite];
        let (mut before, mut after) = (b.change, b.other);
        b.list.record_clear(rec)?;
        for axis in 0..3 {
            params.axis = axis;
            let binds = kernel::SpreadBindings { before, after };
            rec.dispatch(&self.spread, &binds, bytemuck::bytes_of(&params), groups)?;
            rec.barrier(&between, &between);
            (before, after) = (after, before);
        }
        let binds =
            kernel::ChooseBindings { before, contact: b.contact, todo: b.todo, growing: &b.list.buffer };
        rec.dispatch(&self.choose, &binds, bytemuck::bytes_of(&params), groups)?;
        rec.barrier(
            &between,
            &[
                Access::IndirectRead,
                Access::StorageRead,
                Access::StorageWrite,
                Access::TransferRead,
                Access::TransferWrite,
            ],
        );
        rec.fill(b.change, 0, b.change.bytes(), FAR)?;
        rec.barrier(&[Access::TransferWrite], &between);
        Ok(())
    }
}
