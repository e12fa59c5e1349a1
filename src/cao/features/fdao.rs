//! Feature-driven ambient occlusion by rays by brick (fdAO §4, eq. (5), (6); `cao_twin::features::fdao` has the equations): of each
//! feature the rays of its own opacity, in every voxel of the listed bricks that needs a value, and a rule that makes one of them.
//!
//! In: `opacity` V_o (3D r16unorm), `labels` (3D r8uint), the list of bricks. Out: `ambient` V_AO (3D rgba16unorm), one write a voxel. Cost:
//! the reads of rays by brick, one more of each far cell with opacity, those of 16³ voxels a brick; with more than four features
//! twice that for rules that ask for all of them.

use crate::drive::Take;
use crate::field::Field;
use crate::field::bricks::BrickList;
use crate::rays::rays::RayPlan;
use crate::rays::ruled::Ruled;
use cao_gpu::Result;
use cao_gpu::{Gpu, Image, Recorder};
use cao_kernels::fdao as kernel;
use cao_model::occlusion::Quadrature;
use cao_model::options::Combine;
use cao_model::settings::Scope;

/// Most features whose values can be kept side by side.
pub const CHANNELS: usize = kernel::GROUP as usize;

/// How values of features become a voxel's, for so many features.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rule {
    /// What is asked for, or [`Combine::Max`] where there are more features than [`CHANNELS`] for [`Combine::Sample`].
    pub combine: Combine,
    /// Groups of features.
    groups: u32,
}

impl Rule {
    /// For so many features.
    pub fn new(asked: Combine, features: usize) -> Self {
        let combine = match asked {
            Combine::Sample if features > CHANNELS => Combine::Max,
            other => other,
        };
        Self { combine, groups: features.max(1).div_ceil(CHANNELS) as u32 }
    }
}

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// V_o.
    pub opacity: &'a Image,
    /// Feature of each voxel.
    pub labels: &'a Image,
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
        rule: Rule,
        reference_mm: f32,
        scope: Scope,
        b: Bindings,
        take: &Take,
    ) -> Result<()> {
        let params = kernel::FdaoParams {
            dims: field.dims,
            directions: plan.followed(),
            bricks: field.bricks(),
            cells: plan.cells,
            reach: plan.reach,
            base: take.first(),
            unneeded: u32::from(scope == Scope::All),
            exponent: plan.step_mm / reference_mm,
            shift: plan.shift,
            combine: match rule.combine {
                Combine::Own => kernel::OWN,
                Combine::Neighbours => kernel::NEIGHBOURS,
                Combine::Max => kernel::MOST,
                Combine::Sample => kernel::CHANNELS,
            },
            groups: rule.groups,
            close: u32::from(farthest_filtered(plan) < CLOSE),
            pad: Default::default(),
        };
        let binds = kernel::HybridBindings {
            opacity: b.opacity,
            field: &self.ruled.field,
            directions: &self.ruled.directions,
            cells: &self.ruled.cells,
            list: &b.list.buffer,
            labels: b.labels,
            ambient: b.ambient,
        };
        let push = bytemuck::bytes_of(&params);
        take.dispatch(rec, self.ruled.pipeline(plan), &binds, push, &b.list.buffer)
    }
}

/// Voxels along an axis that a place may be away from its voxel so that what it interpolates is within the kernel's margin; a hundredth is
/// for rounding.
const CLOSE: f32 = kernel::MARGIN as f32 - 0.01;

/// How far along an axis, in voxels, the farthest place is that is interpolated.
fn farthest_filtered(plan: &RayPlan) -> f32 {
    let half_steps = match plan.rule {
        Quadrature::Nearest => return 0.0,
        Quadrature::Linear => 2.0 * plan.cells.max(2) as f32,
        _ => 2.0 * kernel::NEAR as f32,
    };
    let axis = |d: &kernel::Direction| d.half_step.into_iter().fold(0.0, |most: f32, c| most.max(c.abs()));
    plan.directions.iter().map(axis).fold(0.0, f32::max) * (half_steps + 2.0 * plan.shift)
}
