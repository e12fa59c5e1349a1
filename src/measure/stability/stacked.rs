//! Stacked squares (AOV §6 "overdarkens multiply occluded areas", measure.md §4): parallel surfaces behind one another, of which the first hides what the others could.
//!
//! AOV sums what each triangle hides as if it were alone, and cuts the sum off at 1. Ours is AOV, and ends here as the paper's does. Truth: rays,
//! which end at the first surface. Without falloff a square of half-side 1 hides .831 at a height of 0.5, and .774 at 0.6.

use super::quads::{quad, world};
use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use cao_twin::each;
use cao_twin::mesh::gather::gathered;
use cao_twin::mesh::trace::traced;
use glam::{DVec3, Vec3};

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Numbers of squares.
    pub squares: Vec<usize>,
    /// Rays are this number squared.
    pub edge: u32,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { squares: (1..=16).collect(), edge: 200 },
            Effort::Quick => Self { squares: vec![1, 2, 4, 8, 16], edge: 100 },
        }
    }
}

/// Half a square's side, the height of the first over the point, and what each is above the one before, in mm.
const HALF: f32 = 100.0;
const FIRST: f32 = 50.0;
const APART: f32 = 10.0;

/// A reach beside which all distances are nothing: no falloff.
const FAR: f64 = 1e9;

/// A reach as one uses it, in mm, and the volumes' share of that of rays (AOV §6).
const REACH: f64 = 300.0;
const SHARE: f64 = 0.6;

/// What occlusion may grow by while the truth stands still.
pub const DRIFT: f64 = 0.03;

/// Occlusion below some squares, without and with falloff.
struct Found {
    /// By AOV, not cut off.
    sums: [f64; 2],
    /// By rays.
    truths: [f64; 2],
}

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let squares = |count: usize| {
        let of = |n: usize| {
            let corner = Vec3::new(-HALF, -HALF, FIRST + APART * n as f32);
            // Its front is below.
            quad(corner, 2.0 * HALF * Vec3::Y, 2.0 * HALF * Vec3::X)
        };
        world(&(0..count).map(of).collect::<Vec<_>>())
    };
    let worlds = plan.squares.iter().map(|count| squares(*count)).collect::<Result<Vec<_>>>()?;
    let found = each(worlds.len(), |n| {
        let (place, up, world) = (DVec3::ZERO, DVec3::Z, &worlds[n]);
        let sums = [FAR, SHARE * REACH].map(|delta| gathered(world, place, up, delta));
        let truths = [FAR, REACH].map(|delta| traced(world, &[], place, up, delta, plan.edge));
        Found { sums, truths }
    });
    progress(1.0);
    let curve = |of: &dyn Fn(&Found) -> f64| -> Vec<[f64; 2]> {
        plan.squares.iter().zip(&found).map(|(count, found)| [*count as f64, of(found)]).collect()
    };
    let chart = |n: usize, title: &str| Chart {
        title: title.into(),
        x: Quantity::linear("squares"),
        y: Quantity::linear("occlusion"),
        series: vec![
            Series::control("AOV's sum, as it is", curve(&|found| found.sums[n])),
            Series::ours("AOV (ours), cut off at 1", curve(&|found| found.sums[n].min(1.0))),
            Series::yardstick("rays", curve(&|found| found.truths[n])),
        ],
    };
    let charts =
        vec![chart(0, "A point below squares, no falloff"), chart(1, "A point below squares, with falloff")];
    let last = plan.squares[plan.squares.len() - 1];
    let ends = |n: usize, of: usize| {
        let series = &charts[n].series[of];
        [series.at(1.0), series.at(last as f64)]
    };
    let growth = |of: usize| ends(0, of)[1] - ends(0, of)[0];
    let said = |[one, last]: [f64; 2]| format!("from {} to {}", short(one), short(last));
    let sentence = format!(
        "Squares behind the first hide nothing more: with {last} of them rays go {}, AOV's sum {}, {} with two, and its occlusion, ours included, {}; with falloff rays \
         go {}, the sum {}.",
        said(ends(0, 2)),
        said(ends(0, 0)),
        short(charts[0].series[0].at(2.0)),
        said(ends(0, 1)),
        said(ends(1, 2)),
        said(ends(1, 0)),
    );
    Ok(Finding {
        sentence,
        ours: if growth(1) - growth(2) > DRIFT { Ours::Limited } else { Ours::Holds },
        control_fails: growth(0) - growth(2) > 3.0 * DRIFT,
        setting: format!(
            "squares of half-side {HALF} mm, {FIRST} mm and more above a point, {APART} mm apart; {} rays; with falloff: rays {REACH} mm, volumes {SHARE} of it",
            plan.edge * plan.edge
        ),
        charts,
    })
}
