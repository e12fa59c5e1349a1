//! A network on what it was not trained on (measure.md §4): bias, contrast and error of DVAO's, rays beside it.
//!
//! One thing at a time is moved away from an engine block with opacities as usual: opacities fade, matter fills ever more, voxels grow longer along z,
//! the block turns, other phantoms come, a plane cuts. R is the net's own, so that a voxel of the volume is one of its grid. Control: the net that is
//! shipped, by its twin. Ours: rays by brick. The truth is the ambient integral of the same opacities.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::error::{counting, errors, shape_errors};
use crate::plot::short;
use crate::random::Random;
use cao_model::builtin::{builtin, builtin_box};
use cao_model::network::Network;
use cao_model::occlusion::{Integral, Occlusion, Quadrature, RaySet};
use cao_model::transfer::TransferFunction;
use cao_model::volume::Volume;
use cao_twin::measure::reference::reference;
use cao_twin::network::predicted::predicted;
use cao_twin::rays::rays::rays_at;
use cao_twin::{Grid, trilinear_clamped};
use glam::DMat3;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along each axis. At 32 the lowest level of the net is one voxel, of which normalising leaves nothing.
    pub edge: usize,
    /// Voxels that are compared.
    pub voxels: usize,
    /// Directions of the truth.
    pub directions: u32,
    /// Factors of the opacities.
    pub scales: Vec<f64>,
    /// Shares of the volume with matter.
    pub fills: Vec<f64>,
    /// Lengths of a voxel along z.
    pub spacings: Vec<f64>,
    /// Angles around z in degrees.
    pub angles: Vec<f64>,
    /// How many of [`KINDS`], from the last.
    pub kinds: usize,
    /// Shares of the volume that are cut away.
    pub cuts: Vec<f64>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self {
                edge: 64,
                voxels: 500,
                directions: 300,
                scales: vec![0.05, 0.1, 0.2, 0.5, 1.0],
                fills: vec![0.01, 0.03, 0.1, 0.3, 0.9],
                spacings: vec![1.0, 2.0, 4.0, 8.0],
                angles: vec![0.0, 30.0, 60.0, 90.0],
                kinds: KINDS.len(),
                cuts: vec![0.1, 0.25, 0.5],
            },
            Effort::Quick => Self {
                edge: 32,
                voxels: 150,
                directions: 150,
                scales: vec![0.05, 1.0],
                fills: vec![0.01, 0.9],
                spacings: vec![8.0],
                angles: vec![45.0],
                kinds: 1,
                cuts: vec![0.5],
            },
        }
    }
}

/// Phantoms; `tools/train` trains on all but the last.
pub const KINDS: [&str; 5] = ["engine", "fruit", "skeleton", "beetle", "bucky"];
/// Radii of balls in voxels, and their opacity.
const BALLS: [f32; 2] = [2.0, 6.0];
const OPACITY: f32 = 0.5;
/// A turned block is drawn so much smaller, so that its corners stay inside.
const SMALLER: f64 = 1.4;

/// What is moved away from the usual.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sweep {
    Scale,
    Fill,
    Spacing,
    Angle,
    Kind,
    Cut,
}

impl Sweep {
    const ALL: [Self; 6] = [Self::Scale, Self::Fill, Self::Spacing, Self::Angle, Self::Kind, Self::Cut];

    /// Its name in titles, and its axis.
    fn axis(self) -> (&'static str, Quantity) {
        match self {
            Self::Scale => ("opacities fade", Quantity::log("factor of the opacities")),
            Self::Fill => ("matter fills the volume", Quantity::log("share of the voxels with matter")),
            Self::Spacing => {
                ("voxels grow longer", Quantity::log("length of a voxel along z, mm (1 mm along x and y)"))
            }
            Self::Angle => ("the block turns", Quantity::linear("angle around z, degrees")),
            Self::Kind => {
                let names = KINDS.iter().enumerate().map(|(n, name)| format!("{} {name}", n + 1));
                let names = names.collect::<Vec<_>>().join(", ");
                (
                    "other phantoms come",
                    Quantity::linear(format!("{names} (the net was not trained on the last)")),
                )
            }
            Self::Cut => ("a plane cuts", Quantity::linear("share of the volume that is cut away")),
        }
    }

