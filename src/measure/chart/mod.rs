//! The chart (measure.md §3): for every kind of change the time that each method takes to bring its ambient values up to
//! date, against their error to the converged reference.
//!
//! One process, one device. Methods take turns: in every run each one makes the same change once, the baseline among them,
//! so that what else the machine does touches all of them alike. Quoted are medians, with quartiles as spread; on a software
//! driver as ratios to the baseline of the same run.

mod caption;
pub mod csv;
pub mod deep;
mod deep_page;
pub mod draw;
pub mod features;
mod features_page;
pub mod front;
pub mod looks;
pub mod looks_draw;
pub mod meshes;
mod meshes_overdraw;
mod meshes_page;
pub mod meshes_panel;
pub mod meshes_printed;
pub mod meshes_scenes;
mod montage;
pub mod paper;
pub mod peers;
pub mod pictures;
pub mod report;
pub mod tables;

use super::contender::{self, Arena, Asked, BASELINE, Change, Contender, Entrant, Setting, State, Values};
use super::error::{Errors, errors, shape_errors};
use super::reference::{self, Reference};
use super::split::Split;
use super::ssim::{Constants, ssim_3d};
use crate::{Error, Result};
use cao::ambient::Categories;
use cao::renderer::{COLOUR, Renderer};
use cao_gpu::{DeviceKind, Gpu, Timings};
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::look::Look;
use cao_model::mesh::TriangleMesh;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::settings::Setup;
use cao_model::view::{StereoRig, View};
use cao_model::volume::Volume;
use cao_twin::Grid;
use glam::{Vec2, Vec3};
use looks::Looks;
use pictures::Shown;
use std::sync::Arc;
use std::time::Instant;

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Only some settings of each method?
    pub quick: bool,
    /// Timed runs of each change, at least 1; measure.md asks for 5.
    pub runs: u32,
    /// Pixels of one eye's image.
    pub size: [u32; 2],
    /// The same where errors are the picture's own: its reference takes a thousand times the samples.
    pub pictures: [u32; 2],
    /// The reference.
    pub reference: reference::Plan,
}

/// What is measured on.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What the user calls it.
    pub name: String,
    /// The volume.
    pub volume: Volume,
    /// Before any change. The clips are what "clip moved" moves.
    pub state: State,
    /// The eyes.
    pub rig: StereoRig,
}

/// Edge of the default clip's ball, in shares of the volume's mean edge. With a radius of a sixth of the edge it touches
/// 15 to 20 % of the voxels, as the paper's scenes do (CAO Table 2).
const BALL: f64 = 0.2;

impl Scene {
    /// A clip for scenes that have none: a ball of triangles, like the paper's clip meshes, near the corner that
    /// [`StereoRig::framing`] from 30° and 25° looks at.
    pub fn default_clip(volume: &Volume) -> Clip {
        let size = volume.size_mm();
        let radius = BALL * size.iter().sum::<f64>() / 3.0;
        let pose = Pose {
            translate_mm: Vec3::new(0.2, -0.25, 0.2) * Vec3::from_array(size.map(|s| s as f32)),
            scale: Vec3::splat(radius as f32),
            ..Pose::default()
        };
        Clip { pose, ..Clip::remove(Shape::Mesh(Arc::new(TriangleMesh::sphere(3)))) }
    }

    /// The state after a change: a small step, as an edit by hand makes in each frame.
    pub fn after(&self, change: Change) -> State {
        let mut state = self.state.clone();
        match change {
            Change::Volume => {}
            Change::Clip => {
                // Along no axis, for a plane may face any of them; towards the centre from the default clip's corner.
                let step = Vec3::new(-1.0, 1.0, -1.0) * (CLIP_VOXELS * self.volume.min_spacing()) as f32;
                state.clips.iter_mut().for_each(|clip| clip.pose.translate_mm += step);
            }
            Change::Transfer => {
                state.transfer.opacity.iter_mut().for_each(|point| point[1] *= OPACITY_FACTOR);
            }
            Change::Radius => state.radius_mm *= RADIUS_FACTOR,
        }
        state
    }

