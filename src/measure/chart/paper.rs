//! The paper's evaluation (CAO §4): its three scenes, Tables 2 and 3, Fig. 9 beside the printed rows, and its pictures: Fig. 1 (a torus clip), 8 (N = 0
//! against 32), 10 and 11 (6 rays against 54, and crops of them, four times as large).
//!
//! Volumes are phantoms of the printed sizes (1 mm voxels, one colour), or files. The clip's size is found by bisection so that category b has the printed
//! share. As in the paper every voxel has a value, by eq. (2) with 6, 14, 26 and 54 equal rays and N = 32. On a software driver edges and radii are
//! a quarter of the printed ones. Memory: two contenders of 24 bytes a voxel. Cost: what [`estimate`] says.

use super::looks::{Apart, Looks};
use super::montage::{CROP, beside, crop, most_different};
use super::report::{figures, head, inline, page, section};
use super::tables;
use super::{Chart, Point, Run, Scene, SceneChart, VOXEL, front};
use crate::contender::{self, Arena, BASELINE, Change, Contender, State};
use crate::error::errors;
use crate::reference;
use crate::{Error, Result};
use cao::ambient::Categories;
use cao::renderer::{COLOUR, Renderer, StereoImage};
use cao_formats::Picture;
use cao_gpu::{DeviceKind, Gpu};
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::look::{Look, Shading};
use cao_model::mesh::TriangleMesh;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::{AntiAliasing, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::view::StereoRig;
use cao_model::volume::Volume;
use glam::Vec3;
use std::sync::Arc;

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Edges and radii are the printed ones over this.
    pub divide: usize,
    /// Timed runs of each contender.
    pub runs: u32,
    /// Pixels of one eye's image.
    pub size: [u32; 2],
}

impl Plan {
    /// What a device can do: the printed sizes on a GPU, a quarter on a software driver; a sixteenth for a first look.
    pub fn of(gpu: &Gpu, quick: bool, runs: u32) -> Self {
        let software = gpu.info().kind == DeviceKind::Cpu;
        let (divide, edge) = match (quick, software) {
            (true, _) => (16, 64),
            (_, true) => (4, 256),
            _ => (1, 768),
        };
        Self { divide, runs, size: [edge; 2] }
    }
}

/// CAO Table 2: name, voxels, samples a ray (and mm of its radius), share of category b in %.
const SCENES: [(&str, [usize; 3], usize, f64); 3] = [
    ("engine", [256, 256, 110], 20, 14.94),
    ("beetle", [416, 416, 247], 40, 20.24),
    ("skeleton", [512, 512, 512], 50, 16.13),
];

/// How near the share has to come, in %.
pub const NEAR: f64 = 0.1;
/// Halvings until no voxel changes sides any more.
const HALVINGS: usize = 24;

/// The paper's ray sets.
const SETS: [RaySet; 4] = [RaySet::R6, RaySet::R14, RaySet::R26, RaySet::R54];

/// Linear colour of everything: the paper's pictures have one.
const ONE: [f32; 3] = [0.85, 0.80, 0.70];

/// The scenes, each with a clip of no size yet. `files` stand for the first phantoms, in the paper's order.
///
/// # Errors
/// Those of the volumes, and [`cao_model::Error::Config`] for more files than scenes.
pub fn scenes(plan: &Plan, files: Vec<(String, Volume)>) -> Result<Vec<Scene>> {
    if files.len() > SCENES.len() {
        let names = SCENES.map(|(name, ..)| name).join(", ");
        return Err(Error::refused("--data", format!("{} files; expected at most 3: {names}", files.len())));
    }
    let mut files = files.into_iter();
    SCENES
        .into_iter()
        .enumerate()
        .map(|(n, (name, dims, samples, _))| {
            let (name, volume) = match files.next() {
                Some(file) => file,
                None => {
                    let dims = dims.map(|edge| edge / plan.divide);
                    (name.to_owned(), builtin_box(name, dims, [1.0; 3])?)
                }
            };
            // Of the phantom with skin the bones.
            let preset = if name == "skeleton" { "ct-bone" } else { "auto" };
            let opacity = TransferFunction::preset(preset, volume.range())?.opacity;
            let colour = vec![[volume.range().0 as f32, ONE[0], ONE[1], ONE[2]]];
            let transfer = TransferFunction::new(opacity, colour, None)?;
            let radius_mm = samples as f32 / plan.divide as f32 * volume.min_spacing() as f32;
            let rig = StereoRig::framing(volume.size_mm(), 30.0, 25.0);
            let state = State { clips: vec![clip(n, &volume, 0.05)], transfer, radius_mm };
            Ok(Scene { name, volume, state, rig })
        })
        .collect()
}