    fn values(self, plan: &Plan) -> Vec<f64> {
        match self {
            Self::Scale => plan.scales.clone(),
            Self::Fill => plan.fills.clone(),
            Self::Spacing => plan.spacings.clone(),
            Self::Angle => plan.angles.clone(),
            Self::Kind => (KINDS.len() - plan.kinds..KINDS.len()).map(|n| n as f64 + 1.0).collect(),
            Self::Cut => plan.cuts.clone(),
        }
    }

    fn scene(self, value: f64, edge: usize) -> Result<Scene> {
        match self {
            Self::Scale => {
                let mut scene = Scene::of(&builtin(KINDS[0], edge)?)?;
                scene.opacity.iter_mut().for_each(|a| *a *= value as f32);
                Ok(scene)
            }
            Self::Fill => Ok(Scene::filled(value, edge)),
            Self::Spacing => {
                let slices = (edge as f64 / value).round().max(1.0) as usize;
                Scene::of(&builtin_box(KINDS[0], [edge, edge, slices], [1.0, 1.0, value])?)
            }
            Self::Angle => Scene::turned(value, edge),
            Self::Kind => Scene::of(&builtin(KINDS[value as usize - 1], edge)?),
            Self::Cut => Ok(Scene::of(&builtin(KINDS[0], edge)?)?.cut(value)),
        }
    }
}

/// Opacities per mm.
#[derive(Clone, Debug)]
struct Scene {
    grid: Grid,
    opacity: Vec<f32>,
}

impl Scene {
    /// A volume by the preset `auto`.
    fn of(volume: &Volume) -> Result<Self> {
        let transfer = TransferFunction::preset("auto", volume.range())?;
        let opacity = (0..volume.len()).map(|i| transfer.opacity_at(volume.value(i) as f32)).collect();
        Ok(Self { grid: Grid { dims: volume.dims, spacing: volume.spacing }, opacity })
    }

    /// Balls until so much of the volume has matter.
    fn filled(share: f64, edge: usize) -> Self {
        let grid = Grid { dims: [edge; 3], spacing: [1.0; 3] };
        let (mut opacity, mut random) = (vec![0.0_f32; grid.len()], Random::new(3));
        let mut solid = 0;
        while (solid as f64) < share * grid.len() as f64 {
            let centre: [f32; 3] = std::array::from_fn(|_| random.between(0.0, edge as f32));
            let radius = random.between(BALLS[0], BALLS[1]);
            let range = |axis: usize| {
                (centre[axis] - radius - 1.0).max(0.0) as usize
                    ..((centre[axis] + radius + 2.0) as usize).min(edge)
            };
            for z in range(2) {
                for y in range(1) {
                    for x in range(0) {
                        let apart =
                            (0..3).map(|i| ([x, y, z][i] as f32 - centre[i]).powi(2)).sum::<f32>().sqrt();
                        let a = OPACITY * (radius - apart + 0.5).clamp(0.0, 1.0);
                        let voxel = &mut opacity[grid.index([x, y, z])];
                        solid += usize::from(*voxel == 0.0 && a > 0.0);
                        *voxel = voxel.max(a);
                    }
                }
            }
        }
        Self { grid, opacity }
    }

