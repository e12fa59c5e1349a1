//! Mip blocks (measure.md §4): what a method that looks up halved volumes makes of a wall that is moved by whole voxels, which changes nothing.
//!
//! Cells of a mip level lie where they lie; a look-up between two of them is no cube around the voxel, and moved out along the normal it finds
//! another share of the wall at each position. Control: SPAO by mip levels with normals (SPAO §1.2.3, §1.3). Yardsticks: its other forms.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use cao_model::methods::Method;
use cao_model::occlusion::Occlusion;
use cao_model::options::{Levels, Options};
use cao_twin::rays::rays::rays_at;
use cao_twin::spao::product::product_at;
use cao_twin::{Grid, each};

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Positions of the wall in voxels.
    pub positions: Vec<usize>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { positions: (0..32).collect() },
            Effort::Quick => Self { positions: (0..16).collect() },
        }
    }
}

/// Radius in voxels: five levels.
const RADIUS: f32 = 16.0;

/// Edge of the volume, and the wall's face at position 0.
const EDGE: usize = 112;
const FACE: usize = 40;

/// Values of one and the same place that differ by more than this are seen as blocks.
pub const BLOCKS: f64 = 0.05;

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let grid = Grid { dims: [EDGE; 3], spacing: [1.0; 3] };
    let rays = Method::Rays;
    let occlusion = Occlusion {
        rays: rays.rays(),
        quadrature: rays.quadrature(),
        radius_mm: RADIUS,
        ..Occlusion::paper(1.0)
    };
    let forms = [Levels::Mip, Levels::Nbuffer, Levels::Reversed(3), Levels::Mixed(1)];
    let found = each(plan.positions.len(), |n| {
        let face = FACE + plan.positions[n];
        let opacity: Vec<f32> = (0..grid.len()).map(|i| f32::from(grid.voxel(i)[2] < face)).collect();
        // The wall's first solid layer.
        let voxel = [EDGE / 2, EDGE / 2, face - 1];
        let mut values = forms.map(|levels| {
            let options = Options { levels, normal: 1.0, ..Options::DEFAULT };
            product_at(&grid, &opacity, f64::from(RADIUS), &options, 1.0, voxel)
        });
        values.rotate_left(1);
        let [nbuffer, reversed, mixed, mip] = values;
        [mip, rays_at(&grid, &opacity, &occlusion, 1.0, voxel), nbuffer, reversed, mixed]
    });
    progress(1.0);
    let curve = |of: usize| plan.positions.iter().zip(&found).map(|(x, f)| [*x as f64, f[of]]).collect();
    let mip = Series::control("SPAO, mip levels, normal 1", curve(0));
    let ours = Series::ours("rays by brick (ours)", curve(1));
    let nbuffer = Series::yardstick("SPAO, N-buffers, normal 1", curve(2));
    let reversed = Series::yardstick("SPAO, reversed:3, normal 1", curve(3));
    let mixed = Series::yardstick("SPAO, mixed:1, normal 1", curve(4));
    let range = |series: &Series| {
        let least = series.points.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
        [least, series.largest()]
    };
    let spread = |series: &Series| range(series)[1] - range(series)[0];
    let said = |series: &Series| {
        let [low, high] = range(series).map(|value| format!("{value:.3}"));
        if low == high { low } else { format!("{low} to {high}") }
    };
    Ok(Finding {
        sentence: format!(
            "The first layer of one and the same wall has {} by mip levels with normals, {} by mixed:1, {} by reversed:3 and {} by N-buffers, as \
             the wall moves over {} positions; ours differs by {}.",
            said(&mip),
            said(&mixed),
            said(&reversed),
            said(&nbuffer),
            plan.positions.len(),
            short(spread(&ours)),
        ),
        ours: Ours::holding(spread(&ours) <= BLOCKS),
        control_fails: spread(&mip) > 2.0 * BLOCKS,
        setting: format!(
            "opaque half-space, its first layer; radius {RADIUS} voxels; ours: {} {}",
            occlusion.rays.name(),
            occlusion.quadrature.name()
        ),
        charts: vec![Chart {
            title: "A wall that is moved by whole voxels".into(),
            x: Quantity::linear("position, voxels"),
            y: Quantity::linear("ambient factor of its first layer"),
            series: vec![mip, ours, nbuffer, reversed, mixed],
        }],
    })
}
