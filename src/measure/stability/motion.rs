//! Clip motion (CAO §3.5 step 4, measure.md §4): how much a cut face's shading jumps when the clip moves by a part of a voxel, and
//! how long it takes to settle when the clip stops.
//!
//! A plane along the voxels' own axes, the hardest case: all voxels of the cut change in the same frame. The finest steps are computed,
//! coarser ones are frames left out. Control of the jumps: N = 0, no anti-aliasing samples (CAO eq. (5)). Beside it N = 8, and with N = 32 both
//! estimators and both supports (method.md §6); what share of one voxel each of them leaves to such a plane is in a chart of its own,
//! by the twin. Control of settling: progressive LAO, which traces one direction a frame, rolling and restarted (`progressive.rs`).

use super::plane_cut::PlaneCut;
use super::progressive::{Kind, Progressive, Shown};
use super::{Chart, Effort, Finding, Ours, Quantity, Series, mean};
use crate::Result;
use crate::plot::short;
use cao_gpu::Gpu;
use cao_model::clip::{Clip, Shape};
use cao_model::look::Look;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::{AntiAliasing, Estimator, Setup, Support};
use cao_twin::clip::classify::classify;
use cao_twin::clip::clips::{ClipField, Dilation, Maps};
use cao_twin::{Grid, trilinear_clamped};
use glam::Vec3;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along an edge of the volume.
    pub edge: usize,
    /// Pixels along an edge of the picture.
    pub pixels: u32,
    /// Frames that the plane takes for a voxel, a power of two.
    pub frames: usize,
    /// Voxels that it goes.
    pub way: usize,
    /// Rays of what has to settle.
    pub rays: Vec<RaySet>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self {
                edge: 48,
                pixels: 192,
                frames: 32,
                way: 2,
                rays: vec![RaySet::R6, RaySet::R14, RaySet::R26, RaySet::R54],
            },
            Effort::Quick => {
                Self { edge: 32, pixels: 96, frames: 8, way: 1, rays: vec![RaySet::R6, RaySet::R14] }
            }
        }
    }
}

/// Radius in voxels.
const RADIUS: f32 = 6.0;

/// Frames looked at after a progressive method has traced every direction, and of ours after the first.
const RESTS: usize = 3;

/// Ways to sample a cut voxel: the control, the default, then what is measured beside it.
const WAYS: [(&str, AntiAliasing); 6] = [
    ("N = 0", AntiAliasing::N0),
    ("N = 32 (ours)", AntiAliasing::N32),
    ("N = 8", AntiAliasing::N8),
    ("eq. (5) as printed", AntiAliasing { estimator: Estimator::Paper, ..AntiAliasing::N32 }),
    ("the 32 alone, to a voxel out", wide(Estimator::Interior)),
    ("eq. (5), samples to a voxel out", wide(Estimator::Paper)),
];

const fn wide(estimator: Estimator) -> AntiAliasing {
    AntiAliasing { estimator, support: Support::Neighbours, ..AntiAliasing::N32 }
}

/// Steps of the plane in which a voxel's share is looked at, for one voxel.
const SHARE_STEPS: usize = 256;

/// Of these one in so many is drawn.
const DRAWN: usize = 5;

/// A frame has settled when nothing is off by more than this: half a step of an 8-bit display at twice the ambient factor.
pub const SETTLED: f64 = 0.5 / 255.0 / 2.0;

