//! Examples to train a network on (DVAO §3.1; docs/training.md): random volumes, random transfer functions, exact ambient values.
//!
//! In: sources, a seed. Out: cubes of opacity, labels and values in 65535ths, with the transfer function. The same seed gives the same
//! examples on one device; other devices' labels differ by rounding. Cost: [`labels`].

pub mod labels;
mod peaks;
pub mod source;
mod trapezoids;
mod window;

use crate::Result;
use crate::error::Errors;
use crate::random::Random;
use cao_gpu::Gpu;
use cao_model::network::Label;
use labels::Labels;
use source::Source;
use trapezoids::{Trapezoid, transfer};
use window::Window;

/// What to make.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along each axis.
    pub edge: usize,
    /// Samples along each axis of a voxel.
    pub samples: usize,
    /// Seed of everything.
    pub seed: u64,
    /// What to compute.
    pub labels: Vec<Label>,
}

/// An example.
#[derive(Clone, Debug)]
pub struct Example {
    /// Name of its source.
    pub source: String,
    /// Whether that is a volume that was read.
    pub given: bool,
    /// Corners of its transfer function: value in shares of the range, opacity.
    pub transfer: Vec<[f64; 2]>,
    /// Opacity, x fastest, 65535 for 1.
    pub opacity: Vec<u16>,
    /// Labels, in the order of the plan's.
    pub labels: Vec<Vec<u16>>,
    /// Values, 65535 for the largest of the volume.
    pub values: Vec<u16>,
    /// Errors of the labels to the converged reference, of every fiftieth example; empty of others.
    pub errors: Vec<Errors>,
}

/// One in so many is checked by the reference.
const CHECKED: usize = 50;
/// Windows with a smaller mean opacity show next to nothing.
const LEAST: f64 = 2e-3;
/// Tries to get a window that shows something.
const TRIES: usize = 100;

/// Makes examples.
pub struct Maker<'a> {
    plan: Plan,
    sources: Vec<Source>,
    labels: Labels<'a>,
}

impl<'a> Maker<'a> {
    /// Builds the pipelines. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// Without sources; an edge of fewer than 8 or more than 512 voxels; samples that are not 1 to 8.
    pub fn new(gpu: &'a Gpu, plan: Plan, sources: Vec<Source>) -> Result<Self> {
        let within = |what: &str, number: usize, least: usize, most: usize| {
            let problem = || crate::Error::refused(what, format!("is {number}; must be {least} to {most}"));
            (least..=most).contains(&number).then_some(()).ok_or_else(problem)
        };
        within("number of sources of examples", sources.len(), 1, usize::MAX)?;
        within("edge of examples", plan.edge, 8, 512)?;
        within("samples of a voxel of examples", plan.samples, 1, 8)?;
        Ok(Self { labels: Labels::new(gpu, plan.edge)?, plan, sources })
    }

    /// Example `i`, of source i modulo their number; the same whatever was made before.
    ///
    /// # Errors
    /// A source of which no transfer function shows anything; those of the device.
    pub fn make(&mut self, i: usize) -> Result<Example> {
        let mut random = Random::new(self.plan.seed ^ (i as u64).wrapping_mul(0xD1B5_4A32_D192_ED03));
        let source = &self.sources[i % self.sources.len()];
        let (transfer, voxels) = self.shown(&mut random, source)?;
        let coded = |share: f32| (65535.0 * share.clamp(0.0, 1.0)).round() as u16;
        let opacity: Vec<u16> = voxels.iter().map(|[opacity, _]| coded(*opacity)).collect();
        let mut labels = Vec::new();
        let mut errors = Vec::new();
        for &label in &self.plan.labels {
            let found = self.labels.of(label, &opacity)?;
            if i.is_multiple_of(CHECKED) {
                errors.push(self.labels.check(label, &opacity, &found)?);
            }
            labels.push(found.into_iter().map(coded).collect::<Vec<u16>>());
        }
        Ok(Example {
            source: source.name().to_owned(),
            given: source.given(),
            transfer: transfer.iter().flat_map(Trapezoid::points).collect(),
            values: voxels.iter().map(|[_, value]| coded(*value)).collect(),
            opacity,
            labels,
            errors,
        })
    }

    /// A transfer function and the voxels of a window on what it shows.
    fn shown(&self, random: &mut Random, source: &Source) -> Result<(Vec<Trapezoid>, Vec<[f32; 2]>)> {
        for _ in 0..TRIES {
            let scan = source.scan(random)?;
            let transfer = transfer(random, &scan.peaks);
            let whole = Window::around(&scan, source::turn(random));
            let Some(window) = whole.random(random, &scan, &transfer) else { continue };
            let voxels = window.sampled(&scan, &transfer, self.plan.edge, self.plan.samples);
            let mean =
                voxels.iter().map(|[opacity, _]| f64::from(*opacity)).sum::<f64>() / voxels.len() as f64;
            if mean >= LEAST {
                return Ok((transfer, voxels));
            }
        }
        let problem = format!("of {TRIES} random transfer functions none shows anything of it");
        Err(crate::Error::refused(&format!("source {}", source.name()), problem))
    }
}