    fn views(&self, size: [u32; 2]) -> Result<[View; 2]> {
        let far = 3.0 * (self.rig.position - self.rig.target).length();
        Ok(self.rig.views(size[0] as f32 / size[1] as f32, 0.02 * far, far)?)
    }

    fn grid(&self) -> Grid {
        Grid { dims: self.volume.dims, spacing: self.volume.spacing }
    }
}

/// "Clip moved": by this many voxels along each axis.
pub const CLIP_VOXELS: f64 = 1.0;
/// "Transfer function edited": opacities times this.
pub const OPACITY_FACTOR: f32 = 0.9;
/// "Radius changed": times this.
pub const RADIUS_FACTOR: f32 = 0.9;

/// Everything that was measured.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Name of the device.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// Whether the device is a program on the processor, whose times mean something as ratios only.
    pub software: bool,
    /// What was asked for.
    pub plan: Plan,
    /// Each scene.
    pub scenes: Vec<SceneChart>,
    /// Surfaces, whose panel is their own; not measured by [`measure`].
    pub meshes: Option<meshes::Found>,
}

/// One scene's part.
#[derive(Clone, Debug)]
pub struct SceneChart {
    /// What the user calls it.
    pub name: String,
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Their distance in mm.
    pub spacing: [f64; 3],
    /// R before any change, mm.
    pub radius_mm: f32,
    /// The clips, in words.
    pub clips: String,
    /// The reference of the state after each kind of change.
    pub references: Vec<(Change, Truth)>,
    /// Categories of the voxels after the clip moved.
    pub categories: Categories,
    /// Of the voxels with a value, the share that the update recomputed for it.
    pub recomputed: f64,
    /// Each contender after each kind of change.
    pub points: Vec<Point>,
    /// Who refused the scene or a change of it, and why.
    pub left_out: Vec<LeftOut>,
    /// Median time of drawing both eyes, ms: method, time.
    pub draws: Vec<(&'static str, f64)>,
    /// What each method shows, and where it errs; of the first scene only.
    pub pictures: Vec<Shown>,
    /// The default method's picture, drawn in other ways.
    pub looks: Looks,
}

/// A contender that has no point, as it cannot have what it was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// Name of the method.
    pub method: &'static str,
    /// Its setting.
    pub setting: Setting,
    /// After which change; `None` where it refused the scene.
    pub change: Option<Change>,
    /// In its words.
    pub why: String,
}

impl std::fmt::Display for LeftOut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { method, setting, change, why } = self;
        let when = change.map_or(String::new(), |change| format!(" after {}", change.name()));
        write!(f, "{method}, {}, has no point{when}: {why}.", setting.name())
    }
}

/// What a reference is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Voxels that count: those that a sample with opacity can interpolate.
    pub counting: usize,
    /// Of these, voxels that were computed, all or a stratified sample.
    pub computed: usize,
    /// Points of the surface in the left eye's image that were computed.
    pub surface: usize,
    /// RMS change when its resolutions are doubled.
    pub convergence: f64,
}

/// One contender after one kind of change.
#[derive(Clone, Debug)]
pub struct Point {
    /// Name of the method.
    pub method: &'static str,
    /// Its setting.
    pub setting: Setting,
    /// What changed.
    pub change: Change,
    /// Whether its errors are at points of the surface in the left eye's image, rather than at voxels.
    pub on_surface: bool,
    /// Against the ambient reference.
    pub errors: Errors,
    /// What remains after the best affine fit of its tone.
    pub shape: Errors,
    /// SSIM-3D over the reference's voxels (DVAO eq. (3), constants as printed); `None` where errors are on a surface.
    pub ssim_3d: Option<f64>,
    /// Every timed run.
    pub runs: Vec<Run>,
}

/// One timed run.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Each stage in ms.
    pub stages: Timings,
    /// All stages in ms.
    pub total_ms: f64,
    /// Over the total of the baseline in the same run.
    pub ratio: f64,
}

