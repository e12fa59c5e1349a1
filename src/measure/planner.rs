//! The cheapest settings that are accurate enough, or the most accurate that are quick enough, for the scene at hand (measure.md §5).
//!
//! A calibration computes sample bricks of the scene with each candidate's settings on the device and compares them with the
//! ambient reference. One brick in each of [`SAMPLES`] equal runs of the bricks that need values stands for them all:
//!
//! ```text
//! rmse² = Σ_b n_b e_b / Σ_b n_b          e_b mean squared error of sample brick b, n_b its voxels that count
//! bound² = rmse² + 2 √(Σ_b (n_b/n̄)² (e_b − rmse²)² / (B (B − 1)))       two standard errors of that ratio
//! ms = time of a sample brick among many · bricks that an update computes; where a brick alone says nothing, of a whole update
//! ```
//!
//! An error budget takes the cheapest candidate whose `bound` it holds, a time budget the most accurate one whose `ms` leaves it
//! [`TIME_MARGIN`].

use super::error::errors;
use super::random::Random;
use super::reference::{Plan, ambient_in};
use crate::{Error, Result};
use cao::field::BRICK;
use cao::renderer::Renderer;
use cao::verify::probe::Probe;
use cao_gpu::{Gpu, Phase, Timings};
use cao_model::METHODS;
use cao_model::methods::{Entry, Method};
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::options::Options;
use cao_model::settings::{Scope, Setup};
use cao_twin::Grid;
use std::collections::HashMap;
use std::time::Instant;

/// Bricks that errors and times are measured on.
pub const SAMPLES: usize = 24;

/// Voxels of each of them that are compared with the reference.
const VOXELS: usize = 48;

/// Fine enough: at 512 directions and four steps a voxel the reference itself moves by some 0.001 when both are doubled, which adds less
/// than a twentieth to the error of the most accurate settings.
const REFERENCE: Plan = Plan { directions: 512, steps_per_voxel: 4, max_voxels: usize::MAX, ..Plan::FULL };

/// A time budget must be this much longer than the time that is foreseen.
pub const TIME_MARGIN: f64 = 1.25;

/// How far a foreseen time may be off, as a factor: sample bricks are not all bricks, and machines do other things.
pub const TIME_FACTOR: f64 = 3.0;

/// What settings may cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Root mean square error of ambient factors, 0 … 1, against the ambient reference.
    Error(f64),
    /// Milliseconds of the device to compute all ambient factors.
    Milliseconds(f64),
}

/// Settings to choose from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Methods with the same values count as the same here.
    pub method: Method,
    /// Rays, rule, lengths.
    pub occlusion: Occlusion,
    /// What the method takes beside.
    pub options: Options,
}

impl std::fmt::Display for Candidate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Occlusion { rays, quadrature, .. } = self.occlusion;
        write!(f, "method {}, rays {}, quadrature {}", self.method.name(), rays.name(), quadrature.name())?;
        let given = self.options.other_than(&Options::DEFAULT);
        given.iter().try_for_each(|(name, value)| write!(f, ", {name} {value}"))
    }
}

/// What a calibration found of one candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The candidate.
    pub candidate: Candidate,
    /// Root mean square error on the sample bricks.
    pub rmse: f64,
    /// What the error of the whole scene is expected not to exceed: two standard errors more.
    pub bound: f64,
    /// Foreseen time in ms of computing all ambient factors.
    pub ms: f64,
}

/// What a calibration found.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// The candidates that were tried.
    pub measured: Vec<Measured>,
    /// Sample bricks (x fastest), [`SAMPLES`] or all.
    pub bricks: Vec<u32>,
    /// Bricks with a voxel that counts.
    pub needed: Vec<u32>,
}