/// The n-th scene's clip, `share` of the volume's mean edge large: sphere, cube, rectangular prism, towards the corner that the eyes look at.
/// A cube right before it leaves the volume before it affects as much as the paper's.
fn clip(n: usize, volume: &Volume, share: f64) -> Clip {
    let (mesh, form, out) = match n {
        0 => (TriangleMesh::sphere(3), Vec3::ONE, 1.0),
        1 => (TriangleMesh::cuboid(), Vec3::ONE, 0.5),
        _ => (TriangleMesh::cuboid(), Vec3::new(0.7, 0.7, 1.6), 0.5),
    };
    shaped(mesh, form, out, volume, share)
}

/// `out`: of the way to that corner.
fn shaped(mesh: TriangleMesh, form: Vec3, out: f32, volume: &Volume, share: f64) -> Clip {
    let size = volume.size_mm();
    let edge = size.iter().sum::<f64>() / 3.0;
    let pose = Pose {
        translate_mm: out * Vec3::new(0.2, -0.25, 0.2) * Vec3::from_array(size.map(|s| s as f32)),
        scale: form * (share * edge) as f32,
        ..Pose::default()
    };
    Clip { pose, ..Clip::remove(Shape::Mesh(Arc::new(mesh))) }
}

/// What measuring will take.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    /// Seconds, by what a small update took just now.
    pub seconds: f64,
    /// Device memory in bytes.
    pub bytes: u64,
}

/// Times a small update and says what all of them will take. Uses the device's queue and waits for it.
pub fn estimate(gpu: &Gpu, scenes: &[Scene], plan: &Plan) -> Result<Estimate> {
    // What fills the device, so that rays take the time that they take among many.
    let edge = if gpu.info().kind == DeviceKind::Cpu { 24 } else { 128 };
    let volume = builtin_box("engine", [edge; 3], [1.0; 3])?;
    let transfer = TransferFunction::preset("auto", volume.range())?;
    let occlusion = Occlusion { radius_mm: 8.0, ..setup(Method::Lao, RaySet::R26).occlusion };
    let setup = Setup { occlusion, ..setup(Method::Lao, RaySet::R26) };
    let mut renderer = Renderer::new(gpu, &volume, transfer, setup, COLOUR)?;
    renderer.update(&mut |_| ())?;
    renderer.invalidate();
    let seconds = 1e-3 * renderer.update(&mut |_| ())?.total();
    let rate = volume.len() as f64 * 26.0 * 8.0 / seconds;
    let rays: f64 = SETS.iter().map(|set| set.count() as f64).sum();
    // Each set is opened, warmed up and timed by both, the contextual one at a fifth; then the clip's size with six rays, and the figures' three volumes.
    let updates = rays * (2.0 + 1.2 * f64::from(plan.runs + 1)) + 6.0 * HALVINGS as f64 + 3.0 * 54.0;
    let samples = scenes.iter().map(|scene| {
        updates * scene.volume.len() as f64 * f64::from(scene.state.radius_mm) / scene.volume.min_spacing()
    });
    let voxels = scenes.iter().map(|scene| scene.volume.len()).max().unwrap_or(0);
    Ok(Estimate { seconds: samples.sum::<f64>() / rate, bytes: (2 * VOXEL * voxels) as u64 })
}

fn setup(method: Method, rays: RaySet) -> Setup {
    let paper = Setup::of(method, 1.0);
    Setup { occlusion: Occlusion { rays, quadrature: Quadrature::Left, ..paper.occlusion }, ..paper }
}

/// What was measured.
#[derive(Clone, Debug)]
pub struct Paper {
    /// Times and shares in the form of the chart, with no errors.
    pub chart: Chart,
    /// Category b in % of each scene: printed, and with the size that was found.
    pub shares: Vec<[f64; 2]>,
    /// Pictures: number in the paper, what it shows.
    pub figures: Vec<(u32, String, Picture)>,
    /// What was asked for.
    pub plan: Plan,
}