impl Point {
    /// Whether times are quoted against it.
    pub fn is_baseline(&self) -> bool {
        is_baseline(self.method, &self.setting)
    }

    /// Lower quartile, median, upper quartile of the times in ms.
    pub fn ms(&self) -> [f64; 3] {
        front::quartiles(self.runs.iter().map(|run| run.total_ms))
    }

    /// The same of the ratios.
    pub fn ratio(&self) -> [f64; 3] {
        front::quartiles(self.runs.iter().map(|run| run.ratio))
    }

    /// Median time in ms of one part of the frame's split.
    pub fn part_ms(&self, of: impl Fn(Split) -> f64) -> f64 {
        front::quartiles(self.runs.iter().map(|run| of(Split::of(&run.stages))))[1]
    }
}

fn is_baseline(method: &str, setting: &Setting) -> bool {
    method == BASELINE && setting.label == RaySet::R26.name()
}

/// Device memory that contenders may take at a time on a software driver, whose memory is everybody's; of another device they may take half of what it
/// has. Where they need more, they compete in groups, the baseline in each.
const MEMORY: u64 = 1 << 30;
/// Bytes a voxel of one contender (`Volumes`, the volume, and a little; five levels of N-buffers in a volume of 48³ take 17).
const VOXEL: usize = 28;

/// How many compete with the baseline at a time.
fn group(gpu: &Gpu, scene: &Scene) -> usize {
    let memory = match gpu.info().kind {
        DeviceKind::Cpu => MEMORY,
        _ => gpu.info().device_memory / 2,
    };
    (memory as usize / (VOXEL * scene.volume.len()).max(1)).max(2) - 1
}

/// Points of the surface at which image-space methods are held to the reference.
const SURFACE: usize = 1000;
/// Points of the surface in a picture of errors; and for a first look.
const PICTURED: [usize; 2] = [6000, 2000];

/// What measuring will take, roughly.
#[derive(Clone, Copy, Debug)]
pub struct Foreseen {
    /// Minutes of this machine: times of other work are known within a factor of two or so.
    pub minutes: f64,
    /// Memory of the device in bytes, the drivers' own aside.
    pub device_bytes: u64,
}

/// What [`measure`] will take, by the time of an update of the baseline in the smallest scene, the least of a few. Uses the device's queue and waits for it.
pub fn foresee(gpu: &Gpu, scenes: &[Scene], plan: &Plan) -> Result<Foreseen> {
    let Some(scene) = scenes.iter().min_by_key(|scene| scene.volume.len()) else {
        return Ok(Foreseen { minutes: 0.0, device_bytes: 0 });
    };
    let entries = contender::all(&asked(scene, plan));
    let baseline = entries.iter().find(|e| is_baseline(e.method, &e.setting)).ok_or_else(no_baseline)?;
    let views = scene.views(plan.size)?;
    let arena = Arena { gpu, volume: &scene.volume, views: &views, size: plan.size };
    let mut contender = (baseline.open)(arena, &scene.state)?;
    contender.update(Change::Volume, &scene.state)?;
    // The least of a few: these are milliseconds, in which a busy machine may do something else.
    let mut least = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        contender.update(Change::Volume, &scene.state)?;
        least = least.min(start.elapsed().as_secs_f64());
    }
    let seconds = least / Work::update(scene, baseline);
    let work: f64 = scenes.iter().map(|scene| Work::of(gpu, scene, plan)).sum();
    let largest = scenes
        .iter()
        .map(|scene| (VOXEL * scene.volume.len() * (group(gpu, scene) + 1).min(entries.len())) as u64);
    Ok(Foreseen { minutes: seconds * work / 60.0, device_bytes: largest.max().unwrap_or(0) })
}

