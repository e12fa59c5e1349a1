//! The method `vicinity` (docs/vicinity.md).

use super::vicinity::{Bindings, LinePlan, Vicinity};
use crate::Result;
use crate::by_brick::{Gather, Target};
use crate::drive::{Part, Take};
use crate::field::near::Reach;
use crate::stages;
use crate::subject::Subject;
use cao_gpu::{Recorder, Stage};
use cao_model::settings::Setup;

/// Lines of the listed bricks.
pub struct Shaded {
    vicinity: Vicinity,
    plan: LinePlan,
}

impl Gather for Shaded {
    const NAME: &str = "vicinity";

    fn new(on: &Subject) -> Result<Self> {
        let plan = LinePlan::new(on.field.spacing, &on.setup.occlusion)?;
        Ok(Self { vicinity: Vicinity::new(&on.gpu)?, plan })
    }

    fn set(&mut self, on: &Subject) -> Result<()> {
        self.plan = LinePlan::new(on.field.spacing, &on.setup.occlusion)?;
        Ok(())
    }

    fn accepts(&self, on: &Subject, setup: &Setup) -> Result<()> {
        LinePlan::new(on.field.spacing, &setup.occlusion)?;
        Ok(())
    }

    fn reach(&self) -> Reach {
        Reach::Ball(self.plan.reach_mm)
    }

    /// The table of lines.
    fn settings<'a>(&'a self, _: &'a Subject) -> Option<Part<'a>> {
        Some(Part::short(stages::DIRECTIONS, |rec| Ok(self.vicinity.record_directions(rec, &self.plan)?)))
    }

    fn stage(&self) -> (Stage, u32) {
        // The first slice is small enough for any device.
        (stages::LINES, (4e6 / self.plan.brick_reads()).clamp(1.0, 1e6) as u32)
    }

    fn record(&self, rec: &mut Recorder, to: &Target, take: &Take) -> Result<()> {
        let b = Bindings { opacity: to.opacity, list: to.list, ambient: to.ambient };
        let (field, scope) = (&to.on.field, to.on.setup.scope);
        Ok(self.vicinity.record(rec, field, &self.plan, to.on.ambient_mm, scope, b, take)?)
    }
}
