//! Shape (measure.md §4): what is left of each method's error after the best affine fit, in matter of two kinds: a sheet that is everywhere curved
//! alike (a gyroid), and balls of many sizes anywhere.
//!
//! Tone is forgiven, so that what is left is where a method takes one place for darker than another and it is not. Methods that mix matter of all
//! distances or directions err in balls far more than in a gyroid, whose places are all alike. Control: the mean of a box. Ours: rays.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::error::{errors, shape_errors};
use crate::plot::short;
use crate::random::Random;
use cao_model::occlusion::{Integral, Occlusion, Quadrature, RaySet};
use cao_model::options::{Levels, Options};
use cao_twin::Grid;
use cao_twin::cones::cone::cones_at;
use cao_twin::measure::reference::reference;
use cao_twin::rays::rays::rays_at;
use cao_twin::spao::product::Shells;
use cao_twin::tables::boxes::box_at;
use cao_twin::vicinity::vicinity::vicinity;
use std::f64::consts::TAU;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along the edges; the radius is a quarter of it.
    pub edge: usize,
    /// Voxels with opacity that are compared.
    pub voxels: usize,
    /// Directions of the ambient integral.
    pub directions: u32,
    /// Largest opacities.
    pub peaks: Vec<f64>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { edge: 64, voxels: 1000, directions: 300, peaks: vec![0.1, 0.5, 1.0] },
            Effort::Quick => Self { edge: 24, voxels: 60, directions: 60, peaks: vec![0.5, 1.0] },
        }
    }
}

/// What is in the volume.
#[derive(Clone, Copy, Debug)]
enum Matter {
    /// The sheet between the two halves of a gyroid of two periods.
    Gyroid,
    /// 40 balls of a 20th to a 7th of the volume's edge, a voxel's ramp at their surface.
    Balls,
}

const BALLS: usize = 40;

impl Matter {
    fn opacity(self, grid: &Grid, peak: f64) -> Vec<f32> {
        let edge = grid.dims[0] as f64;
        let mut random = Random::new(7);
        let balls: Vec<[f64; 4]> = (0..BALLS)
            .map(|_| {
                let mut between = |low: f64, high: f64| f64::from(random.between(low as f32, high as f32));
                [between(0.0, edge), between(0.0, edge), between(0.0, edge), between(edge / 20.0, edge / 7.0)]
            })
            .collect();
        let inside = |voxel: [usize; 3]| -> f64 {
            let p = voxel.map(|c| c as f64);
            match self {
                Self::Gyroid => {
                    let [x, y, z] = p.map(|c| 2.0 * c * TAU / edge);
                    let sheet = x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos();
                    (1.0 - sheet.abs() / 0.4).max(0.0)
                }
                Self::Balls => {
                    let of = |b: &[f64; 4]| {
                        let away = (0..3).map(|i| (p[i] - b[i]).powi(2)).sum::<f64>().sqrt();
                        (b[3] - away + 0.5).clamp(0.0, 1.0)
                    };
                    balls.iter().map(of).fold(0.0, f64::max)
                }
            }
        };
        (0..grid.len()).map(|i| (peak * inside(grid.voxel(i))) as f32).collect()
    }
}

/// The methods, in the order of [`values`].
const NAMES: [&str; 8] = [
    "rays by brick, 26 (ours)",
    "SPAO, N-buffers",
    "SPAO, mip levels",
    "box mean",
    "16 shells",
    "cones, 14w",
    "cones, 26w",
    "vicinity",
];

/// The control.
const BOX: usize = 3;