    /// The block, of twice the voxels, turned around z by so many degrees: its values are interpolated, then classified.
    fn turned(degrees: f64, edge: usize) -> Result<Self> {
        let volume = builtin(KINDS[0], 2 * edge)?;
        let fine = Grid { dims: volume.dims, spacing: volume.spacing };
        let values: Vec<f32> = (0..volume.len()).map(|i| volume.value(i) as f32).collect();
        let transfer = TransferFunction::preset("auto", volume.range())?;
        let turn = DMat3::from_rotation_z(degrees.to_radians());
        let grid = Grid { dims: [edge; 3], spacing: [1.0; 3] };
        let opacity = (0..grid.len()).map(|i| {
            let middle = |n: usize| 0.5 * (n as f64 - 1.0);
            let at = turn * glam::DVec3::from(grid.voxel(i).map(|c| c as f64 - middle(edge)));
            let place = at.to_array().map(|c| 2.0 * SMALLER * c + middle(2 * edge));
            let outside = place.iter().any(|c| *c < 0.0 || *c > 2.0 * edge as f64 - 1.0);
            if outside { 0.0 } else { transfer.opacity_at(trilinear_clamped(&fine, &values, place) as f32) }
        });
        Ok(Self { opacity: opacity.collect(), grid })
    }

    /// Without the first `share` along x.
    fn cut(mut self, share: f64) -> Self {
        for i in 0..self.grid.len() {
            if (self.grid.voxel(i)[0] as f64) < share * self.grid.dims[0] as f64 {
                self.opacity[i] = 0.0;
            }
        }
        self
    }

    /// Some of the voxels that count, spread over all of them.
    fn some(&self, most: usize) -> Vec<usize> {
        let counts = counting(&self.grid, &self.opacity);
        let all: Vec<usize> = (0..self.grid.len()).filter(|i| counts[*i]).collect();
        let mut random = Random::new(5);
        let run = |i: usize| i * all.len() / most;
        match all.len() > most {
            true => {
                (0..most).map(|i| all[run(i) + random.below((run(i + 1) - run(i)) as u64) as usize]).collect()
            }
            false => all,
        }
    }
}

/// What a method is off by.
#[derive(Clone, Copy, Debug)]
struct Off {
    rmse: f64,
    bias: f64,
    /// Of the best guess of the truth by what was found: above 1 it has too little contrast.
    slope: f64,
}

/// The net and its radius.
struct Stand {
    network: Network,
    radius: f32,
    directions: u32,
}

impl Stand {
    fn net(&self, scene: &Scene) -> Vec<f32> {
        predicted(&self.network, &scene.grid, &scene.opacity, 1.0, f64::from(self.radius), false)
    }

    fn rays(&self, scene: &Scene, voxels: &[usize]) -> Vec<f32> {
        let (rays, quadrature) = (RaySet::Spiral(50), Quadrature::Hybrid);
        let occlusion = Occlusion { rays, quadrature, radius_mm: self.radius, ..Occlusion::paper(1.0) };
        // As the device has them.
        let opacity: Vec<f32> = scene.opacity.iter().map(|a| (65535.0 * a).round() / 65535.0).collect();
        voxels
            .iter()
            .map(|i| rays_at(&scene.grid, &opacity, &occlusion, 1.0, scene.grid.voxel(*i)) as f32)
            .collect()
    }

    /// Rays, then the net.
    fn judge(&self, scene: &Scene, voxels: usize) -> [Off; 2] {
        let voxels = scene.some(voxels);
        let places: Vec<[f64; 3]> = voxels.iter().map(|i| scene.grid.voxel(*i).map(|c| c as f64)).collect();
        let integral = Integral::ambient(f64::from(self.radius), 0.5, 4, self.directions, 1.0);
        let truth = reference(&scene.grid, &scene.opacity, &integral, 1.0, &places);
        let truth: Vec<f32> = truth.into_iter().map(|value| value as f32).collect();
        let net = self.net(scene);
        [self.rays(scene, &voxels), voxels.iter().map(|i| net[*i]).collect()].map(|found| {
            let counts = vec![true; truth.len()];
            let raw = errors(&found, &truth, &counts);
            Off { rmse: raw.rmse, bias: raw.bias, slope: shape_errors(&found, &truth, &counts).1.slope }
        })
    }