/// What may be chosen in place of `setup`, with its lengths: every method, by the ray sets and rules of its entry, of methods with the
/// same values the one that it has; or only this method, these rays, this rule.
pub fn candidates(
    setup: &Setup,
    method: Option<Method>,
    rays: Option<RaySet>,
    quadrature: Option<Quadrature>,
) -> Vec<Candidate> {
    let chosen = |entry: &&Entry| match method {
        Some(only) => entry.method == only,
        // What one feature takes from another's light is no error of theirs, histograms know no clip, and a network takes longer than rays that
        // err a quarter as much (`cao chart --dvao`) and errs more on what it was not trained on: such values are for who asks for them.
        None if [Method::FeatureDriven, Method::Histograms, Method::Deep].contains(&entry.method) => {
            setup.method == entry.method
        }
        None => stands_for(entry.same_values_as, setup.method) == entry.method,
    };
    let mut list = Vec::new();
    let lit = |entry: &&Entry| entry.lights >= setup.occlusion.light.needs();
    for entry in METHODS.iter().filter(chosen).filter(lit) {
        // Who asks for rays does not ask for a method without any; sets that a method does not list are for who asks for them.
        if rays.is_some_and(|rays| !entry.method.follows(rays)) {
            continue;
        }
        let sets = rays.as_ref().map_or(entry.sets, std::slice::from_ref);
        for &rays in sets {
            for &rule in entry.quadratures.iter().filter(|rule| quadrature.is_none_or(|only| **rule == only))
            {
                let occlusion = Occlusion { rays, quadrature: rule, ..setup.occlusion };
                let with = |options| Candidate { method: entry.method, occlusion, options };
                list.extend(entry.method.variants().map(with));
            }
        }
    }
    list.sort_by_key(|candidate| candidate.occlusion.rays.count());
    list
}

/// Of the methods with these values the one in use, or else the last of the list.
fn stands_for(values: Method, in_use: Method) -> Method {
    if in_use.values() == values {
        return in_use;
    }
    METHODS.iter().rfind(|entry| entry.same_values_as == values).map_or(values, |entry| entry.method)
}

/// Whether a candidate's values are those of rays that can be cast in a few bricks by themselves, as [`Probe`] does.
fn probed(candidate: &Candidate) -> bool {
    candidate.method.values() == Method::Lao
}

/// Tries candidates, the cheaper ones first where they stand first, on sample bricks of the scene as it is; other
/// methods than those of rays by the sampler are computed and timed as a whole. Where a budget is given, candidates that cannot be its
/// choice, by the time that fewer rays took, are left out. The renderer's ambient volume is out of date afterwards and its setup may be
/// another. `progress` hears the share done (0 … 1). Uses the device's queue and waits for it.
///
/// # Errors
/// Those of the device. Candidates that this volume or device cannot have are left out.
pub fn calibrate(
    renderer: &mut Renderer,
    candidates: &[Candidate],
    budget: Option<Budget>,
    progress: &mut dyn FnMut(f64),
) -> Result<Calibration> {
    let all = renderer.field().brick_count();
    let scope = renderer.setup().scope;
    let probed = Probed::new(renderer)?;
    let needed = probed.needed();
    let bricks = sample(&needed);
    let samples = probed.samples(&bricks, candidates, &mut |part| progress(0.4 * part))?;
    drop(probed);
    let (timed, computed) = match scope {
        Scope::Needed => (bricks.clone(), needed.len()),
        Scope::All => (sample(&(0..all).collect::<Vec<_>>()), all as usize),
    };
    let mut rest = |part: f64| progress(0.4 + 0.6 * part);
    let measured = try_all(renderer, candidates, &bricks, &samples, (&timed, computed), budget, &mut rest)?;
    Ok(Calibration { measured, bricks, needed })
}

/// Errors of candidates on bricks of one's own choice; `ms` of cast rays is the time of one of these bricks.
pub fn measure(renderer: &mut Renderer, candidates: &[Candidate], bricks: &[u32]) -> Result<Vec<Measured>> {
    let samples = Probed::new(renderer)?.samples(bricks, candidates, &mut |_| ())?;
    try_all(renderer, candidates, bricks, &samples, (bricks, 1), None, &mut |_| ())
}