/// Measures. `progress` hears what is being done and the share of the whole that is done.
///
/// # Errors
/// Those of the device, and [`cao_model::Error::Config`] where no clip affects as much as the paper's.
pub fn measure(
    gpu: &Gpu,
    mut scenes: Vec<Scene>,
    plan: &Plan,
    progress: &mut dyn FnMut(&str, f64),
) -> Result<Paper> {
    let mut charts = Vec::new();
    let mut shares = Vec::new();
    let mut figures = vec![torus(gpu, &scenes[0], plan)?];
    let steps = (scenes.len() * (SETS.len() + 1)) as f64;
    for (n, (scene, (.., printed))) in scenes.iter_mut().zip(SCENES).enumerate() {
        let done = |step: usize| (n * (SETS.len() + 1) + step) as f64 / steps;
        progress(&format!("{}: size of the clip", scene.name), done(0));
        let (categories, recomputed) = fit(gpu, scene, n, printed)?;
        shares.push([printed, percent(&categories)]);
        if n == 0 {
            figures.push(anti_aliasing(gpu, scene, plan)?);
        }
        let views = scene.views(plan.size)?;
        let arena = Arena { gpu, volume: &scene.volume, views: &views, size: plan.size };
        let mut points = Vec::new();
        let mut draws = vec![solid(arena, scene, plan)?];
        let mut pictures = Vec::new();
        for (step, rays) in SETS.into_iter().enumerate() {
            progress(&format!("{}: {} rays", scene.name, rays.count()), done(step + 1));
            let (found, times, image) = race(arena, scene, plan, rays)?;
            points.extend(found);
            if step == 0 {
                draws.extend(times);
            }
            if [RaySet::R6, RaySet::R54].contains(&rays) {
                pictures.push(Picture::over(image.size[0], image.size[1], &image.colour[0], [0.0; 3]));
            }
        }
        let at = most_different(&pictures);
        let crops: Vec<Picture> = pictures.iter().map(|picture| crop(picture, at)).collect();
        figures.push((10, format!("{}: 6 rays and 54", scene.name), beside(&pictures)));
        figures.push((11, format!("{}: the same, × {CROP}", scene.name), beside(&crops)));
        let nothing = Looks { drawn: Vec::new(), convergence: Apart { flip: 0.0, levels: 0.0 } };
        charts.push(SceneChart {
            name: scene.name.clone(),
            dims: scene.volume.dims,
            spacing: scene.volume.spacing,
            radius_mm: scene.state.radius_mm,
            clips: scene.state.clips[0].shape.name().to_owned(),
            references: Vec::new(),
            categories,
            recomputed,
            points,
            left_out: Vec::new(),
            draws,
            pictures: Vec::new(),
            looks: nothing,
        });
    }
    figures.sort_by_key(|(number, ..)| *number);
    let info = gpu.info();
    let chart = Chart {
        device: info.name.clone(),
        driver: info.driver.clone(),
        software: info.kind == DeviceKind::Cpu,
        plan: super::Plan {
            quick: false,
            runs: plan.runs,
            size: plan.size,
            pictures: plan.size,
            reference: reference::Plan::QUICK,
        },
        scenes: charts,
        meshes: None,
    };
    Ok(Paper { chart, shares, figures, plan: *plan })
}

fn percent(c: &Categories) -> f64 {
    100.0 * c.affected as f64 / ((c.clipped + c.affected + c.untouched) as f64).max(1.0)
}

