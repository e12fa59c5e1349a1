//! Shells (measure.md §4): how dark a flat wall becomes as shells of mean opacities become more.
//!
//! The first solid layer of an opaque half-space. Shells take the mean opacities of boxes behind one another as if they were independent:
//! half of each shell is solid, so each lets half through, where in truth half of all directions are free. Control: the rules of shells.
//! Yardstick: the converged ambient integral. Ours: rays, which know no shells.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use cao_model::occlusion::{Integral, Occlusion, Quadrature, RaySet};
use cao_twin::Grid;
use cao_twin::measure::reference::reference;
use cao_twin::rays::rays::rays_at;
use cao_twin::tables::boxes::box_at;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Numbers of shells.
    pub shells: Vec<u32>,
    /// Directions of the truth.
    pub directions: u32,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { shells: vec![1, 2, 3, 4, 6, 8, 11, 16, 23, 32], directions: 4000 },
            Effort::Quick => Self { shells: vec![1, 4, 16, 32], directions: 600 },
        }
    }
}

/// Radius in voxels.
const RADIUS: usize = 32;

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let grid = Grid { dims: [2 * RADIUS + 1; 3], spacing: [1.0; 3] };
    let opacity: Vec<f32> =
        (0..grid.len()).map(|i| f32::from(u8::from(grid.voxel(i)[2] <= RADIUS))).collect();
    let at = [RADIUS; 3];
    let occlusion =
        |rays, quadrature| Occlusion { rays, quadrature, radius_mm: RADIUS as f32, ..Occlusion::paper(1.0) };
    let level = |value: f64| plan.shells.iter().map(|n| [f64::from(*n), value]).collect::<Vec<_>>();
    let integral = Integral::ambient(RADIUS as f64, 0.5, 8, plan.directions, 1.0);
    let truth = reference(&grid, &opacity, &integral, 1.0, &[at.map(|c| c as f64)])[0];
    let rays = rays_at(&grid, &opacity, &occlusion(RaySet::Spiral(192), Quadrature::Hybrid), 1.0, at);
    let mut series = vec![
        Series::ours("192 rays by brick (ours)", level(rays)),
        Series::yardstick("the ambient integral", level(truth)),
    ];
    for (n, rule) in Quadrature::SHELLS.into_iter().enumerate() {
        let value = |shells: u32| {
            let value = box_at(&grid, &opacity, &occlusion(RaySet::None, rule), shells, 1.0, at);
            // None has no place on an axis of factors.
            [f64::from(shells), value.max(1e-12)]
        };
        let points = plan.shells.iter().map(|n| value(*n)).collect();
        series.push(Series::control(format!("shells, rule {}", rule.name()), points));
        progress((n + 1) as f64 / 3.0);
    }
    let mean = &series[2];
    let (first, last) = (mean.points[0], mean.points[mean.points.len() - 1]);
    Ok(Finding {
        sentence: format!(
            "More shells make a flat wall darker: its first solid layer has {} with {} shell and {} with {} by the rule mean, where the ambient \
             integral is {}; rays, ours, have {}.",
            short(first[1]),
            first[0],
            short(last[1]),
            last[0],
            short(truth),
            short(rays),
        ),
        ours: Ours::holding((rays - truth).abs() < 0.05),
        control_fails: mean.points.windows(2).all(|pair| pair[1][1] < pair[0][1])
            && (last[1] - truth).abs() > 2.0 * (rays - truth).abs(),
        setting: format!(
            "opaque half-space, radius {RADIUS} voxels, {} directions of the truth",
            plan.directions
        ),
        charts: vec![Chart {
            title: "Ambient factor of a flat wall".into(),
            x: Quantity::log("shells"),
            y: Quantity::log("ambient factor of the first solid layer (0 … 1)"),
            series,
        }],
    })
}
