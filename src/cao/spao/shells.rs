//! The method `spao`: shells of cubes (SPAO).

use super::product::{Bindings, Product};
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

/// The volumes of means, and their product.
pub struct Shells {
    make: MakeLevels,
    product: Product,
    levels: LevelImages,
    lifted: bool,
    reach_mm: f32,
}

fn plan(on: &Subject, setup: &Setup) -> Result<Plan> {
    let (field, options) = (&on.field, &setup.options);
    let radius_mm = setup.occlusion.radius_mm;
    Ok(Plan::new(field.dims, field.spacing, radius_mm, options.levels, options.normal)?)
}

/// From the corner of the box that a value depends on, in mm.
fn reach_mm(on: &Subject, plan: &Plan) -> f32 {
    let reach = plan.reach();
    glam::Vec3::from_array(std::array::from_fn(|i| reach[i] * on.field.spacing[i])).length()
}

impl Gather for Shells {
    const NAME: &str = "spao";

    fn new(on: &Subject) -> Result<Self> {
        let plan = plan(on, &on.setup)?;
        Ok(Self {
            make: MakeLevels::new(&on.gpu)?,
            product: Product::new(&on.gpu)?,
            reach_mm: reach_mm(on, &plan),
            levels: LevelImages::new(&on.gpu, plan)?,
            lifted: on.setup.options.normal > 0.0,
        })
    }

    fn set(&mut self, on: &Subject) -> Result<()> {
        let plan = plan(on, &on.setup)?;
        let reach_mm = reach_mm(on, &plan);
        if plan != self.levels.plan {
            self.levels = LevelImages::new(&on.gpu, plan)?;
        }
        (self.lifted, self.reach_mm) = (on.setup.options.normal > 0.0, reach_mm);
        Ok(())
    }

    fn accepts(&self, on: &Subject, setup: &Setup) -> Result<()> {
        plan(on, setup).map(drop)
    }

    fn reach_mm(&self) -> f32 {
        self.reach_mm
    }

    /// How levels are looked up.
    fn settings<'a>(&'a self, _: &'a Subject) -> Option<Part<'a>> {
        Some(Part::short(stages::TABLE, |rec| Ok(self.make.record_table(rec, &self.levels.plan)?)))
    }

    fn prepare<'a>(&'a self, on: &'a Subject, from: Carved<'a>, _: Changed) -> Vec<Part<'a>> {
        self.make.parts(on.field.min_spacing() / on.ambient_mm, &self.levels, from.opacity)
    }

    fn stage(&self) -> (Stage, u32) {
        // Some thousand look-ups a brick.
        (stages::PRODUCT, 1000)
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
        Ok(self.product.record(rec, field, to.on.ambient_mm, self.lifted, scope, b, take)?)
    }
}