/// Measures. `progress` hears what is being done and the share of the whole that is done.
pub fn measure(
    gpu: &Gpu,
    scenes: &[Scene],
    plan: &Plan,
    progress: &mut dyn FnMut(&str, f64),
) -> Result<Chart> {
    if plan.runs == 0 || plan.size.contains(&0) || plan.pictures.contains(&0) {
        let problem = format!(
            "{} runs, images of {:?} and {:?}; expected at least 1 of each",
            plan.runs, plan.size, plan.pictures
        );
        return Err(Error::refused("chart", problem));
    }
    let mut work = Work { done: 0.0, total: scenes.iter().map(|scene| Work::of(gpu, scene, plan)).sum() };
    let mut measured = Vec::new();
    for (n, scene) in scenes.iter().enumerate() {
        let mut say = |what: &str, work: &Work| progress(&format!("{}: {what}", scene.name), work.share());
        measured.push(one(gpu, scene, plan, n == 0, &mut work, &mut say)?);
    }
    let info = gpu.info();
    Ok(Chart {
        device: info.name.clone(),
        driver: info.driver.clone(),
        software: info.kind == DeviceKind::Cpu,
        plan: *plan,
        scenes: measured,
        meshes: None,
    })
}

fn asked(scene: &Scene, plan: &Plan) -> Asked {
    let min_spacing = scene.volume.min_spacing();
    Asked { min_spacing, radius: f64::from(scene.state.radius_mm) / min_spacing, quick: plan.quick }
}

/// Samples of rays, done and to do: for the time that is left.
struct Work {
    done: f64,
    total: f64,
}

impl Work {
    fn share(&self) -> f64 {
        (self.done / self.total).min(1.0)
    }

    /// Of one update of a contender.
    fn update(scene: &Scene, entry: &Entrant) -> f64 {
        let samples = f64::from(scene.state.radius_mm) / scene.volume.min_spacing();
        // Whatever it does, it does something.
        (entry.work * samples + 10.0) * scene.volume.len() as f64
    }

    /// Of one reference, its check included.
    fn reference(scene: &Scene, plan: &Plan) -> f64 {
        let plan = &plan.reference;
        let samples = f64::from(scene.state.radius_mm) / scene.volume.min_spacing();
        let samples = samples * f64::from(plan.steps_per_voxel) * f64::from(plan.directions);
        // The checked ones at twice both resolutions, the surface; its kernel skips what is empty.
        0.2 * samples * (2 * plan.max_voxels.min(scene.volume.len() / 5) + SURFACE) as f64
    }

    /// Of the default picture: a sample of its rays takes as long as ten of the ambient rays, and a ray has some two a voxel of half an edge.
    fn picture(scene: &Scene, plan: &Plan) -> f64 {
        let edge = scene.volume.dims.into_iter().max().unwrap_or(0) as f64;
        10.0 * edge * 2.0 * plan.pictures.map(f64::from).iter().product::<f64>()
    }

    fn of(gpu: &Gpu, scene: &Scene, plan: &Plan) -> f64 {
        let voxel = scene.volume.min_spacing() as f32;
        let pictures =
            looks::work(voxel, &looks::settings(voxel, plan.quick), plan.runs) * Self::picture(scene, plan);
        let entries = contender::all(&asked(scene, plan));
        let baseline = entries.iter().find(|e| is_baseline(e.method, &e.setting));
        // The baseline competes in every group.
        let groups = (entries.len() - 1).div_ceil(group(gpu, scene)) as f64;
        let again = baseline.map_or(0.0, |entry| (groups - 1.0) * Self::update(scene, entry));
        let updates = again + entries.iter().map(|entry| Self::update(scene, entry)).sum::<f64>();
        let changes = Change::ALL.len() as f64;
        pictures + changes * (updates * f64::from(plan.runs + 1) + Self::reference(scene, plan)) + updates
    }
}