    /// Largest change by a cut of values that no ray from there can know of: of rays and of the net, whose values of the whole are `before`.
    fn beyond(&self, whole: &Scene, before: &[f32], share: f64, voxels: usize) -> [f64; 2] {
        let cut = whole.clone().cut(share);
        let far = share * whole.grid.dims[0] as f64 + f64::from(self.radius) + 2.0;
        let mut voxels = cut.some(8 * voxels);
        voxels.retain(|i| whole.grid.voxel(*i)[0] as f64 > far);
        let most =
            |changes: &mut dyn Iterator<Item = f32>| changes.fold(0.0, |a, b| f64::from(b.abs()).max(a));
        let [a, b] = [whole, &cut].map(|scene| self.rays(scene, &voxels));
        let after = self.net(&cut);
        [
            most(&mut a.iter().zip(&b).map(|(a, b)| a - b)),
            most(&mut voxels.iter().map(|i| after[*i] - before[*i])),
        ]
    }
}

/// The error that rays have in the chart is 0.01 or less, in voxels of 1:8 it is twice that.
pub const USUAL: f64 = 0.03;
/// As many times the error of rays the net has to err by somewhere, or the trial shows nothing.
const FAILS: f64 = 3.0;

const NAMES: [&str; 2] = ["rays, 50 (ours)", "network"];

