//! Stacked layers (measure.md §4): opaque sheets behind one another, of which the first stops all that the others could.
//!
//! SPAO takes its shells for independent (SPAO §1.2.1, "we assume a statistical independence"), so that each sheet in another shell darkens a
//! voxel again, although no light reaches it. Truth: the ambient integral of the same field. Control: SPAO as published, N-buffers without
//! normals.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use cao_model::methods::Method;
use cao_model::occlusion::{Integral, Occlusion};
use cao_model::options::Options;
use cao_twin::measure::reference::reference;
use cao_twin::rays::rays::rays_at;
use cao_twin::spao::product::product_at;
use cao_twin::{Grid, each};

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Numbers of sheets.
    pub sheets: Vec<usize>,
    /// Directions of the truth.
    pub directions: u32,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { sheets: (1..=8).collect(), directions: 2000 },
            Effort::Quick => Self { sheets: vec![1, 2, 4, 8], directions: 400 },
        }
    }
}

/// Radius in voxels, and voxels from one sheet to the next.
const RADIUS: f32 = 16.0;
const APART: usize = 2;

/// The voxel that is looked at, in the middle of a cube that no radius leaves.
const MIDDLE: usize = 34;

/// A method that darkens by more than this while the truth stands still takes light that is not there.
pub const DRIFT: f64 = 0.03;

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let grid = Grid { dims: [2 * MIDDLE; 3], spacing: [1.0; 3] };
    let rays = Method::Rays;
    let occlusion = Occlusion {
        rays: rays.rays(),
        quadrature: rays.quadrature(),
        radius_mm: RADIUS,
        ..Occlusion::paper(1.0)
    };
    let integral = Integral::ambient(f64::from(RADIUS), 0.5, 8, plan.directions, 1.0);
    let found = each(plan.sheets.len(), |n| {
        let opacity: Vec<f32> = (0..grid.len())
            .map(|i| {
                let up = grid.voxel(i)[2].saturating_sub(MIDDLE);
                f32::from(up > 0 && up.is_multiple_of(APART) && up / APART <= plan.sheets[n])
            })
            .collect();
        let product =
            |options: &Options| product_at(&grid, &opacity, f64::from(RADIUS), options, 1.0, [MIDDLE; 3]);
        [
            product(&Options::DEFAULT),
            rays_at(&grid, &opacity, &occlusion, 1.0, [MIDDLE; 3]),
            reference(&grid, &opacity, &integral, 1.0, &[[MIDDLE as f64; 3]])[0],
        ]
    });
    progress(1.0);
    let curve = |of: usize| plan.sheets.iter().zip(&found).map(|(n, f)| [*n as f64, f[of]]).collect();
    let spao = Series::control("SPAO, N-buffers", curve(0));
    let ours = Series::ours("rays by brick (ours)", curve(1));
    let truth = Series::yardstick("the ambient integral", curve(2));
    let ends = [plan.sheets[0] as f64, plan.sheets[plan.sheets.len() - 1] as f64];
    let fall = |series: &Series| series.at(ends[0]) - series.at(ends[1]);
    let holds = (fall(&ours) - fall(&truth)).abs() <= DRIFT;
    Ok(Finding {
        sentence: format!(
            "Behind one opaque sheet {} more change nothing: the integral goes from {} to {}, ours from {} to {}; SPAO's shells are \
             independent, and it goes from {} to {}.",
            ends[1] - 1.0,
            short(truth.at(ends[0])),
            short(truth.at(ends[1])),
            short(ours.at(ends[0])),
            short(ours.at(ends[1])),
            short(spao.at(ends[0])),
            short(spao.at(ends[1])),
        ),
        ours: Ours::holding(holds),
        control_fails: fall(&spao) - fall(&truth) > 3.0 * DRIFT,
        setting: format!(
            "opaque sheets one voxel thick, the first {APART} voxels above the voxel, the others {APART} apart; radius {RADIUS} voxels; ours: {} \
             {}",
            occlusion.rays.name(),
            occlusion.quadrature.name()
        ),
        charts: vec![Chart {
            title: "A voxel in front of opaque sheets".into(),
            x: Quantity::linear("sheets"),
            y: Quantity::linear("ambient factor"),
            series: vec![spao, ours, truth],
        }],
    })
}