fn one(
    gpu: &Gpu,
    scene: &Scene,
    plan: &Plan,
    pictured: bool,
    work: &mut Work,
    say: &mut dyn FnMut(&str, &Work),
) -> Result<SceneChart> {
    say("preparing", work);
    let views = scene.views(plan.size)?;
    let arena = Arena { gpu, volume: &scene.volume, views: &views, size: plan.size };
    let mut stand = Stand::new(arena, scene)?;
    let mut truths = Vec::new();
    for change in Change::ALL {
        say("reference", work);
        let pictured = (pictured && change == Change::Volume).then(|| PICTURED[usize::from(plan.quick)]);
        let truth = stand.truth(change, plan, pictured.unwrap_or(SURFACE))?;
        if truth.reference.counting == 0 {
            let problem = format!(
                "nothing to measure after {}: no voxel has opacity; choose another transfer function or clip",
                change.name()
            );
            return Err(Error::refused(&scene.name, problem));
        }
        truths.push(truth);
        work.done += Work::reference(scene, plan);
    }
    let (categories, recomputed) = stand.clip_shares()?;

    let mut entries = contender::all(&asked(scene, plan));
    let at = entries.iter().position(|e| is_baseline(e.method, &e.setting)).ok_or_else(no_baseline)?;
    let baseline = entries.remove(at);
    let mut points = Vec::new();
    let mut left_out = Vec::new();
    let mut draws = Vec::new();
    let mut shown = Vec::new();
    let featured: Vec<(&str, Setting)> = match pictured {
        true => pictures::featured(std::iter::once(&baseline).chain(&entries)),
        false => Vec::new(),
    };
    for (n, others) in entries.chunks(group(gpu, scene)).enumerate() {
        let compete: Vec<&Entrant> = std::iter::once(&baseline).chain(others).collect();
        let found = compete_in(scene, arena, plan, &compete, &truths, &featured, work, say)?;
        // The baseline's first runs stand for it.
        let own = usize::from(n > 0);
        points.extend(found.points.into_iter().skip(own * Change::ALL.len()));
        left_out.extend(found.left_out);
        for (method, ms) in found.draws {
            if !draws.iter().any(|(known, _)| *known == method) {
                draws.push((method, ms));
            }
        }
        shown.extend(found.shown);
    }
    let looks = looks_of(gpu, scene, plan, work, say)?;
    shown.sort_by_key(|shown| contender::place(shown.method));
    shown.dedup_by_key(|shown| shown.method);
    let names: Vec<&str> = scene.state.clips.iter().map(|clip| clip.shape.name()).collect();
    Ok(SceneChart {
        name: scene.name.clone(),
        dims: scene.volume.dims,
        spacing: scene.volume.spacing,
        radius_mm: scene.state.radius_mm,
        clips: names.join(", "),
        references: Change::ALL.into_iter().zip(truths.iter().map(Known::summary)).collect(),
        categories,
        recomputed,
        points,
        left_out,
        draws,
        pictures: shown,
        looks,
    })
}

/// The scene's picture, drawn in every way, with the default method's ambient values.
fn looks_of(
    gpu: &Gpu,
    scene: &Scene,
    plan: &Plan,
    work: &mut Work,
    say: &mut dyn FnMut(&str, &Work),
) -> Result<Looks> {
    say("pictures", work);
    let voxel = scene.volume.min_spacing();
    let default = Setup::of(Method::default(), voxel);
    let occlusion = Occlusion { radius_mm: scene.state.radius_mm, ..default.occlusion };
    let transfer = scene.state.transfer.clone();
    let setup = Setup { occlusion, ..default };
    let mut renderer = Renderer::new(gpu, &scene.volume, transfer, setup, COLOUR)?;
    renderer.set_clips(&scene.state.clips)?;
    renderer.update(&mut |_| ())?;
    let ways = looks::settings(voxel as f32, plan.quick);
    let views = scene.views(plan.pictures)?;
    looks::measure(&renderer, &views, plan.pictures, voxel as f32, &ways, plan.runs, &mut |drawn| {
        work.done += drawn * Work::picture(scene, plan);
        say("pictures", work);
    })
}

fn no_baseline() -> Error {
    Error::refused("chart", format!("no contender is {BASELINE} with 26 rays"))
}