fn series(n: usize, name: String, points: Vec<[f64; 2]>) -> Series {
    if n == 0 { Series::ours(name, points) } else { Series::control(name, points) }
}

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let network = Network::small();
    let radius = network.shape().radius();
    let stand = Stand { network, radius, directions: plan.directions };
    let steps = Sweep::ALL.iter().map(|sweep| sweep.values(plan).len()).sum::<usize>() + plan.cuts.len();
    let (mut done, mut charts) = (0, Vec::new());
    let mut tell = || {
        done += 1;
        progress(f64::from(done) / steps as f64);
    };
    // Of each sweep its values and what rays and the net are off by.
    let mut found: Vec<Vec<(f64, [Off; 2])>> = Vec::new();
    for sweep in Sweep::ALL {
        let mut offs = Vec::new();
        for value in sweep.values(plan) {
            offs.push((value, stand.judge(&sweep.scene(value, plan.edge)?, plan.voxels)));
            tell();
        }
        let (title, x) = sweep.axis();
        let curve = |n: usize, of: fn(&Off) -> f64| offs.iter().map(|(x, off)| [*x, of(&off[n])]).collect();
        let both = [("RMSE", (|off| off.rmse) as fn(&Off) -> f64), ("bias", |off| off.bias)];
        charts.push(Chart {
            title: format!("Error as {title}"),
            x: x.clone(),
            y: Quantity::linear("RMSE, and mean of found − true"),
            series: (0..2)
                .flat_map(|n| both.map(|(what, of)| series(n, format!("{}, {what}", NAMES[n]), curve(n, of))))
                .collect(),
        });
        charts.push(Chart {
            title: format!("Contrast as {title}"),
            x,
            y: Quantity::linear("slope of the truth over what was found (1: the right contrast)"),
            series: (0..2).map(|n| series(n, NAMES[n].into(), curve(n, |off| off.slope))).collect(),
        });
        found.push(offs);
    }
    let whole = Scene::of(&builtin(KINDS[0], plan.edge)?)?;
    let before = stand.net(&whole);
    let mut beyond = [Vec::new(), Vec::new()];
    for &share in &plan.cuts {
        let far = stand.beyond(&whole, &before, share, plan.voxels);
        (0..2).for_each(|n| beyond[n].push([share, far[n]]));
        tell();
    }
    let far = beyond.clone().map(|points| Series::ours("", points).largest());
    let beyond = beyond.into_iter().enumerate().map(|(n, points)| series(n, NAMES[n].into(), points));
    charts.push(Chart {
        title: "Change beyond the reach of rays as a plane cuts".into(),
        x: Sweep::Cut.axis().1,
        y: Quantity::linear("largest change of a factor farther than R from the cut"),
        series: beyond.collect(),
    });
    let most = |sweep: usize, n: usize| found[sweep].iter().map(|(_, off)| off[n].rmse).fold(0.0, f64::max);
    let worst = |n: usize| (0..found.len()).map(|sweep| most(sweep, n)).fold(0.0, f64::max);
    let slopes = |n: usize| {
        let all = found.iter().flatten().map(|(_, off)| off[n].slope);
        let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), s| (l.min(s), h.max(s)));
        format!("{} to {}", short(low), short(high))
    };
    let usual = found[0].last().map_or([f64::NAN; 2], |(_, off)| off.map(|off| off.rmse));
    let unseen = found[4].last().map_or(f64::NAN, |(_, off)| off[1].rmse);
    Ok(Finding {
        sentence: format!(
            "The network errs by {} on the block as usual, where rays, ours, err by {}; by up to {} as opacities fade, {} as matter fills the volume, {} as \
             voxels grow longer, {} as it turns, by {} on {}, which it was not trained on, and by up to {} cut by a plane, where rays err by {} at most. \
             Slopes of the truth over its values are {} (ours {}). A cut changes its values beyond R by up to {}, ours by {}.",
            short(usual[1]),
            short(usual[0]),
            short(most(0, 1)),
            short(most(1, 1)),
            short(most(2, 1)),
            short(most(3, 1)),
            short(unseen),
            KINDS[KINDS.len() - 1],
            short(most(5, 1)),
            short(worst(0)),
            slopes(1),
            slopes(0),
            short(far[1]),
            short(far[0]),
        ),
        ours: Ours::holding(worst(0) <= USUAL && far[0] == 0.0),
        control_fails: worst(1) > FAILS * worst(0) && far[1] > 0.0,
        setting: format!(
            "engine {}³ by the preset auto, radius {} mm, voxels of 1 mm; {} voxels that count against the ambient integral of {} directions; balls of opacity \
             {OPACITY}; the net that is shipped, by its twin",
            plan.edge,
            short(f64::from(stand.radius)),
            plan.voxels,
            plan.directions
        ),
        charts,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_what_their_sweeps_say() {
        let solid = |scene: &Scene| {
            scene.opacity.iter().filter(|a| **a > 0.0).count() as f64 / scene.grid.len() as f64
        };
        for share in [0.01, 0.3, 0.9] {
            let found = solid(&Scene::filled(share, 32));
            // A ball more or less.
            assert!(found >= share && found < share + 0.04, "{found} of {share}");
        }
        let [straight, turned, quarter] = [0.0, 45.0, 90.0].map(|angle| Scene::turned(angle, 24).unwrap());
        let mass = |scene: &Scene| scene.opacity.iter().map(|a| f64::from(*a)).sum::<f64>();
        let apart = mass(&turned) / mass(&straight) - 1.0;
        // Samples are 2.8 voxels of the block apart, and hit its thin walls or miss them.
        assert!(apart.abs() < 0.2, "a turn changes the matter by {apart}");
        // A quarter turn is another order of the voxels.
        let grid = straight.grid;
        let moved = (0..grid.len()).filter(|i| {
            let [x, y, z] = grid.voxel(*i);
            (straight.opacity[*i] - quarter.opacity[grid.index([23 - y, x, z])]).abs() > 1e-3
                && (straight.opacity[*i] - quarter.opacity[grid.index([y, 23 - x, z])]).abs() > 1e-3
        });
        assert!(moved.count() * 100 < grid.len());
        let long = Sweep::Spacing.scene(8.0, 32).unwrap();
        assert_eq!((long.grid.dims, long.grid.spacing), ([32, 32, 4], [1.0, 1.0, 8.0]));
        let cut = Sweep::Cut.scene(0.5, 16).unwrap();
        assert!((0..cut.grid.len()).all(|i| cut.grid.voxel(i)[0] >= 8 || cut.opacity[i] == 0.0));
    }
}
