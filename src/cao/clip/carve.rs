//! Opacity after transfer function and clips, in place, and which bricks changed (method.md §5.2, §6):
//! `V_o(x) = C_visible/(N+9) · TF_o(V(x))` (CAO eq. (5)), stored to 1/65535; of a voxel whose feature clips leave
//! whole, `V_o(x) = TF_o(V(x))`.
//!
//! In: `volume`, `transfer`, features, the clips, the words of [`super::clip_bricks`] now and at the last edit, `occupancy`. In and out:
//! `opacity` V_o (3D r16unorm), `contact` (where each brick's opacity lies, 27 bits). Out: `change` (f32 a brick: 0 where an
//! opacity changed, left alone elsewhere). Cost: nothing for bricks that no edit can have changed; two reads and a transfer function a
//! voxel in the others, clip samples only where a clip's surface passes.

use crate::clip::clips::ClipSet;
use crate::clip::positions;
use crate::clip::solid::Solids;
use crate::field::Field;
use crate::field::bricks::BrickList;
use crate::field::features::FeatureSet;
use crate::field::transfer::TransferBuffer;
use crate::host::rows_over;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, Gpu, Image, Pipeline, Recorder};
use cao_kernels::carve as kernel;
use cao_model::settings::AntiAliasing;

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// Opacity and colour.
    pub transfer: &'a TransferBuffer,
    /// Which voxels clips leave whole.
    pub features: &'a FeatureSet,
    /// The clips.
    pub clips: &'a ClipSet,
    /// What they do to whole bricks.
    pub clip_bricks: &'a Buffer,
    /// The same at the last call.
    pub clip_bricks_before: &'a Buffer,
    /// What fills opacity beside.
    pub solids: &'a Solids,
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
    positions: Buffer,
}

impl Carve {
    /// Builds the pipelines and the table of sample positions. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let shader = &kernel::SHADER;
        Ok(Self {
            choose: gpu.compute(shader, "list_bricks")?,
            carve: gpu.compute(shader, "main")?,
            positions: positions::buffer(gpu)?,
        })
    }

    /// Brings V_o up to date: every brick if `all`, those that clips can have changed otherwise.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        samples: AntiAliasing,
        all: bool,
        b: Bindings,
    ) -> Result<()> {
        let Field { dims, spacing, levels, bias, .. } = *field;
        let slope = field.scale / levels;
        let params = kernel::CarveParams {
            dims,
            spacing,
            all: u32::from(all),
            levels,
            slope,
            bias,
            solids: u32::from(b.solids.any),
            solids_spared: u32::from(b.solids.spared),
            sampling: positions::sampling(samples),
            pad: Default::default(),
        };
        let params = bytemuck::bytes_of(&params);
        b.list.record_clear(rec)?;
        let binds = kernel::ListBricksBindings {
            clip_bricks: b.clip_bricks,
            clip_bricks_before: b.clip_bricks_before,
            occupancy: b.occupancy,
            contact: b.contact,
            solid_bricks: &b.solids.bricks,
            growing: &b.list.buffer,
        };
        let groups = rows_over(field.brick_count(), kernel::LIST_BRICKS_WORKGROUP);
        rec.dispatch(&self.choose, &binds, params, groups)?;
        rec.barrier(
            &[Access::StorageRead, Access::StorageWrite],
            &[Access::IndirectRead, Access::StorageRead, Access::StorageWrite],
        );
        let binds = kernel::MainBindings {
            volume: &field.volume,
            transfer: &b.transfer.buffer,
            features: &b.features.table,
            feature_index: &b.features.index,
            clips: &b.clips.clips,
            layers: &b.clips.layers,
            positions: &self.positions,
            clip_bricks: b.clip_bricks,
            contact: b.contact,
            change: b.change,
            list: &b.list.buffer,
            solid: &b.solids.solid,
            opacity: b.opacity,
        };
        rec.dispatch_indirect(&self.carve, &binds, params, &b.list.buffer, 0)
    }
}