/// What a group found.
struct Found {
    /// Of each contender for all changes, contender by contender.
    points: Vec<Point>,
    left_out: Vec<LeftOut>,
    /// Draw times of each method's first.
    draws: Vec<(&'static str, f64)>,
    /// Of those that are featured.
    shown: Vec<Shown>,
}

/// What was done, or why a setting that a method cannot have was refused; other errors are errors. The baseline has to have all.
fn unless_refused<T>(done: Result<T>, baseline: bool) -> Result<Result<T, String>> {
    match done {
        Ok(done) => Ok(Ok(done)),
        Err(error) if !baseline && matches!(error.of_data(), Some(cao_model::Error::Config { .. })) => {
            Ok(Err(error.to_string()))
        }
        Err(error) => Err(error),
    }
}

#[expect(clippy::too_many_arguments, reason = "what competes, on what, and who listens, each named once")]
fn compete_in(
    scene: &Scene,
    arena: Arena,
    plan: &Plan,
    entries: &[&Entrant],
    truths: &[Known],
    featured: &[(&str, Setting)],
    work: &mut Work,
    say: &mut dyn FnMut(&str, &Work),
) -> Result<Found> {
    say("preparing", work);
    let mut left_out = Vec::new();
    let out = |entry: &Entrant, change, why| {
        let (method, setting) = (entry.method, entry.setting.clone());
        LeftOut { method, setting, change, why }
    };
    let mut open: Vec<(&Entrant, Box<dyn Contender + '_>)> = Vec::new();
    for (n, &entry) in entries.iter().enumerate() {
        match unless_refused((entry.open)(arena, &scene.state), n == 0)? {
            Ok(contender) => open.push((entry, contender)),
            Err(why) => left_out.push(out(entry, None, why)),
        }
        work.done += Work::update(scene, entry);
        say("preparing", work);
    }
    let mut points: Vec<Vec<Point>> = open.iter().map(|_| Vec::new()).collect();
    for (change, truth) in Change::ALL.into_iter().zip(truths) {
        let states = [&scene.after(change), &scene.state];
        let mut refused = vec![false; open.len()];
        // Back and forth; the first run warms up, and its values are those that are held to the reference.
        for run in 0..=plan.runs as usize {
            let mut of_baseline = f64::NAN;
            for (n, (entry, contender)) in open.iter_mut().enumerate() {
                if !entry.has_values || refused[n] {
                    continue;
                }
                say(change.name(), work);
                let stages = match unless_refused(contender.update(change, states[run % 2]), n == 0)? {
                    Ok(stages) => stages,
                    // It stays as it was, which is what the next change begins with.
                    Err(why) => {
                        left_out.push(out(entry, Some(change), why));
                        refused[n] = true;
                        continue;
                    }
                };
                work.done += Work::update(scene, entry);
                // The sum of nothing is -0.
                let total_ms = 0.0 + stages.total();
                if run == 0 {
                    points[n].push(truth.judge(scene, arena, entry, change, &contender.ambient()?));
                    continue;
                }
                if n == 0 {
                    of_baseline = total_ms;
                    if total_ms <= 0.0 {
                        let problem = "the device's queue has no timestamps; choose another with --device";
                        return Err(Error::refused("chart", problem));
                    }
                }
                let run = Run { stages, total_ms, ratio: total_ms / of_baseline };
                points[n].last_mut().into_iter().for_each(|point| point.runs.push(run.clone()));
            }
        }
        // An even number of runs ends where the change leads to.
        if plan.runs.is_multiple_of(2) {
            for (_, contender) in &mut open {
                contender.update(change, &scene.state)?;
            }
        }
    }
    let mut draws = Vec::new();
    let look = Look::default();
    for (n, (entry, contender)) in open.iter().enumerate() {
        if open[..n].iter().any(|(other, _)| other.method == entry.method) {
            continue;
        }
        let mut times = Vec::new();
        for _ in 0..plan.runs {
            times.push(contender.draw(&look)?.1.total());
        }
        draws.push((entry.method, front::quartiles(times.into_iter())[1]));
    }
    let mut shown = Vec::new();
    for (entry, contender) in &open {
        if featured.iter().any(|(method, setting)| *method == entry.method && *setting == entry.setting) {
            let (image, _) = contender.draw(&look)?;
            let found = entry.has_values.then(|| contender.ambient()).transpose()?;
            shown.push(truths[0].shown(&scene.grid(), entry, &image, found.as_ref()));
        }
    }
    Ok(Found { points: points.into_iter().flatten().collect(), left_out, draws, shown })
}

/// The scene without any contender: what there is to see, and the truth about it.
struct Stand<'a> {
    scene: &'a Scene,
    arena: Arena<'a>,
    renderer: Renderer,
}

/// What is known of one state.
struct Known {
    reference: Reference,
    /// Voxels at which it is known.
    computed: Vec<usize>,
    /// Of every so many pixels along both edges of the image the surface is known.
    stride: usize,
    /// Points of the surface in the left eye's image: index coordinates, pixel, ambient value.
    surface: Vec<([f64; 3], usize, f32)>,
}

impl<'a> Stand<'a> {
    fn new(arena: Arena<'a>, scene: &'a Scene) -> Result<Self> {
        // Rays as few as can be: only the opacity and the categories are of interest.
        let paper = Setup::of(Method::Cao, scene.volume.min_spacing());
        let occlusion = Occlusion { rays: RaySet::R6, radius_mm: scene.state.radius_mm, ..paper.occlusion };
        let setup = Setup { occlusion, ..paper };
        let transfer = scene.state.transfer.clone();
        let mut renderer = Renderer::new(arena.gpu, &scene.volume, transfer, setup, COLOUR)?;
        renderer.set_clips(&scene.state.clips)?;
        renderer.update(&mut |_| ())?;
        Ok(Self { scene, arena, renderer })
    }

