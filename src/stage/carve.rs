//! Opacity after transfer function and clips, in place, and which bricks changed (method.md §5.2, §6):
//! `V_o(x) = C_visible/(N+9) · TF_o(V(x))` (CAO eq. (5)), stored to 1/65535.
//!
//! In: `volume`, `transfer`, the clips, the words of [`super::clip_bricks`] now and at the last edit, `occupancy`. In and out:
//! `opacity` V_o (3D r16unorm), `contact` (where each brick's opacity lies, 27 bits). Out: `change` (f32 a brick: 0 where an
//! opacity changed, left alone elsewhere). Cost: nothing for bricks that no edit can have changed; two reads and a transfer function a
//! voxel in the others, clip samples only where a clip's surface passes.

use super::bricks::BrickList;
use super::classify::{AntiAliasing, Classify};
use super::clips::ClipSet;
use super::field::Field;
use super::row_of_groups;
use super::transfer::TransferBuffer;
use crate::Result;
use crate::gpu::{Access, Bind, Buffer, Gpu, Image, Pipeline, Recorder, shaders};
use crate::layout_check;
use bytemuck::{Pod, Zeroable};

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    dims: [u32; 3],
    extra_samples: u32,
    spacing: [f32; 3],
    all: u32,
    levels: f32,
    slope: f32,
    bias: f32,
    pad: u32,
}
layout_check!(Params => shaders::carve::CARVE_PARAMS { dims, extra_samples, spacing, all, levels, slope, bias });

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// Opacity and colour.
    pub transfer: &'a TransferBuffer,
    /// The clips.
    pub clips: &'a ClipSet,
    /// What they do to whole bricks.
    pub clip_bricks: &'a Buffer,
    /// The same at the last call.
    pub clip_bricks_before: &'a Buffer,
    /// Bricks that can have opacity.
    pub occupancy: &'a Buffer,
    /// Where each brick's opacity lies.
    pub contact: &'a Buffer,
    /// Squared distance to the nearest changed brick.
    pub change: &'a Buffer,
    /// Bricks to work on; filled here.
    pub list: &'a BrickList,
    /// V_o.
    pub opacity: &'a Image,
}

/// The kernel `carve`.
pub struct Carve {
    choose: Pipeline,
    carve: Pipeline,
}

impl Carve {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let shader = &shaders::carve::SHADER;
        Ok(Self { choose: gpu.compute(shader, "list_bricks")?, carve: gpu.compute(shader, "main")? })
    }

    /// Brings V_o up to date: every brick if `all`, those that clips can have changed otherwise. `positions` are those of
    /// [`Classify`].
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        samples: AntiAliasing,
        all: bool,
        classify: &Classify,
        b: Bindings,
    ) -> Result<()> {
        let Field { dims, spacing, levels, bias, .. } = *field;
        let slope = field.scale / levels;
        let params = Params {
            dims,
            extra_samples: samples as u32,
            spacing,
            all: u32::from(all),
            levels,
            slope,
            bias,
            pad: 0,
        };
        let params = bytemuck::bytes_of(&params);
        b.list.record_clear(rec)?;
        let binds = [
            ("clip_bricks", Bind::Buffer(b.clip_bricks)),
            ("clip_bricks_before", Bind::Buffer(b.clip_bricks_before)),
            ("occupancy", Bind::Buffer(b.occupancy)),
            ("contact", Bind::Buffer(b.contact)),
            ("growing", Bind::Buffer(&b.list.buffer)),
        ];
        rec.dispatch(&self.choose, &binds, params, row_of_groups(field.brick_count().div_ceil(64)))?;
        rec.barrier(
            &[Access::StorageRead, Access::StorageWrite],
            &[Access::IndirectRead, Access::StorageRead, Access::StorageWrite],
        );
        let binds = [
            ("volume", Bind::Image(&field.volume)),
            ("transfer", Bind::Buffer(&b.transfer.buffer)),
            ("clips", Bind::Buffer(&b.clips.clips)),
            ("layers", Bind::Buffer(&b.clips.layers)),
            ("positions", Bind::Buffer(&classify.positions)),
            ("clip_bricks", Bind::Buffer(b.clip_bricks)),
            ("contact", Bind::Buffer(b.contact)),
            ("change", Bind::Buffer(b.change)),
            ("list", Bind::Buffer(&b.list.buffer)),
            ("opacity", Bind::Image(b.opacity)),
        ];
        rec.dispatch_indirect(&self.carve, &binds, params, &b.list.buffer, 0)
    }
}