/// A candidate is left out when it has to take this many times what the budget allows or another candidate that keeps it takes:
/// times are no better known.
const HOPELESS: f64 = 2.0;

/// What is known of the candidates that were tried.
struct Tried {
    budget: Option<Budget>,
    /// No choice takes longer, in ms.
    limit: f64,
    /// Least time in ms that a ray took, by the method whose values they are.
    ray_ms: HashMap<Method, f64>,
    measured: Vec<Measured>,
}

impl Tried {
    fn rays(candidate: &Candidate) -> f64 {
        candidate.occlusion.rays.count() as f64
    }

    fn hopeless(&self, candidate: &Candidate) -> bool {
        let ray_ms = self.ray_ms.get(&candidate.method.values());
        ray_ms.is_some_and(|ms| ms * Self::rays(candidate) > HOPELESS * self.limit)
    }

    fn add(&mut self, measured: Measured) {
        let ray_ms = self.ray_ms.entry(measured.candidate.method.values()).or_insert(f64::INFINITY);
        *ray_ms = ray_ms.min(measured.ms / Self::rays(&measured.candidate));
        if let Some(budget @ Budget::Error(_)) = self.budget
            && budget.holds(&measured)
        {
            self.limit = self.limit.min(measured.ms);
        }
        self.measured.push(measured);
    }
}