/// Runs the trial, telling the share done. Uses the device's queue and waits for it.
pub fn run(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let frames = plan.frames * plan.way + 1;
    let total = (WAYS.len() * frames + plan.rays.len()) as f64;
    let mut done = 0.0;
    let mut tick = || {
        done += 1.0;
        progress(done / total);
    };
    let occlusion = Occlusion {
        rays: RaySet::R14,
        quadrature: Quadrature::Left,
        radius_mm: RADIUS,
        offset_mm: None,
        step_mm: None,
        ..Occlusion::paper(1.0)
    };
    let (mut ambient, mut picture) = (Vec::new(), Vec::new());
    let mut stage = PlaneCut::new(gpu, plan.edge, occlusion, plan.way)?;
    for (n, (name, how)) in WAYS.into_iter().enumerate() {
        let setup = Setup { anti_aliasing: how, ..*stage.renderer.setup() };
        stage.renderer.set_setup(setup)?;
        let mut seen = Vec::new();
        for frame in 0..frames {
            seen.push(shown(&mut stage, frame as f64 / plan.frames as f64, plan.pixels)?);
            tick();
        }
        let curve = |of: fn(&Frame) -> &Vec<f64>| jumps(&seen, plan.frames, of);
        let series = |points| of_way(n, name, points);
        ambient.push(series(curve(|frame| &frame.ambient)));
        picture.push(series(curve(|frame| &frame.light)));
    }
    stage.renderer.set_setup(Setup { anti_aliasing: AntiAliasing::N32, ..*stage.renderer.setup() })?;
    let mut settling = Vec::new();
    for &rays in &plan.rays {
        settling.push(settle(&mut stage, rays)?);
        tick();
    }
    let shares = WAYS.map(|(_, how)| share_errors(how)).into_iter().collect::<Result<Vec<_>>>()?;

    let finest = 1.0 / plan.frames as f64;
    let ratio = ambient[0].at(finest) / ambient[1].at(finest).max(1e-12);
    let holds = settling.iter().all(|s| s.frames(2) == 0 && s.restless(2) == 0.0);
    let says = match holds {
        true => "ours has settled in the very frame, bit for bit, and rests".to_owned(),
        false => format!(
            "OURS takes up to {} frames and changes by up to {} at rest",
            settling.iter().map(|s| s.frames(2)).max().unwrap_or(0),
            short(settling.iter().map(|s| s.restless(2)).fold(0.0, f64::max))
        ),
    };
    let each = |of: &dyn Fn(&Settling) -> String| settling.iter().map(of).collect::<Vec<_>>().join(", ");
    let rests = format!(
        "progressive LAO with {} rays takes {} frames rolling and {} restarted, is off by {} and {} one frame after the step, and the restarted one \
         changes a voxel by up to {} a frame while nothing moves",
        each(&|s| s.rays.to_string()),
        each(&|s| s.frames(0).to_string()),
        each(&|s| s.frames(1).to_string()),
        each(&|s| short(s.shown[0][0].error)),
        each(&|s| short(s.shown[1][0].error)),
        each(&|s| short(s.restless(1))),
    );
    let most = &settling[settling.len() - 1];
    Ok(Finding {
        sentence: format!(
            "Without anti-aliasing samples the cut face's ambient factor jumps by {} in a step of {} voxel (the picture's light by {}), \
             {}× as much as with N = 32 ({}; N = 8: {}; eq. (5) as printed: {}), though over a whole voxel it changes by {} only; the share of a \
             voxel is off by {} RMS and jumps by {} at most in 1/{SHARE_STEPS} voxel ({} and {} as printed); when the clip has moved by a voxel and stops, {says}; {rests}.",
            short(ambient[0].at(finest)),
            short(finest),
            short(picture[0].at(finest)),
            short(ratio),
            short(ambient[1].at(finest)),
            short(ambient[2].at(finest)),
            short(ambient[3].at(finest)),
            short(ambient[1].at(1.0)),
            short(shares[1].rms),
            short(shares[1].jump),
            short(shares[3].rms),
            short(shares[3].jump),
        ),
        ours: Ours::holding(holds && ambient[1].at(finest) < ambient[0].at(finest)),
        control_fails: ratio > 1.0 && settling.iter().all(|s| s.frames(0) > 0 && s.frames(1) > 0),
        setting: format!(
            "engine {}³ cut by a plane along the voxels, 14 rays, radius {RADIUS} voxels, {}² pixels; largest jump between any two \
             frames that far apart, mean over the cut face's points or pixels; settled: nothing off by more than 1/1020",
            plan.edge, plan.pixels
        ),
        charts: vec![
            Chart {
                title: "Jump of the ambient factor on the cut face from frame to frame".into(),
                x: Quantity::log("step of the clip, voxels a frame"),
                y: Quantity::log("largest jump, mean |Δ| over the face (0 … 1)"),
                series: ambient,
            },
            Chart {
                title: "Jump of the picture of the cut face from frame to frame".into(),
                x: Quantity::log("step of the clip, voxels a frame"),
                y: Quantity::log("largest jump, mean |Δ| of linear light (0 … 1)"),
                series: picture,
            },
            Chart {
                title: "Error of a voxel's visible share".into(),
                x: Quantity::linear("place of the plane, voxels from the centre"),
                y: Quantity::linear("share − exact share (0 … 1)"),
                series: WAYS
                    .into_iter()
                    .zip(shares)
                    .enumerate()
                    .map(|(n, ((name, _), share))| of_way(n, name, share.points))
                    .collect(),
            },
            Chart {
                title: "Frames until a step of the clip by a voxel has settled".into(),
                x: Quantity::linear("rays"),
                y: Quantity::linear("frames"),
                series: SHOWN
                    .into_iter()
                    .enumerate()
                    .map(|(n, name)| {
                        of_shown(
                            n,
                            name,
                            settling.iter().map(|s| [s.rays as f64, s.frames(n) as f64]).collect(),
                        )
                    })
                    .collect(),
            },
            Chart {
                title: format!("Error of the shown ambient volume after the step, {} rays", most.rays),
                x: Quantity::linear("frame, 1 is the one of the step"),
                y: Quantity::linear("largest |error| of a visible voxel (0 … 1)"),
                series: SHOWN
                    .into_iter()
                    .enumerate()
                    .map(|(n, name)| {
                        let errors = most.shown[n].iter().enumerate();
                        of_shown(
                            n,
                            name,
                            errors.map(|(frame, shown)| [frame as f64 + 1.0, shown.error]).collect(),
                        )
                    })
                    .collect(),
            },
        ],
    })
}

