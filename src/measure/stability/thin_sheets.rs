//! Thin sheets (measure.md §4): how wrong cones are about an opaque sheet that is thinner than they are wide.
//!
//! In a cube of s voxels a sheet of one voxel has the mean opacity 1/s, and a step as long as half the cube lets (1 − 1/s)^(s/2) through, six
//! tenths, where the sheet lets nothing through; the next cube holds it once more, or a cell of a mip level spreads it to where it is not.
//! What comes of it depends on where cells lie. Truth: the ambient integral of the same field. Control: cones along 26 and 14 weighted directions.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
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

/// How wrong a method may be, as a share of the light that the sheet stops: rays by brick see a far sheet half a voxel nearer than it
/// becomes opaque between voxels, which at 14 voxels of 24 is a sixth.
pub const WRONG: f64 = 0.2;

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
        // As a share of what the sheet stops; above 0 it comes through.
        let wrong = |value: f64| (value - truth) / (1.0 - truth);
        let cone = |rays| wrong(cones_at(&grid, &opacity, &of(rays), &[[MIDDLE; 3]])[0]);
        [cone(RaySet::W26), cone(RaySet::W14), wrong(rays_at(&grid, &opacity, &ours, 1.0, [MIDDLE; 3]))]
    });
    progress(1.0);
    let curve = |of: usize| plan.distances.iter().zip(&found).map(|(x, f)| [*x as f64, f[of]]).collect();
    let many = Series::control("cones, 26w", curve(0));
    let few = Series::control("cones, 14w", curve(1));
    let rays = Series::ours("rays by brick (ours)", curve(2));
    let ends = |series: &Series| {
        let values = series.points.iter().map(|p| p[1]);
        [values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max)]
    };
    let most = |series: &Series| ends(series).into_iter().map(f64::abs).fold(0.0, f64::max);
    let said = |series: &Series| ends(series).map(|end| format!("{:+.0} %", 100.0 * end)).join(" to ");
    Ok(Finding {
        sentence: format!(
            "Of the light that an opaque sheet of one voxel stops, 26 cones have {} too much at distances up to {} voxels, 14 cones {}, as the \
             cells of their volumes lie; ours {}.",
            said(&many),
            plan.distances[plan.distances.len() - 1],
            said(&few),
            said(&rays),
        ),
        ours: Ours::holding(most(&rays) <= WRONG),
        control_fails: most(&many) > 2.0 * WRONG && most(&few) > 2.0 * WRONG,
        setting: format!(
            "opaque sheet one voxel thick above a voxel; radius {RADIUS} voxels; ours: {} {}",
            ours.rays.name(),
            ours.quadrature.name()
        ),
        charts: vec![Chart {
            title: "Light behind a thin sheet".into(),
            x: Quantity::linear("distance of the sheet, voxels"),
            y: Quantity::linear("error / light that the sheet stops; above 0 too bright"),
            series: vec![many, few, rays],
        }],
    })
}