/// Methods computed as a whole first, which are the cheaper ones: they spare the most. `timed` are the bricks that cast rays are timed on, and the
/// number of bricks that they stand for.
fn try_all(
    renderer: &mut Renderer,
    candidates: &[Candidate],
    bricks: &[u32],
    samples: &[Sample],
    timed: (&[u32], usize),
    budget: Option<Budget>,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Measured>> {
    let setup = *renderer.setup();
    let limit = match budget {
        Some(Budget::Milliseconds(most)) => most / TIME_MARGIN,
        _ => f64::INFINITY,
    };
    let mut tried = Tried { budget, limit, ray_ms: HashMap::new(), measured: Vec::new() };
    let (casts, wholes): (Vec<Candidate>, Vec<Candidate>) = candidates.iter().partition(|c| probed(c));
    let part = |done: usize| done as f64 / candidates.len() as f64;
    for (i, &candidate) in wholes.iter().enumerate() {
        let Candidate { method, occlusion, options } = candidate;
        if !tried.hopeless(&candidate) {
            match renderer.set_setup(Setup { method, occlusion, options, ..setup }) {
                Ok(()) => {
                    let (values, ms) = whole(renderer)?;
                    let (rmse, bound) = judge(samples, |_, voxel| values[voxel]);
                    tried.add(Measured { candidate, rmse, bound, ms });
                }
                // A setting that this method does not have.
                Err(cao::Error::Model(_)) => {}
                Err(error) => return Err(error.into()),
            }
        }
        progress(part(i + 1));
    }
    if !casts.is_empty() {
        let probed = Probed::new(renderer)?;
        for (i, &candidate) in casts.iter().enumerate() {
            if !tried.hopeless(&candidate) {
                let (rmse, bound, brick_ms) = probed.cast(&candidate.occlusion, bricks, samples, timed.0)?;
                tried.add(Measured { candidate, rmse, bound, ms: brick_ms * timed.1 as f64 });
            }
            progress(part(wholes.len() + i + 1));
        }
    }
    Ok(tried.measured)
}

/// Ambient factors of everything by the renderer's method, and the median time in ms of computing them.
fn whole(renderer: &mut Renderer) -> Result<(Vec<f32>, f64)> {
    let mut times = Vec::new();
    for _ in 0..3 {
        renderer.invalidate();
        let start = Instant::now();
        let timings = renderer.update(&mut |_| ())?;
        times.push(ambient_ms(&timings, start.elapsed().as_secs_f64() * 1e3));
        if times[0] > LONG_ENOUGH_MS {
            break;
        }
    }
    times.sort_by(f64::total_cmp);
    Ok((renderer.read_ambient()?, times[times.len() / 2]))
}

/// An update of this many ms is not timed again.
const LONG_ENOUGH_MS: f64 = 20.0;

/// Time in ms of computing ambient factors in an update that computed all of them. That takes time: where no stage says so, because the
/// device's queue has no timestamps or a stage is not where it belongs, all of the update's `by_clock` counts.
fn ambient_ms(update: &Timings, by_clock: f64) -> f64 {
    let ms = update.of(Phase::Ambient);
    if ms > 0.0 { ms } else { by_clock }
}

impl Calibration {
    /// The candidate to take.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] where none fits, with what can be reached.
    pub fn choose(&self, budget: Budget) -> Result<Measured> {
        let by = |key: fn(&Measured) -> f64| move |a: &&Measured, b: &&Measured| key(a).total_cmp(&key(b));
        let fitting = self.measured.iter().filter(|m| budget.holds(m));
        let chosen = match budget {
            Budget::Error(_) => fitting.min_by(by(|m| m.ms)),
            Budget::Milliseconds(_) => fitting.min_by(by(|m| m.bound)),
        };
        let best = match budget {
            Budget::Error(_) => self.measured.iter().min_by(by(|m| m.bound)),
            Budget::Milliseconds(_) => self.measured.iter().min_by(by(|m| m.ms)),
        };
        if let Some(chosen) = chosen {
            return Ok(*chosen);
        }
        let refuse = |what: &str, problem: String| Error::refused(what, problem);
        let Some(best) = best else {
            return Err(refuse("budget", "no settings to choose from".into()));
        };
        let name = best.candidate;
        Err(match budget {
            Budget::Error(most) => refuse(
                "error budget",
                format!(
                    "{most} is less than any setting tried ({}) reaches in this scene; the most accurate, {name}, errs by up to \
                     {:.2e}: ask for that or more, or for other lengths",
                    self.measured.len(),
                    // Rounding to three digits takes no more than that away.
                    1.005 * best.bound
                ),
            ),
            Budget::Milliseconds(most) => refuse(
                "time budget",
                format!(
                    "{most} ms is less than any setting tried ({}) takes for this scene; the quickest, {name}, takes about \
                     {:.3} ms: ask for {:.3} or more, or for a shorter radius",
                    self.measured.len(),
                    best.ms,
                    best.ms * TIME_MARGIN
                ),
            ),
        })
    }

    /// The best candidate on the other side of the budget: what it would have to be for less time, or for a smaller error.
    pub fn runner_up(&self, budget: Budget) -> Option<Measured> {
        let missed = self.measured.iter().filter(|m| !budget.holds(m)).copied();
        match budget {
            Budget::Error(_) => missed.min_by(|a, b| a.bound.total_cmp(&b.bound)),
            Budget::Milliseconds(_) => missed.min_by(|a, b| a.ms.total_cmp(&b.ms)),
        }
    }
}

impl Budget {
    fn holds(self, measured: &Measured) -> bool {
        match self {
            Self::Error(most) => measured.bound <= most,
            Self::Milliseconds(most) => measured.ms * TIME_MARGIN <= most,
        }
    }
}

/// One in each of [`SAMPLES`] equal runs, or all. The same each time.
fn sample(bricks: &[u32]) -> Vec<u32> {
    if bricks.len() <= SAMPLES {
        return bricks.to_vec();
    }
    let mut random = Random::new(1);
    let run = |i: usize| i * bricks.len() / SAMPLES;
    (0..SAMPLES).map(|i| bricks[run(i) + random.below((run(i + 1) - run(i)) as u64) as usize]).collect()
}

/// The scene as probes see it.
struct Probed<'a> {
    gpu: Gpu,
    grid: Grid,
    opacity: Vec<f32>,
    probe: Probe<'a>,
}

