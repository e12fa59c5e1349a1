//! The method `histograms` (docs/histograms.md): what depends on values alone is made once for them, then an edit of the transfer function
//! costs one pass over the clusters and one over the voxels.
//!
//! Clips change no value, only which voxels need one: a neighbourhood is that of the unclipped volume. Beside V_o and V_AO it takes 3 bytes
//! a voxel, and 18 MiB for samples and clusters.

use super::clusters::{Clusters, ROUNDS};
use super::expand::{Bindings, Expand, Scene};
use super::histogram::{Histogram, HistogramPlan, MOST_FINE};
use crate::Result;
use crate::ambient::Changed;
use crate::by_brick::{Carved, Gather, Target};
use crate::drive::{Part, Take};
use crate::stages;
use crate::subject::Subject;
use cao_gpu::{Recorder, Stage};
use cao_model::settings::Setup;
use std::sync::{Mutex, PoisonError};

/// Clusters of the listed bricks.
pub struct Clustered {
    histogram: Histogram,
    clusters: Clusters,
    expand: Expand,
    plan: HistogramPlan,
    /// Of a voxel, mm.
    diagonal: f32,
    /// What the clusters are of once all that was recorded has run: which values, and which histograms of them; `None` before the first.
    held: Mutex<Option<(u64, HistogramPlan)>>,
}

fn block(on: &Subject) -> u32 {
    let voxels: u64 = on.field.dims.iter().map(|d| u64::from(*d)).product();
    if voxels > MOST_FINE { 2 } else { 1 }
}

fn plan(on: &Subject, setup: &Setup) -> HistogramPlan {
    let (field, radius_mm) = (&on.field, setup.occlusion.radius_mm);
    HistogramPlan::new(field.dims, field.spacing, radius_mm, setup.options.clusters, block(on))
}

impl Clustered {
    fn scene<'a>(&'a self, on: &'a Subject) -> Scene<'a> {
        Scene { plan: &self.plan, reference_mm: on.ambient_mm, scope: on.setup.scope }
    }

    /// Whether the clusters are of something else.
    fn outdated(&self, on: &Subject, changed: Changed) -> bool {
        let held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        changed == Changed::ALL
            || !matches!(&*held, Some((of, plan)) if *of == on.values && *plan == self.plan)
    }
}

impl Gather for Clustered {
    const NAME: &str = "histograms";
    const OF_VALUES: bool = true;

    fn new(on: &Subject) -> Result<Self> {
        Ok(Self {
            histogram: Histogram::new(&on.gpu, &on.field, block(on))?,
            clusters: Clusters::new(&on.gpu)?,
            expand: Expand::new(&on.gpu)?,
            plan: plan(on, &on.setup),
            diagonal: on.field.diagonal(),
            held: Mutex::new(None),
        })
    }

    fn set(&mut self, on: &Subject) -> Result<()> {
        self.plan = plan(on, &on.setup);
        Ok(())
    }

    fn accepts(&self, _: &Subject, _: &Setup) -> Result<()> {
        Ok(())
    }

    /// Opacities say only which voxels need a value: those beside them.
    fn reach_mm(&self) -> f32 {
        1.01 * self.diagonal
    }

    fn prepare<'a>(&'a self, on: &'a Subject, _: Carved<'a>, changed: Changed) -> Vec<Part<'a>> {
        let (histogram, clusters, field) = (&self.histogram, &self.clusters, &on.field);
        let sampled = &histogram.sampled;
        let mut parts = vec![Part::long(stages::HISTOGRAMS, move |rec| {
            if self.outdated(on, changed) {
                histogram.record_samples(rec, field, &self.plan)?;
                clusters.record_seed(rec, &self.plan, sampled)?;
            }
            Ok(())
        })];
        parts.extend((0..ROUNDS).map(|round| {
            Part::long(stages::CLUSTERS, move |rec| {
                if self.outdated(on, changed) {
                    clusters.record_round(rec, &self.plan, sampled, round)?;
                }
                Ok(())
            })
        }));
        parts.extend((0..self.plan.slab_count()).map(|slab| {
            Part::long(stages::ASSIGN, move |rec| {
                if self.outdated(on, changed) {
                    histogram.record_slab(rec, field, &self.plan, &clusters.centres, slab)?;
                }
                Ok(())
            })
        }));
        parts.push(Part::short(stages::SHADE, move |rec| {
            *self.held.lock().unwrap_or_else(PoisonError::into_inner) = Some((on.values, self.plan.clone()));
            let buffers = [&histogram.extent_of, &clusters.centres, &on.transfer_buffer.buffer];
            Ok(self.expand.record_shade(rec, field, self.scene(on), buffers)?)
        }));
        parts
    }

    fn stage(&self) -> (Stage, u32) {
        // Two reads a voxel.
        (stages::EXPAND, 4000)
    }

    fn record(&self, rec: &mut Recorder, to: &Target, take: &Take) -> Result<()> {
        let b = Bindings {
            opacity: to.opacity,
            index: &self.histogram.index,
            list: to.list,
            ambient: to.ambient,
        };
        Ok(self.expand.record(rec, &to.on.field, self.scene(to.on), b, take)?)
    }
}
