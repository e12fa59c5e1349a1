//! The methods `sat` and `shells`: a summed-area table of V_o, and boxes of it (docs/tables.md).
//!
//! The table is made anew whenever an opacity may have changed; a radius costs only the boxes, unless it leaves other bits. Beside V_o and
//! V_AO it takes 4 bytes a voxel.

use super::boxes::{Bindings, BoxPlan, Boxes};
use super::sums::{Counted, Sums};
use crate::Result;
use crate::ambient::Changed;
use crate::by_brick::{Carved, Gather, Target};
use crate::drive::{Part, Take};
use crate::stages;
use crate::subject::Subject;
use cao_gpu::{Recorder, Stage};
use cao_model::settings::{AntiAliasing, MapSettings, Setup};
use std::sync::{Mutex, PoisonError};

/// Boxes of the listed bricks: of one size, or in shells.
pub struct Summed<const SHELLS: bool> {
    sums: Sums,
    boxes: Boxes,
    plan: BoxPlan,
    /// What the table holds once all that was recorded has run; `None` before the first.
    held: Mutex<Option<Held>>,
}

/// What a table is of, beside values, transfer function and clips: how opacities are counted, and the settings that cut voxels depend on.
type Held = (Counted, AntiAliasing, MapSettings);

fn plan(on: &Subject, setup: &Setup) -> cao_model::Result<BoxPlan> {
    BoxPlan::new(on.field.spacing, &setup.occlusion, setup.options.shells)
}

impl<const SHELLS: bool> Gather for Summed<SHELLS> {
    const NAME: &str = if SHELLS { "shells" } else { "sat" };

    fn new(on: &Subject) -> Result<Self> {
        let plan = plan(on, &on.setup)?;
        let (sums, boxes) = (Sums::new(&on.gpu, &on.field)?, Boxes::new(&on.gpu)?);
        Ok(Self { sums, boxes, plan, held: Mutex::new(None) })
    }

    fn set(&mut self, on: &Subject) -> Result<()> {
        self.plan = plan(on, &on.setup)?;
        Ok(())
    }

    fn accepts(&self, on: &Subject, setup: &Setup) -> Result<()> {
        plan(on, setup)?;
        Ok(())
    }

    fn reach_mm(&self) -> f32 {
        self.plan.reach_mm
    }

    /// The table of boxes.
    fn settings<'a>(&'a self, _: &'a Subject) -> Option<Part<'a>> {
        Some(Part::short(stages::SHELLS, |rec| Ok(self.boxes.record_shells(rec, &self.plan)?)))
    }

    fn prepare<'a>(&'a self, on: &'a Subject, from: Carved<'a>, changed: Changed) -> Vec<Part<'a>> {
        let counted = self.plan.counted;
        let wanted = Some((counted, on.setup.anti_aliasing, on.setup.maps));
        vec![Part::long(stages::SUMS, move |rec| {
            let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
            // A radius alone changes no opacity.
            if *held != wanted || changed.opacities || changed.clips {
                self.sums.record(rec, &on.field, from.opacity, counted)?;
                *held = wanted;
            }
            Ok(())
        })]
    }

    fn stage(&self) -> (Stage, u32) {
        // The first slice is small enough for any device.
        (stages::BOXES, (4e6 / self.plan.brick_reads()).clamp(1.0, 1e6) as u32)
    }

    fn record(&self, rec: &mut Recorder, to: &Target, take: &Take) -> Result<()> {
        let b = Bindings { opacity: to.opacity, table: &self.sums.table, list: to.list, ambient: to.ambient };
        let (field, scope) = (&to.on.field, to.on.setup.scope);
        Ok(self.boxes.record(rec, field, &self.plan, to.on.ambient_mm, scope, b, take)?)
    }
}