impl<'a> Probed<'a> {
    fn new(renderer: &'a mut Renderer) -> Result<Self> {
        let gpu = renderer.gpu().clone();
        let field = renderer.field();
        let grid = Grid { dims: field.dims.map(|d| d as usize), spacing: field.spacing.map(f64::from) };
        let (probe, opacity) = cao::verify::probe(renderer)?;
        Ok(Self { gpu, grid, opacity, probe })
    }

    /// Whether a sample with opacity can interpolate a voxel.
    fn counts(&self, voxel: usize) -> bool {
        let solid = |voxel: [usize; 3]| self.opacity[self.grid.index(voxel)] > 0.0;
        let voxel = self.grid.voxel(voxel);
        solid(voxel) || self.grid.neighbours(voxel).any(solid)
    }

    /// Bricks with a voxel that counts.
    fn needed(&self) -> Vec<u32> {
        let edge = BRICK as usize;
        let bricks = self.grid.dims.map(|d| d.div_ceil(edge));
        let mut needed = vec![false; bricks.iter().product()];
        for voxel in (0..self.opacity.len()).filter(|voxel| self.opacity[*voxel] > 0.0) {
            let at = self.grid.voxel(voxel);
            // The bricks of its neighbours: one along each axis, or two at a brick's face.
            let low = at.map(|c| c.saturating_sub(1) / edge);
            let high: [usize; 3] = std::array::from_fn(|a| (at[a] + 1).min(self.grid.dims[a] - 1) / edge);
            for z in low[2]..=high[2] {
                for y in low[1]..=high[1] {
                    for x in low[0]..=high[0] {
                        needed[(z * bricks[1] + y) * bricks[0] + x] = true;
                    }
                }
            }
        }
        (0..needed.len() as u32).filter(|brick| needed[*brick as usize]).collect()
    }

    /// Voxels of a brick that count, as indices in the volume.
    fn counting(&self, brick: u32) -> Vec<usize> {
        let (first, size) = self.probe.brick(brick);
        let place = |i: u32| {
            let inside = [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])];
            self.grid.index(std::array::from_fn(|a| (first[a] + inside[a]) as usize))
        };
        (0..size.iter().product()).map(place).filter(|voxel| self.counts(*voxel)).collect()
    }

    /// Some voxels of each brick that count, and their reference for candidates, which have the same lengths.
    fn samples(
        &self,
        bricks: &[u32],
        candidates: &[Candidate],
        progress: &mut dyn FnMut(f64),
    ) -> Result<Vec<Sample>> {
        let Some(Candidate { occlusion: like, .. }) = candidates.first() else { return Ok(Vec::new()) };
        let counting: Vec<Vec<usize>> = bricks.iter().map(|brick| self.counting(*brick)).collect();
        let mut random = Random::new(2);
        let mut some = |all: &Vec<usize>| -> Vec<usize> {
            let count = VOXELS.min(all.len());
            let run = |i: usize| i * all.len() / count;
            (0..count).map(|i| all[run(i) + random.below((run(i + 1) - run(i)) as u64) as usize]).collect()
        };
        let compared: Vec<Vec<usize>> = counting.iter().map(&mut some).collect();
        // The integral that a ray's samples stand for begins half a step before the first.
        let smallest = self.grid.min_spacing();
        let offset = f64::from(like.first(smallest)) - 0.5 * f64::from(like.step(smallest));
        let reference = ambient_in(
            &self.gpu,
            &self.grid,
            &self.opacity,
            &compared,
            f64::from(like.radius_mm),
            offset,
            self.probe.reference_mm().into(),
            &Plan { light: like.light, ..REFERENCE },
            progress,
        )?;
        let parts = counting.iter().zip(compared).zip(reference);
        Ok(parts
            .map(|((all, voxels), reference)| Sample { counting: all.len(), voxels, reference })
            .collect())
    }

    /// Error, its bound, and the time in ms of one of the bricks `timed`, of cast rays.
    fn cast(
        &self,
        occlusion: &Occlusion,
        bricks: &[u32],
        samples: &[Sample],
        timed: &[u32],
    ) -> Result<(f64, f64, f64)> {
        let (values, mut ms) = self.probe.run(occlusion, bricks)?;
        if timed != bricks {
            ms = self.probe.run(occlusion, timed)?.1;
        }
        let (rmse, bound) = judge(samples, |b, voxel| {
            let (first, size) = self.probe.brick(bricks[b]);
            let at = self.grid.voxel(voxel);
            let [x, y, z]: [usize; 3] = std::array::from_fn(|a| at[a] - first[a] as usize);
            values[b][(z * size[1] as usize + y) * size[0] as usize + x]
        });
        Ok((rmse, bound, ms))
    }
}