    /// The reference of the state after a change.
    fn truth(&mut self, change: Change, plan: &Plan, most: usize) -> Result<Known> {
        let state = self.scene.after(change);
        self.renderer.set_transfer(state.transfer.clone())?;
        self.renderer.set_clips(&state.clips)?;
        self.renderer.update(&mut |_| ())?;
        let opacity = self.renderer.read_opacity()?;
        let (gpu, grid) = (self.arena.gpu, self.scene.grid());
        let smallest = grid.min_spacing();
        // Where the contenders' rays start: half a step.
        let (radius, offset) = (f64::from(state.radius_mm), 0.5 * smallest);
        let length = f64::from(state.transfer.reference_mm(smallest));
        let plan = &plan.reference;
        let quiet = &mut |_| ();
        let reference = reference::ambient(gpu, &grid, &opacity, radius, offset, length, plan, quiet)?;

        let (image, _) = self.renderer.draw(self.arena.views, &contender::surface_look(), self.arena.size)?;
        let shown = surface_points(&grid, &self.arena.views[0], self.arena.size, &image.depth[0]);
        let (stride, shown) = thinned(shown, self.arena.size[0] as usize, most);
        let points: Vec<[f64; 3]> = shown.iter().map(|(point, _)| *point).collect();
        let values =
            reference::ambient_at(gpu, &grid, &opacity, &points, radius, offset, length, plan, quiet)?;
        let surface = shown.into_iter().zip(values).map(|((point, pixel), value)| (point, pixel, value));
        let computed = (0..grid.len()).filter(|&i| reference.counts[i]).collect();
        Ok(Known { reference, computed, stride, surface: surface.collect() })
    }

