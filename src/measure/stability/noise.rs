//! Noise (measure.md §4): how many voxels change their shading by noise that a scanner has.
//!
//! Gaussian noise on the values of a volume, in levels of 255. Vicinity shading asks of each direction only whether anything is more opaque,
//! so that noise turns whole directions on and off. Control: that. Ours: rays, which are sums.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use crate::random::Random;
use cao_model::builtin::builtin;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::transfer::TransferFunction;
use cao_twin::Grid;
use cao_twin::rays::rays::rays;
use cao_twin::vicinity::vicinity::vicinity;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along the longest edge of the volume.
    pub edge: usize,
    /// Standard deviations of the noise, in 255ths of the range of values.
    pub sigmas: Vec<f64>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { edge: 64, sigmas: vec![0.0, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0] },
            Effort::Quick => Self { edge: 28, sigmas: vec![0.0, 1.0, 4.0, 8.0] },
        }
    }
}

/// Radius in voxels.
const RADIUS: f32 = 12.0;
/// What of an ambient factor shows as noise.
const SHOWS: f64 = 0.1;

/// Two numbers of a normal distribution (Box and Muller).
fn normal(random: &mut Random) -> f64 {
    let unit = |random: &mut Random| ((random.bits() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
    let (u, v) = (unit(random), unit(random));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let volume = builtin("engine", plan.edge)?;
    let grid = Grid { dims: volume.dims, spacing: [1.0; 3] };
    let (low, high) = volume.range();
    let transfer = TransferFunction::preset("auto", (low, high))?;
    let opacity = |sigma: f64| -> Vec<u16> {
        let mut random = Random::new(1);
        let of = |i: usize, noise: f64| volume.value(i) + sigma / 255.0 * (high - low) * noise;
        let a = |value: f64| transfer.opacity_at(value.clamp(low, high) as f32);
        (0..grid.len()).map(|i| (65535.0 * a(of(i, normal(&mut random)))).round() as u16).collect()
    };
    let occlusion =
        |rays, quadrature| Occlusion { rays, quadrature, radius_mm: RADIUS, ..Occlusion::paper(1.0) };
    let lines = occlusion(RaySet::W50, Quadrature::Visible);
    let traced = occlusion(RaySet::Spiral(50), Quadrature::Hybrid);
    let values = |sigma: f64| -> [Vec<f64>; 2] {
        let opacity = opacity(sigma);
        let rays = rays(&grid, &opacity, &traced, 1.0, true);
        [rays.iter().map(|a| f64::from(*a) / 65535.0).collect(), vicinity(&grid, &opacity, &lines, 1.0, true)]
    };
    let clean = values(0.0);
    // Where the volume without noise has opacity.
    let solid: Vec<usize> =
        opacity(0.0).iter().enumerate().filter(|(_, a)| **a > 0).map(|(i, _)| i).collect();
    let mut curves = [Vec::new(), Vec::new()];
    for (n, &sigma) in plan.sigmas.iter().enumerate() {
        for ((curve, clean), noisy) in curves.iter_mut().zip(&clean).zip(values(sigma)) {
            let changed = solid.iter().filter(|i| (noisy[**i] - clean[**i]).abs() > SHOWS).count();
            curve.push([sigma, changed as f64 / solid.len().max(1) as f64]);
        }
        progress((n + 1) as f64 / plan.sigmas.len() as f64);
    }
    let [of_rays, of_lines] = curves;
    let ours = Series::ours("rays by brick (ours)", of_rays);
    let control = Series::control("vicinity shading", of_lines);
    let last = plan.sigmas[plan.sigmas.len() - 1];
    Ok(Finding {
        sentence: format!(
            "Noise of {} of 255 levels changes the shading of {} of the voxels by more than {SHOWS} under vicinity shading, noise of {last} that of \
             {}; of rays, ours, {} and {}.",
            plan.sigmas[1],
            short(control.points[1][1]),
            short(control.at(last)),
            short(ours.points[1][1]),
            short(ours.at(last)),
        ),
        ours: Ours::holding(ours.largest() < 0.1 * control.largest()),
        control_fails: control.largest() > SHOWS,
        setting: format!(
            "engine {}³, preset auto, radius {RADIUS} voxels, {} voxels with opacity, Gaussian noise on values",
            plan.edge,
            solid.len()
        ),
        charts: vec![Chart {
            title: "Voxels whose shading noise changes".into(),
            x: Quantity::linear("standard deviation of the noise, 255ths of the range of values"),
            y: Quantity::linear(format!("share of voxels that change by more than {SHOWS}")),
            series: vec![ours, control],
        }],
    })
}
