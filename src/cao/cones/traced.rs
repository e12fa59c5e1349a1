//! The method `cones`: cone tracing over mip levels.

use super::cone::{Bindings, ConePlan, ConeTracing};
use crate::Result;
use crate::ambient::Changed;
use crate::by_brick::{Carved, Gather, Target};
use crate::drive::{Part, Take};
use crate::pyramid::levels::{LevelImages, MakeLevels};
use crate::pyramid::plan::Plan;
use crate::stages;
use crate::subject::Subject;
use cao_gpu::{Recorder, Stage};
use cao_model::settings::Setup;

/// Mip levels, and cones through them.
pub struct Cones {
    make: MakeLevels,
    cones: ConeTracing,
    plan: ConePlan,
    levels: LevelImages,
}

fn plans(on: &Subject, setup: &Setup) -> Result<(ConePlan, Plan)> {
    Ok(ConePlan::new(on.field.dims, on.field.spacing, &setup.occlusion)?)
}

impl Gather for Cones {
    const NAME: &str = "cones";

    fn new(on: &Subject) -> Result<Self> {
        let (plan, levels) = plans(on, &on.setup)?;
        Ok(Self {
            make: MakeLevels::new(&on.gpu)?,
            cones: ConeTracing::new(&on.gpu)?,
            plan,
            levels: LevelImages::new(&on.gpu, levels)?,
        })
    }

    fn set(&mut self, on: &Subject) -> Result<()> {
        let (plan, levels) = plans(on, &on.setup)?;
        if levels != self.levels.plan {
            self.levels = LevelImages::new(&on.gpu, levels)?;
        }
        self.plan = plan;
        Ok(())
    }

    fn accepts(&self, on: &Subject, setup: &Setup) -> Result<()> {
        plans(on, setup).map(drop)
    }

    fn reach_mm(&self) -> f32 {
        self.plan.reach_mm
    }

    /// The cones, and how levels are looked up.
    fn settings<'a>(&'a self, _: &'a Subject) -> Option<Part<'a>> {
        Some(Part::short(stages::TABLE, |rec| {
            self.make.record_table(rec, &self.levels.plan)?;
            Ok(self.cones.record_cones(rec, &self.plan)?)
        }))
    }

    fn prepare<'a>(&'a self, on: &'a Subject, from: Carved<'a>, _: Changed) -> Vec<Part<'a>> {
        self.make.parts(on.field.min_spacing() / on.ambient_mm, &self.levels, from.opacity)
    }

    fn stage(&self) -> (Stage, u32) {
        // Ten steps a cone; the first slice is small enough for any device.
        (stages::CONES, (1000 / self.plan.cones.len().max(1)).max(1) as u32)
    }

    fn record(&self, rec: &mut Recorder, to: &Target, take: &Take) -> Result<()> {
        let b = Bindings {
            opacity: to.opacity,
            make: &self.make,
            levels: &self.levels,
            list: to.list,
            ambient: to.ambient,
        };
        let (field, scope) = (&to.on.field, to.on.setup.scope);
        Ok(self.cones.record(rec, field, &self.plan, to.on.ambient_mm, scope, b, take)?)
    }
}
