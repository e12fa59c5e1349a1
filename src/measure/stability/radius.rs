//! Radius (measure.md §4): how dark LAO makes layers that lie inside others, as its radius grows.
//!
//! Nested translucent shells, each to be seen through the ones around it: a large radius gives the outer ones their shape, and
//! buries the inner ones, whose rays all end in a shell. The trial shows where ours, being LAO, stops being of use; feature-driven ambient
//! occlusion is the answer to this, and has a trial of its own, [`super::layers`].

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use crate::random::Random;
use cao_model::builtin::builtin_box;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_twin::cast::lao::lao_at;
use cao_twin::rays::rays::rays_at;
use cao_twin::{Grid, each};

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along an edge of the volume.
    pub edge: usize,
    /// Voxels of each layer that are looked at.
    pub voxels: usize,
    /// Radii in voxels.
    pub radii: Vec<f64>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self {
                edge: 128,
                voxels: 400,
                radii: vec![4.0, 6.0, 8.0, 11.0, 16.0, 23.0, 32.0, 45.0, 64.0],
            },
            Effort::Quick => Self { edge: 96, voxels: 60, radii: vec![4.0, 8.0, 16.0, 32.0, 64.0] },
        }
    }
}

/// The fruit's layers from outside in: name, and range of the distance from the centre (half-edge 1, z stretched).
pub(super) const LAYERS: [(&str, f64, f64); 4] =
    [("rind", 0.87, 0.91), ("pith", 0.79, 0.85), ("flesh", 0.45, 0.7), ("core", 0.265, 0.295)];

/// Opacity of the rind, and of everything inside it: enough to be seen, and to see through.
const OPACITY: f32 = 0.12;

/// An inner layer whose ambient factor is below this share of the rind's has lost what sets it off: it reads as shadow.
pub const BURIED: f64 = 0.5;

/// So many voxels of each layer of a cubic fruit, of those that show.
pub(super) fn members(grid: &Grid, voxels: usize, shows: impl Fn(usize) -> bool) -> Vec<Vec<[usize; 3]>> {
    let mut random = Random::new(1);
    let half = grid.dims[0] as f64 / 2.0;
    let of_layer = |&(_, low, high): &(&str, f64, f64)| {
        let mut found = Vec::new();
        for _ in 0..100_000 {
            let voxel = grid.voxel(random.below(grid.len() as u64) as usize);
            let [x, y, z] = voxel.map(|c| (c as f64 + 0.5 - half) / half);
            let r = (x * x + y * y + (z / 0.92) * (z / 0.92)).sqrt();
            if found.len() < voxels && (low..high).contains(&r) && shows(grid.index(voxel)) {
                found.push(voxel);
            }
        }
        found
    };
    LAYERS.iter().map(of_layer).collect()
}

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let volume = builtin_box("fruit", [plan.edge; 3], [1.0; 3])?;
    let grid = Grid { dims: volume.dims, spacing: volume.spacing };
    let opacity: Vec<f32> =
        (0..grid.len()).map(|i| if volume.value(i) > 20.0 { OPACITY } else { 0.0 }).collect();
    let members = members(&grid, plan.voxels, |i| opacity[i] > 0.0);
    let mut curves = vec![Vec::new(); LAYERS.len()];
    // How far a layer's mean by brick is from that by the sampler, at most, along the same rays.
    let mut off = [Quadrature::Nearest, Quadrature::Hybrid].map(|rule| (rule, 0.0_f64));
    for (n, &radius) in plan.radii.iter().enumerate() {
        let occlusion = Occlusion {
            rays: RaySet::R26,
            quadrature: Quadrature::Segment,
            radius_mm: radius as f32,
            offset_mm: None,
            step_mm: None,
            ..Occlusion::paper(1.0)
        };
        for (curve, voxels) in curves.iter_mut().zip(&members) {
            let values = each(voxels.len(), |i| lao_at(&grid, &opacity, &occlusion, 1.0, voxels[i]));
            let cast = super::mean(&values);
            curve.push([radius, cast]);
            for (quadrature, off) in &mut off {
                let occlusion = Occlusion { quadrature: *quadrature, ..occlusion };
                let values = each(voxels.len(), |i| rays_at(&grid, &opacity, &occlusion, 1.0, voxels[i]));
                *off = off.max((super::mean(&values) - cast).abs());
            }
        }
        progress((n + 1) as f64 / plan.radii.len() as f64);
    }
    let series: Vec<Series> = LAYERS
        .iter()
        .zip(curves)
        .map(|(&(name, ..), points)| Series::ours(format!("{name}, LAO (ours)"), points))
        .collect();
    let rind = &series[0];
    // The darkest layer inside the rind, as a share of the rind, at each radius.
    let darkest = |n: usize| {
        let of = |layer: usize| (series[layer].points[n][1] / rind.points[n][1], layer);
        (1..LAYERS.len()).map(of).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((1.0, 0))
    };
    let shares: Vec<(f64, usize)> = (0..plan.radii.len()).map(darkest).collect();
    let (first, last) = (shares[0], shares[shares.len() - 1]);
    let buried = shares.iter().position(|(share, _)| *share < BURIED);
    let radius = |n: usize| short(plan.radii[n]);
    let from = match buried {
        Some(n) => format!("less than {BURIED} from {} voxels on", radius(n)),
        None => format!("never less than {BURIED}"),
    };
    let inner = &series[last.1];
    Ok(Finding {
        sentence: format!(
            "LAO, ours included, darkens inner layers as its radius grows: the {} from {} at {} voxels to {} at {}, which is {} of the rind's \
             and {from} (at {} voxels the darkest has {}); the means of rays by brick are within {} of these with the nearest voxel and {} with the rule hybrid; \
             feature-driven occlusion keeps them light (trial layers).",
            LAYERS[last.1].0,
            short(inner.points[0][1]),
            radius(0),
            short(inner.points[shares.len() - 1][1]),
            radius(shares.len() - 1),
            short(last.0),
            radius(0),
            short(first.0),
            short(off[0].1),
            short(off[1].1),
        ),
        ours: if buried.is_some() { Ours::Limited } else { Ours::Holds },
        control_fails: last.0 < first.0,
        setting: format!(
            "fruit {}³, every layer of opacity {OPACITY} a voxel, 26 rays, segment rule, {} voxels of each layer",
            plan.edge, plan.voxels
        ),
        charts: vec![Chart {
            title: "Ambient factor of nested layers".into(),
            x: Quantity::log("radius, voxels"),
            y: Quantity::log("mean ambient factor of the layer (0 … 1)"),
            series,
        }],
    })
}