/// Finds the size of the scene's clip with which category b has the printed share, and what an update recomputes then.
fn fit(gpu: &Gpu, scene: &mut Scene, n: usize, printed: f64) -> Result<(Categories, f64)> {
    let base = setup(Method::Cao, RaySet::R6);
    let occlusion = Occlusion { radius_mm: scene.state.radius_mm, ..base.occlusion };
    let setup = Setup { occlusion, ..base };
    let mut renderer = Renderer::new(gpu, &scene.volume, scene.state.transfer.clone(), setup, COLOUR)?;
    let mut at = |share: f64| -> Result<(Categories, Clip)> {
        let clip = clip(n, &scene.volume, share);
        renderer.set_clips(std::slice::from_ref(&clip))?;
        renderer.update(&mut |_| ())?;
        Ok((renderer.categories()?, clip))
    };
    // The share grows with the clip until that fills the volume.
    let (mut low, mut high) = (0.01, 0.02);
    while percent(&at(high)?.0) < printed {
        (low, high) = (high, 1.25 * high);
        if high > 1.0 {
            let problem = format!("no size of its clip affects {printed} % of {}'s voxels", scene.name);
            return Err(Error::refused("paper", problem));
        }
    }
    let mut best: Option<(f64, Categories, Clip)> = None;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let (categories, clip) = at(middle)?;
        let off = percent(&categories) - printed;
        if off < 0.0 {
            low = middle
        } else {
            high = middle
        }
        if best.as_ref().is_none_or(|(least, ..)| off.abs() < *least) {
            best = Some((off.abs(), categories, clip));
        }
        if off.abs() <= NEAR {
            break;
        }
    }
    let (_, categories, clip) = best.ok_or_else(|| Error::refused("paper", "no halving"))?;
    renderer.set_clips(std::slice::from_ref(&clip))?;
    renderer.update(&mut |_| ())?;
    let (difference, _) = cao::verify::verify(&renderer, &mut |_| ())?;
    scene.state.clips = vec![clip];
    Ok((categories, difference.recomputed as f64 / (difference.compared as f64).max(1.0)))
}

