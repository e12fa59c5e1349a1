//! Labels (measure.md §4): what a segmentation that is off does to feature-driven ambient occlusion (fdAO §4.2), and the artefacts at
//! borders of features for which the paper gave up its first rules.
//!
//! A label map of the fruit's layers is shifted by some voxels; opacities are what they were. Measured are the change of the ambient factor,
//! and *flips*: touching voxels of two features, both to be seen, whose factors are more than [`JUMP`] apart, which a ray that interpolates
//! them shows as dots (Fig. 3a).

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_model::builtin::builtin_box;
use cao_model::feature::{Feature, Features};
use cao_model::methods::Method;
use cao_model::options::Options;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_twin::Grid;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along an edge of the volume.
    pub edge: usize,
    /// Voxels by which labels are shifted along x.
    pub shifts: Vec<usize>,
    /// In voxels.
    pub radius: f32,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        let edge = if effort == Effort::Full { 64 } else { 40 };
        Self { edge, shifts: vec![0, 1, 2, 3], radius: 12.0 }
    }
}

/// Apart by so much, neighbours are seen to be.
pub const JUMP: f32 = 0.2;

/// Rules with one value a voxel.
const RULES: [&str; 3] = ["own", "neighbours", "max"];

/// Names and first values of the fruit's layers, and the end of the last.
const LAYERS: [(&str, f64); 5] =
    [("pith", 20.0), ("flesh", 60.0), ("membranes", 130.0), ("core", 160.0), ("rind", 190.0)];

/// Runs the trial, telling the share done. Uses the device's queue and waits for it.
pub fn run(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let volume = builtin_box("fruit", [plan.edge; 3], [1.0; 3])?;
    let grid = Grid { dims: volume.dims, spacing: volume.spacing };
    // Soft flesh and pith, hard rind and core.
    let opacity = vec![[20.0, 0.0], [25.0, 0.1], [130.0, 0.1], [150.0, 0.7], [255.0, 0.7]];
    let transfer = TransferFunction::new(opacity, vec![[0.0, 1.0, 1.0, 1.0]], None)?;
    let labels: Vec<u8> = (0..grid.len())
        .map(|i| LAYERS.iter().filter(|(_, from)| volume.value(i) >= *from).count() as u8)
        .collect();
    let mut setup = Setup::of(Method::FeatureDriven, 1.0);
    setup.occlusion.radius_mm = plan.radius;
    let mut renderer = Renderer::new(gpu, &volume, transfer, setup, COLOUR)?;
    let total = (RULES.len() * plan.shifts.len()) as f64;
    let mut done = 0.0;
    let (mut errors, mut flips) = (Vec::new(), Vec::new());
    for rule in RULES {
        let mut right: Option<Vec<f32>> = None;
        let (mut error, mut flipped) = (Vec::new(), Vec::new());
        for &shift in &plan.shifts {
            let shifted: Vec<u8> = (0..grid.len())
                .map(|i| {
                    let [x, y, z] = grid.voxel(i);
                    labels[grid.index([x.saturating_sub(shift), y, z])]
                })
                .collect();
            let list = LAYERS.iter().map(|(name, _)| Feature::new(*name)).collect();
            renderer.set_features(Features::by_labels(list, volume.dims, shifted.clone())?)?;
            renderer.set_setup(Setup { options: Options::DEFAULT.with(&[("combine", rule)])?, ..setup })?;
            renderer.update(&mut |_| ())?;
            let (found, shows) = (renderer.read_ambient()?, renderer.read_opacity()?);
            let right = right.get_or_insert_with(|| found.clone());
            let of: Vec<f64> = (0..grid.len())
                .filter(|&i| shows[i] > 0.0)
                .map(|i| f64::from((found[i] - right[i]).abs()))
                .collect();
            error.push([shift as f64, super::mean(&of)]);
            flipped.push([shift as f64, flips_of(&grid, &shifted, &shows, &found)]);
            done += 1.0;
            progress(done / total);
        }
        errors.push(Series::control(format!("fdAO, {rule}"), error));
        flips.push(Series::control(format!("fdAO, {rule}"), flipped));
    }
    let last = plan.shifts[plan.shifts.len() - 1] as f64;
    let at = |list: &[Series], x: f64| {
        let values = RULES.iter().zip(list).map(|(rule, series)| format!("{} {rule}", short(series.at(x))));
        values.collect::<Vec<_>>().join(", ")
    };
    let grows = errors.iter().all(|series| series.at(last) > 0.0);
    Ok(Finding {
        sentence: format!(
            "With labels {} voxels off the ambient factor changes by {} in the mean (1 voxel: {}); with right labels {} % of touching voxels \
             of two features are more than {JUMP} apart.",
            short(last),
            at(&errors, last),
            at(&errors, 1.0),
            at(&flips, 0.0),
        ),
        ours: if grows { Ours::Limited } else { Ours::Holds },
        control_fails: flips[0].at(0.0) > flips[2].at(0.0),
        setting: format!(
            "fruit {0}³, {1} labels, radius {2} voxels, {3}",
            plan.edge,
            LAYERS.len(),
            plan.radius,
            setup.occlusion.rays.name()
        ),
        charts: vec![
            Chart {
                title: "Labels that are off".into(),
                x: Quantity::linear("shift of the labels, voxels"),
                y: Quantity::linear("mean change of the ambient factor"),
                series: errors,
            },
            Chart {
                title: "Flips at borders".into(),
                x: Quantity::linear("shift of the labels, voxels"),
                y: Quantity::linear("touching voxels of two features far apart, %"),
                series: flips,
            },
        ],
    })
}

/// In percent of touching voxels of two features that show.
fn flips_of(grid: &Grid, labels: &[u8], shows: &[f32], factor: &[f32]) -> f64 {
    let (mut pairs, mut apart) = (0.0, 0.0);
    for i in 0..grid.len() {
        let voxel = grid.voxel(i);
        for axis in (0..3).filter(|&axis| voxel[axis] + 1 < grid.dims[axis]) {
            let mut next = voxel;
            next[axis] += 1;
            let n = grid.index(next);
            if labels[i] != labels[n] && shows[i] > 0.0 && shows[n] > 0.0 {
                pairs += 1.0;
                apart += f64::from(u8::from((factor[i] - factor[n]).abs() > JUMP));
            }
        }
    }
    100.0 * apart / f64::max(pairs, 1.0)
}