/// What is compared in a sample brick.
struct Sample {
    /// Voxels that count.
    counting: usize,
    /// Those of them that are compared, as indices in the volume.
    voxels: Vec<usize>,
    /// Their ambient reference.
    reference: Vec<f32>,
}

/// Root mean square error and its bound of values, told the number of a brick and a voxel of it.
fn judge(samples: &[Sample], value: impl Fn(usize, usize) -> f32) -> (f64, f64) {
    let brick = |(b, sample): (usize, &Sample)| {
        let values: Vec<f32> = sample.voxels.iter().map(|voxel| value(b, *voxel)).collect();
        (sample.counting as f64, errors(&values, &sample.reference, &vec![true; values.len()]).mse)
    };
    spread(&samples.iter().enumerate().map(brick).collect::<Vec<_>>())
}

/// Root mean square error and its bound from (voxels, mean squared error) of sample bricks. A single brick says nothing of
/// others, so its bound is none; where there is no brick, there is no error.
fn spread(bricks: &[(f64, f64)]) -> (f64, f64) {
    let count = bricks.len() as f64;
    let voxels: f64 = bricks.iter().map(|b| b.0).sum();
    if bricks.is_empty() {
        return (0.0, 0.0);
    }
    let mse = bricks.iter().map(|(n, e)| n * e).sum::<f64>() / voxels;
    let squares: f64 = bricks.iter().map(|(n, e)| (n * count / voxels * (e - mse)).powi(2)).sum();
    let deviation = if bricks.len() > 1 { (squares / (count * (count - 1.0))).sqrt() } else { 0.0 };
    (mse.sqrt(), (mse + 2.0 * deviation).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao::stages;
    use cao_gpu::Stage;

    fn calibration(list: &[(f64, f64)]) -> Calibration {
        let candidate =
            Candidate { method: Method::Lao, occlusion: Occlusion::paper(1.0), options: Options::DEFAULT };
        let one = |&(bound, ms): &(f64, f64)| Measured { candidate, rmse: 0.9 * bound, bound, ms };
        Calibration { measured: list.iter().map(one).collect(), bricks: vec![0], needed: vec![0] }
    }

    #[test]
    fn an_error_budget_takes_the_cheapest_that_holds_and_a_time_budget_the_most_accurate() {
        let c = calibration(&[(0.05, 1.0), (0.02, 4.0), (0.03, 3.0), (0.01, 9.0), (0.02, 5.0)]);
        for (budget, ms) in [(0.9, 1.0), (0.05, 1.0), (0.049, 3.0), (0.029, 4.0), (0.015, 9.0), (0.01, 9.0)] {
            assert_eq!(c.choose(Budget::Error(budget)).unwrap().ms, ms, "{budget}");
        }
        for (budget, bound) in [(1.25, 0.05), (4.9, 0.03), (5.0, 0.02), (11.0, 0.02), (100.0, 0.01)] {
            assert_eq!(c.choose(Budget::Milliseconds(budget)).unwrap().bound, bound, "{budget}");
        }
        // What there would be on the other side.
        assert_eq!(c.runner_up(Budget::Error(0.029)).unwrap().bound, 0.03);
        assert_eq!(c.runner_up(Budget::Milliseconds(4.9)).unwrap().ms, 4.0);
        assert_eq!(c.runner_up(Budget::Error(0.9)), None);
    }

    #[test]
    fn a_tighter_budget_never_takes_a_cheaper_setting_with_a_larger_error() {
        let mut random = Random::new(3);
        for _ in 0..200 {
            let list: Vec<_> = (0..1 + random.below(30))
                .map(|_| (f64::from(random.between(0.001, 0.1)), f64::from(random.between(0.1, 50.0))))
                .collect();
            let c = calibration(&list);
            let budgets: Vec<f64> = (1..100).map(|i| 0.001 * f64::from(i)).collect();
            let chosen: Vec<_> = budgets.iter().map(|b| c.choose(Budget::Error(*b))).collect();
            for (i, tight) in chosen.iter().enumerate() {
                let Ok(tight) = tight else { continue };
                assert!(tight.bound <= budgets[i]);
                for loose in &chosen[i..] {
                    assert!(loose.as_ref().unwrap().ms <= tight.ms, "a looser budget must not cost more");
                }
            }
        }
    }

    #[test]
    fn what_cannot_be_had_is_refused_with_what_can() {
        let c = calibration(&[(0.05, 1.0), (0.02, 4.0)]);
        let said = c.choose(Budget::Error(0.019)).unwrap_err().to_string();
        assert!(said.contains("0.019") && said.contains("2.01e-2") && said.contains("rays 26"), "{said}");
        let said = c.choose(Budget::Milliseconds(1.2)).unwrap_err().to_string();
        assert!(said.contains("1.2 ms") && said.contains("1.000 ms") && said.contains("1.250"), "{said}");
        assert!(calibration(&[]).choose(Budget::Error(1.0)).is_err());
        assert!(c.choose(Budget::Error(f64::NAN)).is_err());
    }

    /// Two bricks of equal size with errors 1 and 3: mean 2, deviation √(2·1/2) = 1, bound 2 + 2.
    #[test]
    fn bounds_by_hand() {
        assert_eq!(spread(&[]), (0.0, 0.0));
        assert_eq!(spread(&[(5.0, 4.0)]), (2.0, 2.0));
        assert_eq!(spread(&[(7.0, 1.0), (7.0, 3.0)]), (2.0_f64.sqrt(), 2.0));
        // A brick with three times the voxels counts three times.
        assert_eq!(spread(&[(1.0, 4.0), (3.0, 0.0)]).0, 1.0);
        assert!(spread(&[(1.0, f64::NAN), (1.0, 1.0)]).1.is_nan());
    }

    #[test]
    fn only_candidates_that_cannot_be_chosen_are_left_out() {
        let of = |method, rays| Candidate {
            method,
            occlusion: Occlusion { rays, ..Occlusion::paper(1.0) },
            options: Options::DEFAULT,
        };
        let new = |budget, limit| Tried {
            budget: Some(budget),
            limit,
            ray_ms: HashMap::new(),
            measured: Vec::new(),
        };
        let sets = RaySet::ALL;
        let hopeless = |tried: &Tried, method| sets.map(|rays| tried.hopeless(&of(method, rays)));
        // 1 ms a ray: 6 ms keep the budget, so that what takes more than 12 ms is out, of this method only.
        let mut tried = new(Budget::Error(0.1), f64::INFINITY);
        let six = of(Method::Rays, RaySet::R6);
        tried.add(Measured { candidate: six, rmse: 0.2, bound: 0.2, ms: 6.0 });
        assert_eq!(hopeless(&tried, Method::Rays), [false; 7], "nothing keeps the budget yet");
        tried.add(Measured { candidate: six, rmse: 0.05, bound: 0.1, ms: 6.0 });
        assert_eq!(hopeless(&tried, Method::Rays), sets.map(|rays| rays != RaySet::R6));
        assert_eq!(hopeless(&tried, Method::Cao), [false; 7]);
        // 10 ms allow 20.
        let mut tried = new(Budget::Milliseconds(12.5), 10.0);
        tried.add(Measured { candidate: of(Method::Lao, RaySet::R6), rmse: 0.2, bound: 0.2, ms: 6.0 });
        let far = |rays: RaySet| rays.count() > 20;
        assert_eq!(hopeless(&tried, Method::Lao), sets.map(far));
    }

    #[test]
    fn flags_limit_the_candidates() {
        let mut setup = Setup::of(Method::Cao, 1.0);
        setup.occlusion.radius_mm = 7.0;
        let count = |list: &[Candidate], method| list.iter().filter(|c| c.method == method).count();
        let all = candidates(&setup, None, None, None);
        assert!(all.iter().all(|c| c.occlusion.radius_mm == 7.0));
        assert_eq!(count(&all, Method::Cao), RaySet::ALL.len() * Quadrature::CAST.len());
        assert_eq!((count(&all, Method::Lao), count(&all, Method::Rays)), (0, 15));
        // What only who asks for it gets.
        for method in [Method::FeatureDriven, Method::Histograms, Method::Deep] {
            assert_eq!(count(&all, method), 0, "{}", method.name());
            assert!(count(&candidates(&setup, Some(method), None, None), method) > 0, "{}", method.name());
            assert!(
                count(&candidates(&Setup { method, ..setup }, None, None, None), method) > 0,
                "{}",
                method.name()
            );
        }
        assert!(all.is_sorted_by_key(|c| c.occlusion.rays.count()), "the cheaper ones first");
        let lao = candidates(&Setup { method: Method::Lao, ..setup }, None, None, None);
        assert_eq!((count(&lao, Method::Cao), count(&lao, Method::Lao)), (0, 21));

        let some = candidates(&setup, None, Some(RaySet::R26), None);
        assert!(some.iter().all(|c| c.occlusion.rays == RaySet::R26));
        assert_eq!((count(&some, Method::Cao), count(&some, Method::Rays)), (3, 3));
        let some = candidates(&setup, Some(Method::Lao), None, Some(Quadrature::Segment));
        assert!(some.len() == 7 && some.iter().all(|c| c.occlusion.quadrature == Quadrature::Segment));
        // Not every method has every rule; sets that a method does not list are tried where they are asked for.
        let some = candidates(&setup, None, Some(RaySet::R54), Some(Quadrature::Linear));
        assert_eq!((some.len(), count(&some, Method::Rays)), (1, 1));
        assert_eq!(candidates(&setup, None, None, Some(Quadrature::Left)).len(), 7);
        assert_eq!(candidates(&setup, Some(Method::Rays), None, Some(Quadrature::Left)), []);
    }

    /// What belongs to a phase is told by the phase, never by a name; and what is in none is not taken for nothing.
    #[test]
    fn a_renamed_stage_can_no_longer_make_the_planner_believe_in_0_ms() {
        let update = |stages: &[(Stage, f64)]| {
            let mut timings = Timings::new();
            stages.iter().for_each(|&(stage, ms)| timings.push(stage, ms));
            ambient_ms(&timings, 9.0)
        };
        let renamed = Stage { name: "another name", ..stages::RAYS };
        assert_eq!(update(&[(stages::CARVE, 1.0), (stages::CHOOSE, 0.5), (stages::RAYS, 4.0)]), 4.5);
        assert_eq!(update(&[(stages::CARVE, 1.0), (stages::CHOOSE, 0.5), (renamed, 4.0)]), 4.5);
        let lost = Stage { phase: Phase::Prepare, ..stages::RAYS };
        assert_eq!(update(&[(stages::CARVE, 1.0), (lost, 4.0)]), 9.0);
        assert_eq!(update(&[(stages::CARVE, 1.0), (stages::RAYS, 0.0)]), 9.0);
        assert_eq!(update(&[]), 9.0, "a queue without timestamps");
    }
}
