//! Feature-driven ambient occlusion by rays by brick (fdAO §4, eq. (5), (6); `cao_twin::features::fdao` has the equations): of each
//! feature the rays of its own opacity, in the voxels of the listed bricks whose value depends on it, and a rule that makes one of them.
//!
//! In: `opacity` V_o (3D r16unorm), `labels` f (3D r8uint), `masked` V_o,k and the bricks that hold it ([`super::mask`]), the list of bricks. In and out:
//! `ambient` V_AO (3D rgba16unorm). Cost: a pass for each feature, in which a voxel that asks for it costs what it costs rays by brick; `own` asks
//! for one feature a voxel, `neighbours` too, also beside the brick, `sample` for those that touch it, `max` for all within reach.

use super::mask::Masked;
use crate::drive::Take;
use crate::field::Field;
use crate::field::bricks::BrickList;
use crate::rays::rays::RayPlan;
use crate::rays::ruled::Ruled;
use cao_gpu::Result;
use cao_gpu::{Access, Gpu, Image, Recorder};
use cao_kernels::fdao as kernel;
use cao_model::options::Combine;
use cao_model::settings::Scope;

/// Most features whose values can be kept side by side; of more [`Combine::Sample`] is [`Combine::Max`].
pub const CHANNELS: usize = kernel::CHANNELS_OF_TEXEL as usize;

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// V_o.
    pub opacity: &'a Image,
    /// Feature of each voxel.
    pub labels: &'a Image,
    /// V_o of each feature; none where all matter is one.
    pub masked: &'a Masked,
    /// Bricks to work on.
    pub list: &'a BrickList,
    /// V_AO.
    pub ambient: &'a Image,
}

/// The kernel `fdao`, one pipeline a rule of rays.
pub struct Fdao {
    ruled: Ruled,
}

impl Fdao {
    /// Builds the pipelines. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { ruled: Ruled::new(gpu, &kernel::SHADER)? })
    }

    /// Writes the directions of a plan; once after each change of the settings.
    pub fn record_directions(&self, rec: &mut Recorder, plan: &RayPlan) -> Result<()> {
        self.ruled.record_directions(rec, plan)
    }

    /// Works on the list, or some of its bricks, along the directions written last. `opacity` is per `reference_mm`.
    #[expect(clippy::too_many_arguments, reason = "settings and bindings of the kernel, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        plan: &RayPlan,
        combine: Combine,
        reference_mm: f32,
        scope: Scope,
        b: Bindings,
        take: &Take,
    ) -> Result<()> {
        let images = &b.masked.images;
        let mut params = kernel::FdaoParams {
            dims: field.dims,
            directions: plan.followed(),
            bricks: field.bricks(),
            cells: plan.cells,
            reach: plan.reach,
            base: take.first(),
            unneeded: u32::from(scope == Scope::All),
            exponent: plan.step_mm / reference_mm,
            shift: plan.shift,
            combine: match combine {
                _ if images.is_empty() => kernel::ALL,
                Combine::Own => kernel::OWN,
                Combine::Neighbours => kernel::NEIGHBOURS,
                Combine::Sample if images.len() <= CHANNELS => kernel::CHANNELS,
                Combine::Sample | Combine::Max => kernel::MOST,
            },
            feature: 0,
            features: images.len() as u32,
            pad: Default::default(),
        };
        let all = std::slice::from_ref(b.opacity);
        for image in if images.is_empty() { all } else { images } {
            if params.feature > 0 {
                let both = [Access::StorageRead, Access::StorageWrite];
                rec.barrier(&both, &both);
            }
            params.feature += 1;
            let binds = kernel::HybridBindings {
                opacity: image,
                field: &self.ruled.field,
                directions: &self.ruled.directions,
                cells: &self.ruled.cells,
                list: &b.list.buffer,
                labels: b.labels,
                ambient: b.ambient,
                matter: b.opacity,
                held: &b.masked.held,
            };
            let push = bytemuck::bytes_of(&params);
            take.dispatch(rec, self.ruled.pipeline(plan), &binds, push, &b.list.buffer)?;
        }
        Ok(())
    }
}