/// The curve of the n-th of [`WAYS`].
fn of_way(n: usize, name: &str, points: Vec<[f64; 2]>) -> Series {
    match n {
        0 => Series::control(name, points),
        1 => Series::ours(name, points),
        _ => Series::yardstick(name, points),
    }
}

/// The curve of the n-th of [`SHOWN`].
fn of_shown(n: usize, name: &str, points: Vec<[f64; 2]>) -> Series {
    if n == 2 { Series::ours(name, points) } else { Series::control(name, points) }
}

/// How a voxel's share follows a plane.
struct ShareErrors {
    /// (place, share − exact share), of some places.
    points: Vec<[f64; 2]>,
    rms: f64,
    /// Largest change of the share from one place to the next.
    jump: f64,
}

/// A plane along the axes passes a voxel in [`SHARE_STEPS`] steps, between the places of its samples.
fn share_errors(how: AntiAliasing) -> Result<ShareErrors> {
    let grid = Grid { dims: [3; 3], spacing: [1.0; 3] };
    let maps = Maps { layers: 1, resolution: 8, dilation: Dilation::Conservative(8), support: how.support };
    let mut points = Vec::new();
    let (mut jump, mut last) = (0.0_f64, None);
    for n in 0..=SHARE_STEPS {
        let place = (n as f64 - 0.5 * SHARE_STEPS as f64 + 0.37) / SHARE_STEPS as f64;
        let mut clip = Clip::remove(Shape::Plane);
        clip.pose.translate_mm.z = place as f32;
        let field = ClipField::new(&clip, &grid, 0.0, &maps)?;
        let (clipped, _) = classify(&grid, &vec![1.0; grid.len()], &[field], how);
        let share = f64::from(clipped[grid.index([1; 3])]);
        jump = jump.max(last.map_or(0.0, |last: f64| (share - last).abs()));
        last = Some(share);
        points.push([place, share - (0.5 + place).clamp(0.0, 1.0)]);
    }
    let rms = mean(&points.iter().map(|point| point[1].powi(2)).collect::<Vec<_>>()).sqrt();
    Ok(ShareErrors { points: points.into_iter().step_by(DRAWN).collect(), rms, jump })
}

/// What one frame shows of the cut face.
struct Frame {
    /// Ambient factor at points of the face, which move with it.
    ambient: Vec<f64>,
    /// Green light of the pixels that look at the face.
    light: Vec<f64>,
}