/// Values of each method at these voxels.
fn values(grid: &Grid, opacity: &[f32], radius: f64, voxels: &[[usize; 3]]) -> [Vec<f64>; 8] {
    let by =
        |rays, quadrature| Occlusion { rays, quadrature, radius_mm: radius as f32, ..Occlusion::paper(1.0) };
    let spao = |levels| {
        let shells = Shells::new(grid, opacity, radius, &Options { levels, ..Options::DEFAULT }, 1.0);
        voxels.iter().map(|v| shells.value(*v)).collect()
    };
    let boxes = |quadrature, shells| {
        let occlusion = by(RaySet::None, quadrature);
        voxels.iter().map(|v| box_at(grid, opacity, &occlusion, shells, 1.0, *v)).collect()
    };
    let cones = |rays| cones_at(grid, opacity, &by(rays, Quadrature::Mean), voxels);
    let rays = by(RaySet::W26, Quadrature::Hybrid);
    let parts: Vec<u16> = opacity.iter().map(|a| (65535.0 * a).round() as u16).collect();
    let lines = vicinity(grid, &parts, &by(RaySet::W26, Quadrature::Visible), 1.0, false);
    [
        voxels.iter().map(|v| rays_at(grid, opacity, &rays, 1.0, *v)).collect(),
        spao(Levels::Nbuffer),
        spao(Levels::Mip),
        boxes(Quadrature::Box, 1),
        boxes(Quadrature::Mean, 16),
        cones(RaySet::W14),
        cones(RaySet::W26),
        // Of a hemisphere.
        voxels.iter().map(|v| 0.5 * lines[grid.index(*v)]).collect(),
    ]
}

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let grid = Grid { dims: [plan.edge; 3], spacing: [1.0; 3] };
    let radius = plan.edge as f64 / 4.0;
    let integral = Integral::ambient(radius, 0.5, 2, plan.directions, 1.0);
    let (mut charts, mut worst, mut done) = (Vec::new(), Vec::new(), 0);
    for (matter, title) in [(Matter::Gyroid, "a gyroid"), (Matter::Balls, "balls")] {
        let (mut shape, mut bias) = (vec![Vec::new(); NAMES.len()], vec![Vec::new(); NAMES.len()]);
        for &peak in &plan.peaks {
            let opacity = matter.opacity(&grid, peak);
            // Steps that share no factor with the volume's size come everywhere.
            let anywhere = (0..grid.len()).map(|i| grid.voxel(i * 104_729 % grid.len()));
            let solid = anywhere.filter(|voxel| opacity[grid.index(*voxel)] > 0.0);
            let voxels: Vec<[usize; 3]> = solid.take(plan.voxels).collect();
            let floats = |values: Vec<f64>| values.into_iter().map(|v| v as f32).collect::<Vec<f32>>();
            let places: Vec<[f64; 3]> = voxels.iter().map(|v| v.map(|c| c as f64)).collect();
            let truth = floats(reference(&grid, &opacity, &integral, 1.0, &places));
            for (n, found) in values(&grid, &opacity, radius, &voxels).into_iter().enumerate() {
                let (found, counts) = (floats(found), vec![true; truth.len()]);
                shape[n].push([peak, shape_errors(&found, &truth, &counts).0.rmse]);
                bias[n].push([peak, errors(&found, &truth, &counts).bias]);
            }
            done += 1;
            progress(f64::from(done) / (2 * plan.peaks.len()) as f64);
        }
        let last = plan.peaks.len() - 1;
        worst.push([shape[0][last][1], shape[BOX][last][1]]);
        for (what, points) in [("What no tone mends", shape), ("Bias", bias)] {
            let of = |(n, points): (usize, Vec<[f64; 2]>)| match n {
                0 => Series::ours(NAMES[0], points),
                _ => Series::control(NAMES[n], points),
            };
            charts.push(Chart {
                title: format!("{what} in {title}"),
                x: Quantity::linear("largest opacity"),
                y: Quantity::linear(match what {
                    "Bias" => "mean of found − true",
                    _ => "RMSE after the best affine fit",
                }),
                series: points.into_iter().enumerate().map(of).collect(),
            });
        }
    }
    let [gyroid, balls] = [worst[0], worst[1]];
    Ok(Finding {
        sentence: format!(
            "After the best fit of tone the mean of a box is off by {} RMS in a gyroid and {} in balls of opacity {}; rays, ours, by {} and {}.",
            short(gyroid[1]),
            short(balls[1]),
            short(plan.peaks[plan.peaks.len() - 1]),
            short(gyroid[0]),
            short(balls[0]),
        ),
        ours: Ours::holding(gyroid[0] < 0.5 * gyroid[1] && balls[0] < 0.5 * balls[1]),
        control_fails: balls[1] > 0.1,
        setting: format!(
            "{}³ voxels, radius {} voxels, {} voxels with opacity against the ambient integral of {} directions",
            plan.edge, radius, plan.voxels, plan.directions
        ),
        charts,
    })
}