/// Both methods with so many rays, in turns: their points, the median time of drawing each, and the contextual one's picture.
#[expect(clippy::type_complexity, reason = "three things of one race, each used once")]
fn race(
    arena: Arena,
    scene: &Scene,
    plan: &Plan,
    rays: RaySet,
) -> Result<(Vec<Point>, Vec<(&'static str, f64)>, StereoImage)> {
    let entries = contender::printed(rays, scene.volume.min_spacing());
    let mut open: Vec<Box<dyn Contender + '_>> = Vec::new();
    for entry in &entries {
        open.push((entry.open)(arena, &scene.state)?);
    }
    let states = [&scene.after(Change::Clip), &scene.state];
    let mut runs: [Vec<Run>; 2] = Default::default();
    for run in 0..=2 * plan.runs.div_ceil(2) as usize {
        let mut of_baseline = f64::NAN;
        for (n, contender) in open.iter_mut().enumerate() {
            let stages = contender.update(Change::Clip, states[run % 2])?;
            let total_ms = stages.total();
            if n == 0 {
                of_baseline = total_ms;
            }
            // The first warms up.
            if run > 0 {
                runs[n].push(Run { stages, total_ms, ratio: total_ms / of_baseline });
            }
        }
    }
    let none = errors(&[], &[], &[]);
    let points = entries.iter().zip(runs).map(|(entry, runs)| Point {
        method: entry.method,
        setting: entry.setting.clone(),
        change: Change::Clip,
        on_surface: false,
        errors: none,
        shape: none,
        ssim_3d: None,
        runs,
    });
    let mut draws = Vec::new();
    for (entry, contender) in entries.iter().zip(&open) {
        draws.push((entry.method, drawn(contender.as_ref(), plan)?));
    }
    let (image, _) = open[1].draw(&shown())?;
    Ok((points.collect(), draws, image))
}

/// Median time of drawing both eyes in ms.
fn drawn(contender: &dyn Contender, plan: &Plan) -> Result<f64> {
    let times =
        (0..plan.runs).map(|_| Ok(contender.draw(&shown())?.1.total())).collect::<Result<Vec<f64>>>()?;
    Ok(front::quartiles(times.into_iter())[1])
}

fn solid(arena: Arena, scene: &Scene, plan: &Plan) -> Result<(&'static str, f64)> {
    let contender = (contender::solid().open)(arena, &scene.state)?;
    Ok((contender::SOLID, drawn(contender.as_ref(), plan)?))
}

/// The paper's pictures have the ambient factor alone.
fn shown() -> Look {
    Look { shading: Shading::Ao, ..Look::default() }
}

/// A scene with this clip and 54 rays.
fn picture(gpu: &Gpu, scene: &Scene, clip: &Clip, how: AntiAliasing, plan: &Plan) -> Result<Picture> {
    let base = setup(Method::Cao, RaySet::R54);
    let occlusion = Occlusion { radius_mm: scene.state.radius_mm, ..base.occlusion };
    let setup = Setup { occlusion, anti_aliasing: how, ..base };
    let mut renderer = Renderer::new(gpu, &scene.volume, scene.state.transfer.clone(), setup, COLOUR)?;
    renderer.set_clips(std::slice::from_ref(clip))?;
    renderer.update(&mut |_| ())?;
    let (image, _) = renderer.draw(&scene.views(plan.size)?, &shown(), plan.size)?;
    Ok(Picture::over(image.size[0], image.size[1], &image.colour[0], [0.0; 3]))
}

fn torus(gpu: &Gpu, scene: &Scene, plan: &Plan) -> Result<(u32, String, Picture)> {
    let mut clip = shaped(TriangleMesh::torus(48, 24), Vec3::ONE, 1.0, &scene.volume, 0.27);
    // It lies on the block, half sunk into it.
    let size = scene.volume.size_mm().map(|s| s as f32);
    clip.pose.translate_mm = Vec3::new(0.11, -0.19, 0.24) * Vec3::from_array(size);
    let shows = format!("{}: a torus clip, 54 rays", scene.name);
    Ok((1, shows, picture(gpu, scene, &clip, AntiAliasing::N32, plan)?))
}

fn anti_aliasing(gpu: &Gpu, scene: &Scene, plan: &Plan) -> Result<(u32, String, Picture)> {
    let clip = &scene.state.clips[0];
    let both = [AntiAliasing::N0, AntiAliasing::N32]
        .map(|how| picture(gpu, scene, clip, how, plan))
        .into_iter()
        .collect::<Result<Vec<_>>>()?;
    let at = most_different(&both);
    let both: Vec<Picture> = both.iter().map(|picture| crop(picture, at)).collect();
    Ok((8, format!("{}: N = 0 and N = 32, × {CROP}", scene.name), beside(&both)))
}

impl Paper {
    /// What one has to know to read it, line by line.
    pub fn caption(&self) -> Vec<String> {
        let mut lines = vec![format!("{}, {}.", self.chart.device, self.chart.driver)];
        if self.plan.divide > 1 {
            lines.push(format!(
                "Edges of the phantoms and radii are the paper's ÷ {}: shares of voxels are comparable, times and speed-ups grow with both.",
                self.plan.divide
            ));
        }
        for (scene, [printed, found]) in self.chart.scenes.iter().zip(&self.shares) {
            let [x, y, z] = scene.dims;
            let far = if (printed - found).abs() > NEAR { ", no nearer at these voxels" } else { "" };
            lines.push(format!(
                "{}: {x} × {y} × {z} voxels, radius {} mm, clip {}; category b {found:.2} %, printed {printed} %{far}.",
                scene.name, scene.radius_mm, scene.clips
            ));
        }
        lines.push(format!(
            "Every voxel has a value, eq. (2), N = 32; medians of {} runs in which the clip moves by a voxel along each axis and back.",
            2 * self.plan.runs.div_ceil(2)
        ));
        lines
    }

    /// Speed-up of the contextual update with so many rays, each scene.
    pub fn speed_ups(&self, rays: RaySet) -> Vec<f64> {
        let of = |scene: &SceneChart, method: &str| {
            let own = |p: &&Point| p.method == method && p.setting.label == rays.name();
            scene.points.iter().find(own).map_or(f64::NAN, |point| point.ms()[1])
        };
        let scenes = self.chart.scenes.iter();
        scenes.map(|scene| of(scene, BASELINE) / of(scene, contender::name(Method::Cao))).collect()
    }

    /// One page that needs no other file.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] where a picture cannot be encoded.
    pub fn html(&self, machine: &str, command: &str) -> Result<String> {
        let mut body = head("The paper's scenes", machine, command, &self.caption());
        body += &section("What a clip makes recompute", "Table 2 of the paper, and ours.");
        body += &tables::table_2(&self.chart);
        body += &section("Frame rates while the clip moves", "Table 3 of the paper, and ours.");
        body += &tables::table_3(&self.chart, true);
        body += &section("What a frame is spent on", "As the paper's Fig. 9, both eyes.");
        body += &inline(&tables::figure_9(&self.chart));
        body += &section("Pictures", "By the paper's numbers; under ambient light alone, left eye.");
        let shown = self.figures.iter().map(|(number, shows, picture)| (*number, shows.as_str(), picture));
        body += &figures(shown, "max-width: 100%; image-rendering: pixelated")?;
        Ok(page("cao chart --paper", &body))
    }
}
