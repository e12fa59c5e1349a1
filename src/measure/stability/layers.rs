//! Layers (measure.md §4): what the layers around a layer take from its light, and how much of its shading depends on the radius.
//!
//! Feature-driven ambient occlusion (fdAO §4) gives each layer the occlusion of its own matter. How dark a layer is against another says
//! little, for thick matter hides itself; what counts is the share of its own light that others leave it, `A_LAO / A_own`, which is 1 by
//! definition with features, and how its factor changes with the radius, `A(R)/A(8)`, which is what the paper's Fig. 4 shows.

use super::radius::{LAYERS, members};
use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use cao_model::builtin::builtin_box;
use cao_model::methods::Method;
use cao_model::settings::Setup;
use cao_twin::rays::rays::rays_at;
use cao_twin::{Grid, each};

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along an edge of the volume.
    pub edge: usize,
    /// Voxels of each layer that are looked at.
    pub voxels: usize,
    /// Opacity a voxel of every layer.
    pub opacity: f32,
    /// Radii in voxels; the first is what the others are compared with.
    pub radii: Vec<f64>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        let (edge, voxels, radii) = match effort {
            Effort::Full => (128, 400, vec![8.0, 11.0, 16.0, 23.0, 32.0]),
            Effort::Quick => (96, 60, vec![8.0, 16.0, 32.0]),
        };
        Self { edge, voxels, opacity: 0.12, radii }
    }
}

/// Values of the layers' features, in the order of [`LAYERS`]: from, to.
const FEATURES: [[f64; 2]; 4] = [[190.0, 226.0], [20.0, 60.0], [60.0, 130.0], [160.0, 190.0]];

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let volume = builtin_box("fruit", [plan.edge; 3], [1.0; 3])?;
    let grid = Grid { dims: volume.dims, spacing: volume.spacing };
    let field = |low: f64, high: f64| -> Vec<f32> {
        let of = |i| if (low..high).contains(&volume.value(i)) { plan.opacity } else { 0.0 };
        (0..grid.len()).map(of).collect()
    };
    let all = field(20.0, f64::INFINITY);
    let (mut shares, mut by_lao, mut by_own) = (Vec::new(), Vec::new(), Vec::new());
    for (layer, [low, high]) in FEATURES.into_iter().enumerate() {
        let own = field(low, high);
        let voxels = members(&grid, plan.voxels, |i| own[i] > 0.0).swap_remove(layer);
        let at = |opacity: &[f32], radius: f64| {
            let mut occlusion = Setup::of(Method::Rays, 1.0).occlusion;
            occlusion.radius_mm = radius as f32;
            super::mean(&each(voxels.len(), |i| rays_at(&grid, opacity, &occlusion, 1.0, voxels[i])))
        };
        let mut curves = [Vec::new(), Vec::new()];
        for (n, &radius) in plan.radii.iter().enumerate() {
            curves[0].push([radius, at(&all, radius)]);
            curves[1].push([radius, at(&own, radius)]);
            let done = (layer * plan.radii.len() + n + 1) as f64;
            progress(done / (FEATURES.len() * plan.radii.len()) as f64);
        }
        let [lao, own] = curves;
        let name = LAYERS[layer].0;
        let share = lao.iter().zip(&own).map(|(l, o)| [l[0], l[1] / o[1]]);
        shares.push(Series::control(format!("{name}, LAO"), share.collect()));
        let change = |points: &[[f64; 2]]| points.iter().map(|p| [p[0], p[1] / points[0][1]]).collect();
        by_lao.push(Series::control(format!("{name}, LAO"), change(&lao)));
        by_own.push(Series::ours(format!("{name}, fdAO (ours)"), change(&own)));
    }
    let last = plan.radii[plan.radii.len() - 1];
    // Inside the rind.
    let keeps = (1..LAYERS.len()).all(|n| by_own[n].at(last) >= by_lao[n].at(last));
    let told = |n: usize| {
        format!(
            "{} {} of its own light ({} of what it has at {} voxels, with features {})",
            LAYERS[n].0,
            short(shares[n].at(last)),
            short(by_lao[n].at(last)),
            short(plan.radii[0]),
            short(by_own[n].at(last))
        )
    };
    let told: Vec<String> = (0..LAYERS.len()).map(told).collect();
    shares.push(Series::ours(
        "every layer, fdAO (ours)",
        plan.radii.iter().map(|&radius| [radius, 1.0]).collect(),
    ));
    let control_fails = (1..LAYERS.len()).all(|n| shares[n].at(last) < 0.9);
    Ok(Finding {
        sentence: format!(
            "At {} voxels LAO leaves {}; feature-driven occlusion leaves each all of it, and {} more with the radius than by LAO.",
            short(last),
            told.join(", "),
            if keeps { "no inner layer changes" } else { "AN INNER layer changes" }
        ),
        ours: Ours::holding(keeps),
        control_fails,
        setting: format!(
            "fruit {}³, every layer of opacity {} a voxel and a feature by its values, {} rays by brick, {} voxels of each layer",
            plan.edge,
            plan.opacity,
            Method::Rays.rays().name(),
            plan.voxels
        ),
        charts: vec![
            Chart {
                title: "What others leave a layer of its own light".into(),
                x: Quantity::log("radius, voxels"),
                y: Quantity::linear("A / A of its own matter alone"),
                series: shares,
            },
            Chart {
                title: "How a layer changes with the radius".into(),
                x: Quantity::log("radius, voxels"),
                y: Quantity::linear("A / A at the smallest radius"),
                series: by_lao.into_iter().chain(by_own).collect(),
            },
        ],
    })
}
