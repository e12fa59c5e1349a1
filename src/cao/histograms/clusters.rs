//! Clusters of histograms by k-means (docs/histograms.md; `cao_twin::histograms::clusters` has the rounds), in whole numbers from a fixed
//! seed: the same on every device and after every history.
//!
//! In: `sampled` histograms. Out: `centres`, 128 bytes each. Cost: 64 differences for each sample, cluster and round.

use super::histogram::HistogramPlan;
use crate::host::rows_over;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Pipeline, Recorder};
use cao_kernels::clusters as kernel;
use cao_model::options::Options;

/// Rounds of k-means.
pub const ROUNDS: u32 = 12;

/// The kernel `clusters`, and what it makes.
pub struct Clusters {
    seed: Pipeline,
    label: Pipeline,
    collect: Pipeline,
    centre: Pipeline,
    labels: Buffer,
    sums: Buffer,
    /// The clusters.
    pub centres: Buffer,
}

impl Clusters {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        let device = |name: &str, words: u32| gpu.buffer(name, 4 * u64::from(words), BufferUse::Device);
        Ok(Self {
            seed: pipeline("seed")?,
            label: pipeline("label")?,
            collect: pipeline("collect")?,
            centre: pipeline("centre")?,
            labels: device("labels", kernel::MOST_ROWS)?,
            sums: device("sums of clusters", kernel::SUMS * Options::MOST_CLUSTERS)?,
            centres: device("centres of clusters", kernel::WORDS * Options::MOST_CLUSTERS)?,
        })
    }

    /// The first centres.
    pub fn record_seed(&self, rec: &mut Recorder, plan: &HistogramPlan, sampled: &Buffer) -> Result<()> {
        let binds = kernel::SeedBindings { sampled, sums: &self.sums, centres: &self.centres };
        let params = params(plan, 0);
        rec.barrier(&BOTH, &BOTH);
        rec.dispatch(&self.seed, &binds, bytemuck::bytes_of(&params), over(plan.clusters))?;
        rec.barrier(&BOTH, &BOTH);
        Ok(())
    }

    /// One round.
    pub fn record_round(
        &self,
        rec: &mut Recorder,
        plan: &HistogramPlan,
        sampled: &Buffer,
        round: u32,
    ) -> Result<()> {
        let params = params(plan, round);
        let push = bytemuck::bytes_of(&params);
        let (labels, sums, centres) = (&self.labels, &self.sums, &self.centres);
        rec.dispatch(
            &self.label,
            &kernel::LabelBindings { sampled, labels, centres },
            push,
            over(plan.rows),
        )?;
        rec.barrier(&BOTH, &BOTH);
        rec.dispatch(
            &self.collect,
            &kernel::CollectBindings { sampled, labels, sums },
            push,
            over(plan.rows),
        )?;
        rec.barrier(&BOTH, &BOTH);
        let binds = kernel::CentreBindings { sampled, sums, centres };
        rec.dispatch(&self.centre, &binds, push, over(plan.clusters))?;
        rec.barrier(&BOTH, &BOTH);
        Ok(())
    }
}

const BOTH: [Access; 2] = [Access::StorageRead, Access::StorageWrite];

fn over(n: u32) -> [u32; 3] {
    rows_over(n, kernel::LABEL_WORKGROUP)
}

fn params(plan: &HistogramPlan, round: u32) -> kernel::ClustersParams {
    kernel::ClustersParams { rows: plan.rows, clusters: plan.clusters, round }
}
