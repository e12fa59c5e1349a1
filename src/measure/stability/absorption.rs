//! Absorption (measure.md §4): whether an opaque sheet one voxel thick hides what lies behind it.
//!
//! The voxel in front of the sheet, against the one in front of a half-space: in truth both see the same, and the share is 1. A histogram of
//! the neighbourhood counts voxels, wherever they lie, so that a sheet counts little and what is behind it the rest. Control: that. Ours: rays.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use cao_kernels::histogram::WHOLE_SHARE;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_twin::Grid;
use cao_twin::histograms::histogram::{bins, histogram};
use cao_twin::rays::rays::rays_at;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Radii in voxels.
    pub radii: Vec<u32>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { radii: (3..=12).collect() },
            Effort::Quick => Self { radii: vec![3, 6, 12] },
        }
    }
}

/// The voxel, and the first layer of matter.
const AT: [usize; 3] = [13, 13, 13];
const FIRST: usize = 12;

/// A share below this leaves most of what is hidden in sight.
const HALF: f64 = 0.5;

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let grid = Grid { dims: [27; 3], spacing: [1.0; 3] };
    let matter = |thick: usize| -> Vec<f32> {
        let of = |z: usize| f32::from(u8::from(z <= FIRST && z + thick > FIRST));
        (0..grid.len()).map(|i| of(grid.voxel(i)[2])).collect()
    };
    let (sheet, solid) = (matter(1), matter(FIRST + 1));
    let (mut ours, mut control, mut lost) = (Vec::new(), Vec::new(), Vec::new());
    for (n, &radius) in plan.radii.iter().enumerate() {
        let radius_mm = radius as f32;
        let occlusion = Occlusion {
            rays: RaySet::Spiral(192),
            quadrature: Quadrature::Hybrid,
            radius_mm,
            ..Occlusion::paper(1.0)
        };
        let of_rays = |opacity: &[f32]| 1.0 - rays_at(&grid, opacity, &occlusion, 1.0, AT);
        // Of values 0 and 1 the last bin is what is opaque.
        let of_bins = |opacity: &[f32]| {
            let found = histogram(&grid, &bins(opacity), radius_mm, AT);
            f64::from(found[found.len() - 1]) / f64::from(WHOLE_SHARE)
        };
        ours.push([f64::from(radius), of_rays(&sheet) / of_rays(&solid)]);
        control.push([f64::from(radius), of_bins(&sheet) / of_bins(&solid)]);
        lost.push(of_bins(&sheet));
        progress((n + 1) as f64 / plan.radii.len() as f64);
    }
    let ours = Series::ours("rays by brick (ours)", ours);
    let control = Series::control("local histograms", control);
    let last = plan.radii.len() - 1;
    let least = ours.points.iter().map(|point| point[1]).fold(f64::INFINITY, f64::min);
    Ok(Finding {
        sentence: format!(
            "An opaque sheet one voxel thick takes {} of the light in a histogram at radius {} and {} at {}, {} of what a half-space takes; of rays, \
             ours, at least {}.",
            short(lost[0]),
            plan.radii[0],
            short(lost[last]),
            plan.radii[last],
            short(control.points[last][1]),
            short(least),
        ),
        ours: Ours::holding(least > 1.0 - 0.5 * HALF),
        control_fails: control.points[last][1] < HALF,
        setting: "opaque sheet and half-space, the first empty voxel in front, 192 rays".into(),
        charts: vec![Chart {
            title: "What a sheet hides of what a half-space hides".into(),
            x: Quantity::linear("radius, voxels"),
            y: Quantity::linear("occlusion by the sheet / by the half-space (truth: 1)"),
            series: vec![ours, control],
        }],
    })
}