    /// Categories after the clips moved, and the share of the voxels with a value that was recomputed for it.
    fn clip_shares(&mut self) -> Result<(Categories, f64)> {
        self.renderer.set_transfer(self.scene.state.transfer.clone())?;
        for clips in [&self.scene.state.clips, &self.scene.after(Change::Clip).clips] {
            self.renderer.set_clips(clips)?;
            self.renderer.update(&mut |_| ())?;
        }
        let categories = self.renderer.categories()?;
        let (difference, _) = cao::verify::verify(&self.renderer, &mut |_| ())?;
        Ok((categories, difference.recomputed as f64 / (difference.compared as f64).max(1.0)))
    }
}

/// What each pixel of an eye shows: index coordinates of the point at its depth, and the pixel.
fn surface_points(
    grid: &Grid,
    view: &View,
    [width, height]: [u32; 2],
    depth: &[f32],
) -> Vec<([f64; 3], usize)> {
    let (near, far) = (view.near_mm, view.far_mm);
    let edges = Vec2::new(width as f32, height as f32);
    let shown = (0..depth.len()).filter(|&i| depth[i] < 1.0).map(|i| {
        let pixel = Vec2::new((i as u32 % width) as f32, (i as u32 / width) as f32);
        let (origin, direction) = view.ray((pixel + 0.5) / edges);
        let world = origin + direction * (near * far / (far - depth[i] * (far - near)));
        (grid.to_index(world.to_array().map(f64::from)), i)
    });
    shown.collect()
}

/// Those of every n-th row and column, the least n at which at most `most` remain; and n.
fn thinned(shown: Vec<([f64; 3], usize)>, width: usize, most: usize) -> (usize, Vec<([f64; 3], usize)>) {
    let kept = |n: usize| {
        move |(_, pixel): &&([f64; 3], usize)| {
            (pixel % width).is_multiple_of(n) && (pixel / width).is_multiple_of(n)
        }
    };
    let mut n = 1;
    while shown.iter().filter(kept(n)).count() > most {
        n += 1;
    }
    (n, shown.iter().filter(kept(n)).copied().collect())
}

impl Known {
    fn summary(&self) -> Truth {
        Truth {
            counting: self.reference.counting,
            computed: self.computed.len(),
            surface: self.surface.len(),
            convergence: self.reference.convergence.rmse,
        }
    }

    /// A contender's errors, its runs still to come.
    fn judge(&self, scene: &Scene, arena: Arena, entry: &Entrant, change: Change, found: &Values) -> Point {
        let pairs: (Vec<f32>, Vec<f32>);
        let mut ssim = None;
        match found {
            Values::Voxels(values) => {
                let Reference { ambient, counts, .. } = &self.reference;
                ssim = Some(ssim_3d(&scene.grid(), values, ambient, counts, Constants::PRINTED));
                pairs = self.computed.iter().map(|&voxel| (values[voxel], ambient[voxel])).unzip();
            }
            Values::Pixels(values) => {
                debug_assert_eq!(values.len(), (arena.size[0] * arena.size[1]) as usize);
                pairs = self.surface.iter().map(|&(_, pixel, value)| (values[pixel], value)).unzip();
            }
        }
        let (found, reference) = pairs;
        let counts = vec![true; found.len()];
        Point {
            method: entry.method,
            setting: entry.setting.clone(),
            change,
            on_surface: ssim.is_none(),
            errors: errors(&found, &reference, &counts),
            shape: shape_errors(&found, &reference, &counts).0,
            ssim_3d: ssim,
            runs: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_method_cannot_have_leaves_it_out_and_what_is_broken_does_not() {
        let refused = || Err::<(), _>(Error::refused("radius", "is 1 mm"));
        assert_eq!(unless_refused(Ok(3), true).unwrap(), Ok(3));
        let why = unless_refused(refused(), false).unwrap().unwrap_err();
        assert!(why.contains("radius") && why.contains("is 1 mm"), "{why}");
        assert!(unless_refused(refused(), true).is_err(), "the baseline was left out");
        let limit = cao_model::Error::Limit { what: "x".into(), needed: 2, limit: 1, hint: "less".into() };
        assert!(
            unless_refused(Err::<(), _>(limit.into()), false).is_err(),
            "a limit was taken for a refusal"
        );
        let setting = Setting { label: "network".into(), quadrature: None, details: String::new() };
        let change = Some(Change::Radius);
        let told = LeftOut { method: "DVAO", setting: setting.clone(), change, why: why.clone() }.to_string();
        assert_eq!(told, format!("DVAO, network, has no point after radius changed: {why}."));
        let told = LeftOut { method: "DVAO", setting, change: None, why: why.clone() }.to_string();
        assert_eq!(told, format!("DVAO, network, has no point: {why}."));
    }
}
