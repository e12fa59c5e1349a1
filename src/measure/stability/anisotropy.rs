//! Anisotropic voxels (measure.md §4): how much the ambient factor depends on which way the same scene is turned, as voxels grow
//! longer along z.
//!
//! A wall in front of a point, once across x and once across z: the same in millimetres. Ours casts rays of equal angles and steps in
//! millimetres. Control: rays and steps in voxels, as on a grid that is taken for cubic. Yardstick: the ambient integral of the same
//! fields, whose difference is the voxels' own: they blur what is across z.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use cao_model::occlusion::{Integral, Occlusion, Quadrature, RaySet};
use cao_twin::Grid;
use cao_twin::cast::lao::lao_at;
use cao_twin::measure::reference::reference;

/// Values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Length of a voxel along z; along x and y it is 1 mm.
    pub ratios: Vec<f64>,
    /// Distances of the wall in mm, over which errors are averaged.
    pub walls: usize,
    /// Directions of the truth.
    pub directions: u32,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { ratios: super::evenly(1.0, 8.0, 15), walls: 12, directions: 600 },
            Effort::Quick => Self { ratios: vec![1.0, 2.0, 4.0, 8.0], walls: 4, directions: 300 },
        }
    }
}

/// Radius in mm.
const RADIUS: f32 = 16.0;

/// Nearest and farthest wall in mm: beyond half of the longest voxel.
const WALLS: [f64; 2] = [5.0, 11.0];

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let [mut paper, mut weighted, mut voxels, mut truth] = [const { Vec::new() }; 4];
    for (n, &ratio) in plan.ratios.iter().enumerate() {
        let [mut p, mut w, mut v, mut t] = [const { Vec::new() }; 4];
        for wall in super::evenly(WALLS[0], WALLS[1], plan.walls) {
            let [x, z] = [0, 2].map(|axis| Scene::new(ratio, axis, wall));
            let bias = |of: &dyn Fn(&Scene) -> f64| (of(&z) - of(&x)).abs();
            p.push(bias(&|s| s.ambient(RaySet::R26, Quadrature::Left)));
            w.push(bias(&|s| s.ambient(RaySet::W50, Quadrature::Segment)));
            v.push(bias(&|s| s.in_voxels(RaySet::R26, Quadrature::Left)));
            t.push(bias(&|s| s.truth(plan.directions)));
        }
        for (curve, values) in [(&mut paper, p), (&mut weighted, w), (&mut voxels, v), (&mut truth, t)] {
            curve.push([ratio, super::mean(&values)]);
        }
        progress((n + 1) as f64 / plan.ratios.len() as f64);
    }
    let voxels = Series::control("rays and steps in voxels, 26 rays, eq. (2)", voxels);
    let paper = Series::ours("rays and steps in mm (ours), 26 rays, eq. (2)", paper);
    let weighted = Series::ours("rays and steps in mm (ours), 50w rays, segment rule", weighted);
    let truth = Series::yardstick("ambient integral of the same fields: the voxels' own blur", truth);
    let last = plan.ratios[plan.ratios.len() - 1];
    let excess = |series: &Series| {
        let pairs = series.points.iter().zip(&truth.points);
        pairs.map(|(s, t)| s[1] - t[1]).fold(0.0, f64::max)
    };
    let first_bad = voxels.points.iter().zip(&truth.points).find(|(v, t)| v[1] > t[1] + BIAS);
    let holds = excess(&paper).max(excess(&weighted)) <= BIAS;
    Ok(Finding {
        sentence: format!(
            "Rays that count in voxels make the ambient factor depend on the orientation {}: by {} at 1:1:{}; {} {} (50w and segment \
             rule: {}), where the voxels' own blur accounts for {}.",
            match first_bad {
                Some((point, _)) => format!("from a spacing of 1:1:{} on", short(point[0])),
                None => "nowhere".into(),
            },
            short(voxels.at(last)),
            short(last),
            if holds { "ours, in millimetres, by" } else { "OURS by" },
            short(paper.at(last)),
            short(weighted.at(last)),
            short(truth.at(last)),
        ),
        ours: Ours::holding(holds),
        control_fails: excess(&voxels) > BIAS,
        setting: format!(
            "wall {} … {} mm in front of a voxel, across x against across z, radius {RADIUS} mm; means over {} walls; truth: {} directions, \
             1/8 voxel",
            WALLS[0], WALLS[1], plan.walls, plan.directions
        ),
        charts: vec![Chart {
            title: "Orientation bias of the ambient factor".into(),
            x: Quantity::linear("length of a voxel along z, mm (1 mm along x and y)"),
            y: Quantity::linear("mean |A across z − A across x| (0 … 1)"),
            series: vec![voxels, truth, paper, weighted],
        }],
    })
}

/// Bias of the ambient factor that sampling may add to the voxels' own: a few steps of an 8-bit display.
pub const BIAS: f64 = 0.02;

/// A voxel in front of an opaque wall.
struct Scene {
    grid: Grid,
    opacity: Vec<f32>,
    /// The voxel.
    eye: [usize; 3],
}

impl Scene {
    /// The wall begins `wall` mm from the voxel's centre along `axis`, at larger coordinates.
    fn new(ratio: f64, axis: usize, wall: f64) -> Self {
        let spacing = [1.0, 1.0, ratio];
        // In voxels as far as in mm, for the control's sake, and one more that the last sample interpolates.
        let eye = [RADIUS as usize + 2; 3];
        let grid = Grid { dims: eye.map(|c| 2 * c + 1), spacing };
        let opacity = (0..grid.len())
            .map(|i| {
                let at = (grid.voxel(i)[axis] as f64 - eye[axis] as f64) * spacing[axis];
                // Share of the voxel's length that lies in the wall.
                ((at - wall) / spacing[axis] + 0.5).clamp(0.0, 1.0) as f32
            })
            .collect();
        Self { grid, opacity, eye }
    }

    fn occlusion(rays: RaySet, quadrature: Quadrature) -> Occlusion {
        Occlusion { rays, quadrature, radius_mm: RADIUS, ..Occlusion::paper(1.0) }
    }

    fn ambient(&self, rays: RaySet, quadrature: Quadrature) -> f64 {
        lao_at(&self.grid, &self.opacity, &Self::occlusion(rays, quadrature), 1.0, self.eye)
    }

    /// As if the voxels were cubes of 1 mm.
    fn in_voxels(&self, rays: RaySet, quadrature: Quadrature) -> f64 {
        let cubes = Grid { spacing: [1.0; 3], ..self.grid };
        lao_at(&cubes, &self.opacity, &Self::occlusion(rays, quadrature), 1.0, self.eye)
    }

    fn truth(&self, directions: u32) -> f64 {
        let integral = Integral::ambient(f64::from(RADIUS), 0.5, 8, directions, self.grid.min_spacing());
        reference(&self.grid, &self.opacity, &integral, 1.0, &[self.eye.map(|c| c as f64)])[0]
    }
}