/// For each step of 2ⁿ frames the largest change over it, in voxels a step.
fn jumps(frames: &[Frame], per_voxel: usize, of: fn(&Frame) -> &Vec<f64>) -> Vec<[f64; 2]> {
    let mut points = Vec::new();
    let mut step = 1;
    while step <= per_voxel {
        let change = |i: usize| {
            let pairs = of(&frames[i]).iter().zip(of(&frames[i + step]));
            mean(&pairs.map(|(a, b)| (a - b).abs()).collect::<Vec<_>>())
        };
        let most = (0..frames.len() - step).map(change).fold(0.0, f64::max);
        points.push([step as f64 / per_voxel as f64, most]);
        step *= 2;
    }
    points
}

/// Moves the face `way` voxels from its start and looks at it.
fn shown(cut: &mut PlaneCut, way: f64, pixels: u32) -> Result<Frame> {
    let x = cut.place(way)?;
    let ambient = cut.renderer.read_ambient()?;
    let at_face = |&[y, z]: &[f64; 2]| trilinear_clamped(&cut.grid, &ambient, [x, y, z]);
    let views = cut.views()?;
    let look = Look::default();
    let (picture, _) = cut.renderer.draw(&views, &look, [pixels; 2])?;
    let light = |&[y, z]: &[f64; 2]| {
        let world = cut.grid.to_world([x, y, z]).map(|c| c as f32);
        let (uv, _) = views[0].project(Vec3::from_array(world))?;
        let [u, v] = uv.to_array().map(|c| ((c * pixels as f32) as usize).min(pixels as usize - 1));
        Some(f64::from(picture.colour[0][v * pixels as usize + u][1]))
    };
    Ok(Frame {
        ambient: cut.face.iter().map(at_face).collect(),
        light: cut.face.iter().filter_map(light).collect(),
    })
}

/// What happens with one set of rays when the clip steps by a voxel and stops: in each frame from that on, rolling, restarted, ours.
struct Settling {
    rays: usize,
    shown: [Vec<Shown>; 3],
}

/// Names of what is shown, in the order of [`Settling::shown`].
const SHOWN: [&str; 3] =
    ["progressive LAO, rolling", "progressive LAO, restarted", "contextual update (ours)"];

impl Settling {
    /// Frames until nothing is off any more: 0 if nothing is in the first.
    fn frames(&self, which: usize) -> usize {
        let off = self.shown[which].iter().rposition(|shown| shown.error > SETTLED);
        // The first frame traces the first direction.
        off.map_or(0, |last| last + 2)
    }

    /// Largest change of a voxel after the first frame, when nothing moves.
    fn restless(&self, which: usize) -> f64 {
        self.shown[which].iter().skip(1).map(|shown| shown.change).fold(0.0, f64::max)
    }
}

fn settle(stage: &mut PlaneCut, rays: RaySet) -> Result<Settling> {
    let mut setup = *stage.renderer.setup();
    setup.occlusion.rays = rays;
    stage.renderer.set_setup(setup)?;
    stage.place(0.0)?;
    let before = stage.renderer.read_opacity()?;
    stage.place(1.0)?;
    let after = stage.renderer.read_opacity()?;
    let of: Vec<usize> = (0..after.len()).filter(|&i| after[i] > 0.0).collect();
    let progressive = Progressive::new(&stage.grid, &setup.occlusion, [&before, &after]);
    let frames = progressive.directions() + RESTS;
    let mut ours = Vec::new();
    for _ in 0..frames {
        let last = stage.renderer.read_ambient()?;
        // The frame of the step, and then frames in which nothing moves.
        stage.place(1.0)?;
        let now = stage.renderer.read_ambient()?;
        let change = of.iter().map(|&i| f64::from((now[i] - last[i]).abs())).fold(0.0, f64::max);
        // Against a full recomputation, at every voxel: a bit that differs shows, however small.
        let (difference, _) = cao::verify::verify(&stage.renderer, &mut |_| ())?;
        let error = if difference.different > 0 { f64::from(difference.largest).max(1.0) } else { 0.0 };
        ours.push(Shown { error, change });
        if ours.len() > RESTS {
            break;
        }
    }
    let shown =
        [progressive.run(Kind::Rolling, frames, &of), progressive.run(Kind::Restart, frames, &of), ours];
    Ok(Settling { rays: progressive.directions(), shown })
}
