//! The method `rays`: rays by brick (method.md §4).

use super::rays::{Bindings, RayPlan, Rays};
use crate::Result;
use crate::by_brick::{Gather, Target};
use crate::drive::{Part, Take};
use crate::field::near::Reach;
use crate::stages;
use crate::subject::Subject;
use cao_gpu::{Format, Recorder, Stage};
use cao_model::settings::Setup;

/// Rays of the listed bricks.
pub struct Traced {
    rays: Rays,
    plan: RayPlan,
}

impl Gather for Traced {
    const NAME: &str = "rays";

    fn format(on: &Subject) -> Format {
        if on.coloured() { Format::Rgba16Unorm } else { Format::R16Unorm }
    }

    fn new(on: &Subject) -> Result<Self> {
        let plan = RayPlan::new(on.field.spacing, &on.setup.occlusion)?;
        let rays = if on.coloured() { Rays::coloured(&on.gpu)? } else { Rays::new(&on.gpu)? };
        Ok(Self { rays, plan })
    }

    fn set(&mut self, on: &Subject) -> Result<()> {
        self.plan = RayPlan::new(on.field.spacing, &on.setup.occlusion)?;
        Ok(())
    }

    fn accepts(&self, on: &Subject, setup: &Setup) -> Result<()> {
        RayPlan::new(on.field.spacing, &setup.occlusion)?;
        Ok(())
    }

    fn reach(&self) -> Reach {
        Reach::Ball(self.plan.reach_mm)
    }

    /// The table of rays.
    fn settings<'a>(&'a self, _: &'a Subject) -> Option<Part<'a>> {
        Some(Part::short(stages::DIRECTIONS, |rec| Ok(self.rays.record_directions(rec, &self.plan)?)))
    }

    fn stage(&self) -> (Stage, u32) {
        // The first slice is small enough for any device.
        (stages::RAYS, (4e6 / self.plan.brick_samples()).clamp(1.0, 1e6) as u32)
    }

    fn record(&self, rec: &mut Recorder, to: &Target, take: &Take) -> Result<()> {
        let b = Bindings { opacity: to.opacity, list: to.list, ambient: to.ambient };
        let (field, scope) = (&to.on.field, to.on.setup.scope);
        Ok(self.rays.record(rec, field, &self.plan, to.on.ambient_mm, scope, b, take)?)
    }
}
