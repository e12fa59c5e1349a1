//! Thin sheets far away (measure.md §4): how much light cones let through an opaque sheet that is thinner than they are wide.
//!
//! In a cube of s voxels a sheet of one voxel has the mean opacity 1/s, and a step as long as half the cube lets (1 − 1/s)^(s/2) through, six
//! tenths, where the sheet lets nothing through. Truth: the ambient integral of the same field. Control: cones along 26 and 14 weighted directions.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use cao_model::methods::Method;
use cao_model::occlusion::{Integral, Occlusion, RaySet};
use cao_twin::cones::cone::cones_at;
use cao_twin::measure::reference::reference;
use cao_twin::rays::rays::rays_at;
use cao_twin::{Grid, each};

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Distances of the sheet's middle in voxels.
    pub distances: Vec<usize>,
    /// Directions of the truth.
    pub directions: u32,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { distances: (1..=14).collect(), directions: 2000 },
            Effort::Quick => Self { distances: vec![1, 3, 6, 9, 12], directions: 400 },
        }
    }
}

/// Radius in voxels.
const RADIUS: f32 = 24.0;

/// The voxel that is looked at, in the middle of a cube that no radius leaves.
const MIDDLE: usize = 52;

/// Of the light that a sheet stops, the share that a method may let through.
pub const LEAK: f64 = 0.1;

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let grid = Grid { dims: [2 * MIDDLE; 3], spacing: [1.0; 3] };
    let of = |rays: RaySet| Occlusion {
        rays,
        quadrature: Method::Rays.quadrature(),
        radius_mm: RADIUS,
        ..Occlusion::paper(1.0)
    };
    let ours = of(Method::Rays.rays());
    let integral = Integral::ambient(f64::from(RADIUS), 0.5, 8, plan.directions, 1.0);
    let found = each(plan.distances.len(), |n| {
        let sheet = MIDDLE + plan.distances[n];
        let opacity: Vec<f32> = (0..grid.len()).map(|i| f32::from(grid.voxel(i)[2] == sheet)).collect();
        let truth = reference(&grid, &opacity, &integral, 1.0, &[[MIDDLE as f64; 3]])[0];
        // Of what the sheet stops, the share that comes through.
        let leak = |value: f64| (value - truth) / (1.0 - truth);
        let cone = |rays| leak(cones_at(&grid, &opacity, &of(rays), &[[MIDDLE; 3]])[0]);
        [cone(RaySet::W26), cone(RaySet::W14), leak(rays_at(&grid, &opacity, &ours, 1.0, [MIDDLE; 3]))]
    });
    progress(1.0);
    let curve = |of: usize| plan.distances.iter().zip(&found).map(|(x, f)| [*x as f64, f[of]]).collect();
    let many = Series::control("cones, 26w", curve(0));
    let few = Series::control("cones, 14w", curve(1));
    let rays = Series::ours("rays by brick (ours)", curve(2));
    let most = rays.points.iter().map(|p| p[1].abs()).fold(0.0, f64::max);
    let last = plan.distances[plan.distances.len() - 1] as f64;
    Ok(Finding {
        sentence: format!(
            "Of the light that an opaque sheet of one voxel stops at a distance of {last} voxels, 26 cones let {} through and 14 cones {}; ours is \
             off by {} at most, at any distance.",
            short(many.at(last)),
            short(few.at(last)),
            short(most),
        ),
        ours: Ours::holding(most <= LEAK),
        control_fails: many.at(last) > 2.0 * LEAK && few.at(last) > 2.0 * LEAK,
        setting: format!(
            "opaque sheet one voxel thick above a voxel; radius {RADIUS} voxels; ours: {} {}",
            ours.rays.name(),
            ours.quadrature.name()
        ),
        charts: vec![Chart {
            title: "What a thin sheet lets through".into(),
            x: Quantity::linear("distance of the sheet, voxels"),
            y: Quantity::linear("share of the light that it stops, let through"),
            series: vec![many, few, rays],
        }],
    })
}
