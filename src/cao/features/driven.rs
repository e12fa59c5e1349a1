//! The method `fdao`: feature-driven ambient occlusion (fdAO §4) through rays by brick.
//!
//! What V_AO depends on is V_o and the feature of each voxel within reach, so a brick counts as changed where either did. Beside what
//! [`ByBrick`](crate::by_brick::ByBrick) keeps, a byte a voxel of features, six more of V_AO, which has four channels, and two for each
//! feature, its V_o,k. Without features all matter is one, and there is no V_o,k.

use super::fdao::{Bindings, Fdao};
use super::labels::Labels;
use super::mask::{Mask, Masked};
use crate::Result;
use crate::ambient::Changed;
use crate::by_brick::{Carved, Gather, Target};
use crate::drive::{Part, Take};
use crate::rays::rays::RayPlan;
use crate::stages;
use crate::subject::Subject;
use cao_gpu::{Buffer, Format, Recorder, Stage};
use cao_model::options::Combine;
use cao_model::settings::Setup;

/// Rays of features in the listed bricks.
pub struct Driven {
    fdao: Fdao,
    labels: Labels,
    mask: Mask,
    masked: Masked,
    plan: RayPlan,
    combine: Combine,
    /// Of a voxel, in mm.
    diagonal: f32,
}

/// How many features the scene has.
fn features(on: &Subject) -> usize {
    on.features.features.list.len()
}

impl Gather for Driven {
    const NAME: &str = "fdao";
    const FORMAT: Format = Format::Rgba16Unorm;

    fn new(on: &Subject) -> Result<Self> {
        Ok(Self {
            fdao: Fdao::new(&on.gpu)?,
            labels: Labels::new(&on.gpu, &on.field)?,
            mask: Mask::new(&on.gpu, &on.field)?,
            masked: Masked::new(&on.gpu, &on.field, features(on))?,
            plan: RayPlan::new(on.field.spacing, &on.setup.occlusion)?,
            combine: on.setup.options.combine,
            diagonal: on.field.diagonal(),
        })
    }

    fn set(&mut self, on: &Subject) -> Result<()> {
        let plan = RayPlan::new(on.field.spacing, &on.setup.occlusion)?;
        // With other features everything is computed anew, and these are, too.
        if self.masked.images.len() != features(on) {
            self.masked = Masked::new(&on.gpu, &on.field, features(on))?;
        }
        (self.plan, self.combine) = (plan, on.setup.options.combine);
        Ok(())
    }

    fn accepts(&self, on: &Subject, setup: &Setup) -> Result<()> {
        RayPlan::new(on.field.spacing, &setup.occlusion)?;
        Ok(())
    }

    fn reach_mm(&self) -> f32 {
        // Values of neighbours are a diagonal away; a hundredth is for rounding.
        let beside = if self.combine == Combine::Neighbours { 1.01 * self.diagonal } else { 0.0 };
        self.plan.reach_mm + beside
    }

    /// The table of rays.
    fn settings<'a>(&'a self, _: &'a Subject) -> Option<Part<'a>> {
        Some(Part::short(stages::DIRECTIONS, |rec| Ok(self.fdao.record_directions(rec, &self.plan)?)))
    }

    fn changed<'a>(&'a self, on: &'a Subject, change: &'a Buffer) -> Option<Part<'a>> {
        (!self.masked.images.is_empty()).then(|| {
            Part::short(stages::LABELS, move |rec| {
                Ok(self.labels.record(rec, &on.field, &on.features.index, change)?)
            })
        })
    }

    fn prepare<'a>(&'a self, on: &'a Subject, from: Carved<'a>, changed: Changed) -> Vec<Part<'a>> {
        if self.masked.images.is_empty() {
            return Vec::new();
        }
        vec![Part::short(stages::MASK, move |rec| {
            let (labels, Carved { opacity, change }) = (&self.labels.image, from);
            Ok(self.mask.record(rec, &on.field, changed.anew, opacity, labels, change, &self.masked)?)
        })]
    }

    fn stage(&self) -> (Stage, u32) {
        // The first slice is small enough for any device.
        (stages::FDAO, (2e6 / self.plan.brick_samples()).clamp(1.0, 1e6) as u32)
    }

    fn record(&self, rec: &mut Recorder, to: &Target, take: &Take) -> Result<()> {
        let b = Bindings {
            opacity: to.opacity,
            labels: &self.labels.image,
            masked: &self.masked,
            list: to.list,
            ambient: to.ambient,
        };
        let (field, scope) = (&to.on.field, to.on.setup.scope);
        Ok(self.fdao.record(rec, field, &self.plan, self.combine, to.on.ambient_mm, scope, b, take)?)
    }
}
