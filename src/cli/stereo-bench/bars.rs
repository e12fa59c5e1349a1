//! `stereo-bench --bars`: what the project holds itself to, measured in one run within one process, and judged.
//!
//! The baseline of ratios is `LAO (unit)` (method.md §2): the paper's 54 rays by the sampler, a sample a voxel, every voxel. On large
//! volumes it is timed on a random sample of bricks and scaled by their share of all; the default method is always timed whole, with
//! everything that an update does. Rows in milliseconds are judged on a GPU; a software driver measures them small, without a bar.

use super::args::{Cli, Part};
use super::machine;
use super::statistics::median;
use anyhow::{Context, Result};
use cao::cast::lao::{Bindings, Work};
use cao::cast::volumes::{Kernels, Volumes};
use cao::draw::picture::Picture;
use cao::drive::Take;
use cao::field::Field;
use cao::field::bricks::BrickList;
use cao::field::opacity::Opacity;
use cao::field::transfer::TransferBuffer;
use cao::host::read_values;
use cao::renderer::{COLOUR, Renderer};
use cao_cli::output::{Out, Progress, check_validation, open_gpu};
use cao_gpu::{Access, DeviceKind, Gpu, Phase, Stage};
use cao_measure::error::errors;
use cao_measure::random::Random;
use cao_measure::reference::{Plan, ambient};
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::error::shown_path;
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::{Scope, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::view::StereoRig;
use cao_model::volume::Volume;
use cao_twin::Grid;
use glam::Vec3;
use serde_json::json;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

const LAO_UNIT: Stage = Stage::new("lao (unit)", Phase::Ambient);

/// Measurements of each row; medians and ranges of them are printed.
pub(super) const RUNS: usize = 5;

/// Voxels that the baseline is timed on at most, times samples a voxel: some seconds on a software driver.
const BASELINE_SAMPLES: f64 = 1e8;

/// A device is warm when two runs in a row agree within this share,
const AGREE: f64 = 0.03;
/// and when it has worked for so long: clocks rise for a while.
const WARM_MS: f64 = 250.0;
/// It has not come to rest after so many runs: measure it as it is.
const MOST_WARM_UPS: usize = 200;

/// What a row is held to.
#[derive(Clone, Copy)]
pub(super) enum Bar {
    AtLeast(f64),
    AtMost(f64),
    /// For information.
    None,
}

/// One bar.
pub(super) struct Row {
    pub place: String,
    pub what: String,
    pub bar: Bar,
    pub unit: &'static str,
    /// Of each run.
    pub found: Vec<f64>,
    /// What else to know.
    pub note: String,
}

impl Row {
    fn reached(&self) -> bool {
        let found = median(&self.found);
        match self.bar {
            Bar::AtLeast(least) => found >= least,
            Bar::AtMost(most) => found <= most,
            Bar::None => true,
        }
    }
}

/// The rows so far, each printed when it is measured: a run that is cut off was not in vain.
pub(super) struct Rows {
    rows: Vec<Row>,
    out: Out,
    progress: Progress,
}

impl Rows {
    pub(super) fn push(&mut self, row: Row) -> Result<()> {
        let range = |pick: fn(f64, f64) -> f64| row.found.iter().copied().reduce(pick).unwrap_or(f64::NAN);
        let (low, high, found) = (range(f64::min), range(f64::max), median(&row.found));
        let (verdict, bar) = match (row.bar, row.reached()) {
            (Bar::None, _) => ("", String::new()),
            (Bar::AtLeast(least), ok) => (if ok { "ok" } else { "MISSED" }, format!(", bar ≥ {least}")),
            (Bar::AtMost(most), ok) => (if ok { "ok" } else { "MISSED" }, format!(", bar ≤ {most}")),
        };
        self.out.line(format!(
            "{verdict:<6} {:<44} {:<34} {found:>9.4} {} [{low:.4} … {high:.4}]{bar}",
            row.place, row.what, row.unit
        ));
        self.out.line(format!("       {}", row.note));
        self.rows.push(row);
        self.progress.aside(|| self.out.show())
    }
}

/// A volume with the transfer function that the bars are for.
struct Scene {
    name: String,
    volume: Volume,
    transfer: TransferFunction,
}

impl Scene {
    /// Opacity rises from 0 at `threshold` to 0.8 a little above it and on to 0.95.
    fn new(name: &str, volume: Volume, threshold: f32) -> Result<Self> {
        let opacity =
            vec![[threshold, 0.0], [threshold + 20.0, 0.8], [255.0_f32.max(threshold + 21.0), 0.95]];
        let transfer = TransferFunction::new(opacity, vec![[0.0, 1.0, 1.0, 1.0]], None)?;
        Ok(Self { name: name.into(), volume, transfer })
    }

    fn built_in(name: &str, size: u32, threshold: f32) -> Result<Self> {
        let spec = format!("builtin:{name}:{size}");
        let volume = cao_formats::open(&spec)?;
        Self::new(&spec, volume, threshold)
    }

    fn real(folder: &Path, name: &str, threshold: f32) -> Result<Self> {
        let path = folder.join("volumes").join(name);
        let volume = cao_formats::open(&path).with_context(|| format!("--data {}", shown_path(folder)))?;
        Self::new(name.split('_').next().unwrap_or(name), volume, threshold)
    }

    fn voxel(&self) -> f32 {
        self.volume.min_spacing() as f32
    }

    /// The default method, its own rays by this rule.
    fn setup(&self, rule: Quadrature, radius_voxels: f32) -> Setup {
        let mut setup = Setup::new(self.volume.min_spacing());
        setup.occlusion.quadrature = rule;
        setup.occlusion.radius_mm = radius_voxels * self.voxel();
        setup
    }

    fn renderer(&self, gpu: &Gpu, rule: Quadrature, radius_voxels: f32) -> Result<Renderer> {
        let setup = self.setup(rule, radius_voxels);
        Ok(Renderer::new(gpu, &self.volume, self.transfer.clone(), setup, COLOUR)?)
    }

    /// A sphere of a quarter of the volume's size at a place in voxels.
    fn sphere(&self, place: Vec3) -> Clip {
        let radius = 0.125 * self.volume.size_mm().into_iter().fold(0.0, f64::max) as f32;
        let pose = Pose { translate_mm: place * self.voxel(), scale: Vec3::splat(radius), ..Pose::default() };
        Clip { pose, ..Clip::remove(Shape::Sphere) }
    }
}

/// `LAO (unit)` of a scene without clips on a sample of its bricks.
struct Baseline {
    kernels: Kernels,
    volumes: Volumes,
    field: Field,
    occlusion: Occlusion,
    reference_mm: f32,
    list: BrickList,
    bricks: u32,
    /// All bricks / those in the list.
    scale: f64,
}

impl Baseline {
    fn new(gpu: &Gpu, scene: &Scene, radius_voxels: f32) -> Result<Self> {
        let field = Field::upload(gpu, &scene.volume)?;
        let spacing = scene.volume.min_spacing();
        let (rays, radius_mm) = (RaySet::R54, radius_voxels * scene.voxel());
        let occlusion = Occlusion { rays, radius_mm, ..Occlusion::paper(spacing) };
        let reference_mm = scene.transfer.reference_mm(spacing);
        let (kernels, volumes) = (Kernels::new(gpu)?, Volumes::new(gpu, &field)?);
        let transfer = TransferBuffer::new(gpu)?;
        let mut rec = gpu.recorder("baseline")?;
        kernels.lao.record_rays(&mut rec, &occlusion)?;
        transfer.record(&mut rec, &scene.transfer)?;
        Opacity::new(gpu)?.record(&mut rec, &field, &transfer, &volumes.opacity)?;
        rec.submit_and_wait()?;

        let all = field.brick_count();
        let samples = rays.directions().len() as f64 * f64::from(radius_voxels) * 512.0;
        // A GPU that is not full takes as long for few bricks as for many.
        let few = if gpu.info().kind == DeviceKind::Cpu { 1 } else { 16_000 };
        let wanted = ((BASELINE_SAMPLES / samples) as u32).max(few).clamp(1, all);
        let mut random = Random::new(7);
        let mut bricks: Vec<u32> = (0..all).collect();
        for i in 0..wanted as usize {
            bricks.swap(i, i + random.below(u64::from(all) - i as u64) as usize);
        }
        bricks.truncate(wanted as usize);
        let list = BrickList::of(gpu, &bricks)?;
        let scale = f64::from(all) / f64::from(wanted);
        Ok(Self { kernels, volumes, field, occlusion, reference_mm, list, bricks: wanted, scale })
    }

    /// Time of all bricks in ms, by that of the listed ones.
    fn measure(&self, gpu: &Gpu) -> Result<f64> {
        let bindings = Bindings {
            opacity: &self.volumes.opacity,
            list: &self.list,
            mask: &self.volumes.mask,
            precomputed: &self.volumes.full_opacity,
            ambient: &self.volumes.ambient,
        };
        let mut rec = gpu.recorder("lao (unit)")?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageWrite]);
        rec.stage(LAO_UNIT)?;
        let (field, all) = (&self.field, Take::These(0..self.bricks));
        let (occlusion, reference_mm) = (&self.occlusion, self.reference_mm);
        let (scope, work) = (Scope::All, Work::Full);
        self.kernels.lao.record(&mut rec, field, occlusion, reference_mm, scope, work, bindings, &all)?;
        rec.end_stage()?;
        Ok(rec.submit_and_wait()?.total() * self.scale)
    }

    fn note(&self) -> String {
        format!("LAO (unit), 54 rays, on {} of {} bricks", self.bricks, self.field.brick_count())
    }
}

/// Time of the device and by the clock, ms.
#[derive(Clone, Copy)]
struct Time {
    device: f64,
    clock: f64,
}

/// Time of an update after what `change` does.
fn update(renderer: &mut Renderer, change: &mut dyn FnMut(&mut Renderer) -> Result<()>) -> Result<Time> {
    change(renderer)?;
    let start = Instant::now();
    let timings = renderer.update(&mut |_| ())?;
    let clock = start.elapsed().as_secs_f64() * 1e3;
    // Queues without timestamps leave the program's clock.
    Ok(Time { device: if timings.is_empty() { clock } else { timings.total() }, clock })
}

/// Warms the device up, then takes the times of some updates.
fn updates(
    gpu: &Gpu,
    renderer: &mut Renderer,
    change: &mut dyn FnMut(&mut Renderer) -> Result<()>,
) -> Result<Vec<Time>> {
    // A software driver has no clock that rises.
    if gpu.info().kind != DeviceKind::Cpu {
        let (mut before, mut spent) = (f64::INFINITY, 0.0);
        for _ in 0..MOST_WARM_UPS {
            let now = update(renderer, change)?.device;
            spent += now;
            if spent >= WARM_MS && (now - before).abs() <= AGREE * before {
                break;
            }
            before = now;
        }
    }
    (0..RUNS).map(|_| update(renderer, change)).collect()
}

fn anew(renderer: &mut Renderer) -> Result<()> {
    renderer.invalidate();
    Ok(())
}

fn against_lao(gpu: &Gpu, scene: &Scene, radius_voxels: f32, bar: Bar) -> Result<Row> {
    let baseline = Baseline::new(gpu, scene, radius_voxels)?;
    let mut renderer = scene.renderer(gpu, Method::default().quadrature(), radius_voxels)?;
    update(&mut renderer, &mut anew)?;
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..RUNS {
        times[0].push(baseline.measure(gpu)?);
        times[1].push(update(&mut renderer, &mut anew)?.device);
    }
    let [lao, ours] = [median(&times[0]), median(&times[1])];
    let note = format!("{}: {lao:.0} against {ours:.1} ms; {}", scene.name, baseline.note());
    Ok(Row {
        place: format!("{}, R = {radius_voxels}", scene.name),
        what: "full update against LAO (unit)".into(),
        bar,
        unit: "x",
        found: times[0].iter().zip(&times[1]).map(|(lao, ours)| lao / ours).collect(),
        note,
    })
}

/// Error against the ambient reference, beside that of LAO (unit) at the same voxels.
fn error(gpu: &Gpu, scene: &Scene, radius_voxels: f32, rays: RaySet, bar: Bar) -> Result<Row> {
    let grid = Grid { dims: scene.volume.dims, spacing: scene.volume.spacing };
    let mut setup = scene.setup(Method::default().quadrature(), radius_voxels);
    setup.occlusion.rays = rays;
    let mut renderer = Renderer::new(gpu, &scene.volume, scene.transfer.clone(), setup, COLOUR)?;
    renderer.update(&mut |_| ())?;
    let (opacity, found) = (renderer.read_opacity()?, renderer.read_ambient()?);
    drop(renderer);
    let plan = Plan { directions: 1000, steps_per_voxel: 8, max_voxels: 3000, ..Plan::FULL };
    let reference_mm = f64::from(scene.transfer.reference_mm(scene.volume.min_spacing()));
    let radius_mm = f64::from(radius_voxels * scene.voxel());
    let offset_mm = 0.5 * scene.volume.min_spacing();
    let reference = ambient(gpu, &grid, &opacity, radius_mm, offset_mm, reference_mm, &plan, &mut |_| ())?;
    let ours = errors(&found, &reference.ambient, &reference.counts);

    // LAO (unit) at the bricks of the same voxels.
    let baseline = Baseline::new(gpu, scene, radius_voxels)?;
    let [bx, by, _] = baseline.field.bricks();
    let mut bricks: Vec<u32> = (0..grid.len())
        .filter(|&i| reference.counts[i])
        .map(|i| grid.voxel(i).map(|c| c as u32 / cao::field::BRICK))
        .map(|[x, y, z]| (z * by + y) * bx + x)
        .collect();
    bricks.sort_unstable();
    bricks.dedup();
    let baseline =
        Baseline { list: BrickList::of(gpu, &bricks)?, bricks: bricks.len() as u32, scale: 1.0, ..baseline };
    baseline.measure(gpu)?;
    let lao = read_values(gpu, &baseline.volumes.ambient)?;
    let lao = errors(&lao, &reference.ambient, &reference.counts);
    let note = format!(
        "bias {:+.5}; LAO (unit), 54 rays: {:.5}; {} voxels; the reference's own {:.5}",
        ours.bias, lao.rmse, ours.count, reference.convergence.rmse
    );
    Ok(Row {
        place: format!("{}, R = {radius_voxels}, {}", scene.name, rays.name()),
        what: "RMSE of ambient factors".into(),
        bar,
        unit: "",
        found: vec![ours.rmse],
        note,
    })
}

/// The sphere moved, to and fro, against a full update.
fn clip_ratio(gpu: &Gpu, scene: &Scene, places: [Vec3; 2], what: &str, bar: Bar) -> Result<Row> {
    let mut renderer = scene.renderer(gpu, Method::default().quadrature(), 20.0)?;
    renderer.set_clips(&[scene.sphere(places[0])])?;
    update(&mut renderer, &mut anew)?;
    let mut times = [Vec::new(), Vec::new()];
    let mut touched = 0.0;
    for run in 0..RUNS {
        times[0].push(update(&mut renderer, &mut anew)?.device);
        let clip = scene.sphere(places[(run + 1) % 2]);
        times[1].push(update(&mut renderer, &mut |r| Ok(r.set_clips(std::slice::from_ref(&clip))?))?.device);
        touched = renderer.categories()?.affected as f64 / scene.volume.len() as f64;
    }
    let [full, moved] = [median(&times[0]), median(&times[1])];
    let note = format!("{full:.1} against {moved:.1} ms, {:.1} % of all voxels recomputed", 100.0 * touched);
    Ok(Row {
        place: format!("{}, R = 20, sphere {what}", scene.name),
        what: "full update over clip update".into(),
        bar,
        unit: "x",
        found: times[0].iter().zip(&times[1]).map(|(full, update)| full / update).collect(),
        note,
    })
}

/// Bars in ms of a rule: full update, sphere moved by a voxel.
type Milliseconds = (Quadrature, f64, f64);

/// Rows in milliseconds of one scene: full update, sphere moved by one voxel and to a new place, what the host adds, memory.
fn absolute(
    gpu: &Gpu,
    scene: &Scene,
    radius_voxels: f32,
    (rule, full_ms, moved_ms): Milliseconds,
    rows: &mut Rows,
) -> Result<()> {
    let judged = gpu.info().kind != DeviceKind::Cpu;
    let at_most = |ms: f64| if judged && ms.is_finite() { Bar::AtMost(ms) } else { Bar::None };
    let mut renderer = scene.renderer(gpu, rule, radius_voxels)?;
    let size = scene.volume.dims[0] as f32;
    let (here, beside, elsewhere) =
        (Vec3::splat(0.05 * size), Vec3::splat(0.05 * size) + Vec3::X, Vec3::splat(-0.15 * size));
    renderer.set_clips(&[scene.sphere(here)])?;
    let full = updates(gpu, &mut renderer, &mut anew)?;
    let mut to_and_fro = |places: [Vec3; 2]| -> Result<Vec<Time>> {
        let mut at = 0;
        updates(gpu, &mut renderer, &mut |renderer| {
            at = 1 - at;
            Ok(renderer.set_clips(&[scene.sphere(places[at])])?)
        })
    };
    let (moved, placed) = (to_and_fro([here, beside])?, to_and_fro([here, elsewhere])?);
    let place = format!("{}, R = {radius_voxels}, {}", scene.name, rule.name());
    let mut row = |what: &str, times: &[Time], of: fn(&Time) -> f64, bar: Bar| -> Result<()> {
        let clock = median(&times.iter().map(|t| t.clock).collect::<Vec<_>>());
        rows.push(Row {
            place: place.clone(),
            what: what.into(),
            bar,
            unit: "ms",
            found: times.iter().map(of).collect(),
            note: format!("by the clock {clock:.2} ms"),
        })
    };
    row("full update", &full, |t| t.device, at_most(full_ms))?;
    row("sphere moved 1 voxel", &moved, |t| t.device, at_most(moved_ms))?;
    row("sphere at a new place", &placed, |t| t.device, Bar::None)?;
    row("sphere moved, clock less device", &moved, |t| t.clock - t.device, at_most(0.5))
}

/// Device memory at its peak with a full update, bytes a voxel, in a device of its own.
fn memory(cli: &Cli, scene: &Scene, radius_voxels: f32) -> Result<Row> {
    let gpu = open_gpu(&cli.global)?;
    let mut renderer = scene.renderer(&gpu, Method::default().quadrature(), radius_voxels)?;
    let time = update(&mut renderer, &mut anew)?;
    let bytes = gpu.memory_peak();
    let small = scene.volume.len() < 1 << 24;
    Ok(Row {
        place: format!("{}, R = {radius_voxels}", scene.name),
        what: "device memory a voxel, 8-bit data".into(),
        // Tables of fixed size weigh on small volumes.
        bar: if small { Bar::None } else { Bar::AtMost(6.0) },
        unit: "bytes",
        found: vec![bytes as f64 / scene.volume.len() as f64],
        note: format!("{:.0} MiB; first update {:.1} ms", bytes as f64 / f64::from(1 << 20), time.device),
    })
}

/// Both eyes of a headset.
fn picture(gpu: &Gpu, scene: &Scene, size: [u32; 2]) -> Result<Row> {
    let mut renderer = scene.renderer(gpu, Method::default().quadrature(), 20.0)?;
    update(&mut renderer, &mut anew)?;
    let views = StereoRig::framing(scene.volume.size_mm(), 30.0, 25.0).views(
        size[0] as f32 / size[1] as f32,
        1.0,
        1e5,
    )?;
    let (look, target) = (Look::default(), Picture::new(gpu, size, views.len())?);
    let mut found = Vec::new();
    for _ in 0..RUNS + 1 {
        // As a host draws it, in one dispatch.
        let mut rec = gpu.recorder("picture")?;
        renderer.record_picture(&mut rec, &views, &look, &target)?;
        found.push(rec.submit_and_wait()?.of(Phase::Draw));
    }
    found.remove(0);
    let judged = gpu.info().kind != DeviceKind::Cpu;
    Ok(Row {
        place: format!("{}, both eyes {} x {}", scene.name, size[0], size[1]),
        what: "picture".into(),
        bar: if judged { Bar::AtMost(4.0) } else { Bar::None },
        unit: "ms",
        found,
        note: "the ray cast into storage images; reading back is not counted".into(),
    })
}

pub fn run(cli: &Cli) -> Result<ExitCode> {
    let mut progress = Progress::default();
    progress.stage("reading");
    let data = cli.data.as_deref();
    let engine = data.map(|folder| Scene::real(folder, "engine_256x256x128_uint8.nrrd", 60.0)).transpose()?;
    let torso =
        data.map(|folder| Scene::real(folder, "torso_s0024_287x287x486_uint8.nrrd", 130.0)).transpose()?;
    let gpu = open_gpu(&cli.global)?;
    let software = gpu.info().kind == DeviceKind::Cpu;
    progress.stage("measuring");
    let mut out = Out::new(&cli.global);
    out.device(&gpu);
    let machine = machine::describe();
    out.line(format!("machine   {machine}"));
    out.line(format!("medians of {RUNS} runs in one process, warmed up, lowest and highest in brackets"));
    let mut rows = Rows { rows: Vec::new(), out, progress };
    if cli.bars.contains(&Part::Volumes) {
        volumes(cli, &gpu, [engine, torso], &mut rows)?;
    }
    rows.progress.set(0.8);
    if cli.bars.contains(&Part::Networks) {
        super::networks::bars(cli, software, &mut rows)?;
    }
    if cli.bars.contains(&Part::Meshes) {
        super::meshes::bars(&gpu, software, &mut rows)?;
    }
    check_validation(&gpu)?;
    end(cli, rows, &machine, software)
}

/// Those of volumes, of the real ones where they are given.
fn volumes(cli: &Cli, gpu: &Gpu, real: [Option<Scene>; 2], rows: &mut Rows) -> Result<()> {
    // The most telling first: the same rows small on a software driver.
    let software = gpu.info().kind == DeviceKind::Cpu;
    let (size, radius, pixels) = if software { (64, 12.0, [256, 276]) } else { (512, 50.0, [2064, 2208]) };
    let scenes = [
        ("engine", [(Quadrature::Hybrid, 30.0, 10.0), (Quadrature::Nearest, 20.0, 6.0)]),
        ("skeleton", [(Quadrature::Hybrid, 11.0, 4.0), (Quadrature::Nearest, 7.5, 3.0)]),
    ];
    for (name, rules) in scenes {
        let scene = Scene::built_in(name, size, 60.0)?;
        for rule in rules {
            absolute(gpu, &scene, radius, rule, rows)?;
        }
        rows.progress.set(0.1 * rows.rows.len() as f64 / 4.0);
        if name == "engine" {
            rows.push(against_lao(gpu, &scene, radius, Bar::None)?)?;
            rows.push(memory(cli, &scene, radius)?)?;
            rows.push(picture(gpu, &scene, pixels)?)?;
        }
    }
    rows.progress.set(0.5);
    if let [Some(engine), Some(torso)] = &real {
        rows.push(error(gpu, engine, 20.0, RaySet::Spiral(50), Bar::AtMost(0.0055))?)?;
        rows.push(error(gpu, torso, 50.0, RaySet::Spiral(50), Bar::AtMost(0.014))?)?;
        rows.push(error(gpu, torso, 50.0, RaySet::Spiral(192), Bar::AtMost(0.0062))?)?;
        // These bars are a software driver's; a GPU has milliseconds.
        let at_least = |ratio: f64| if software { Bar::AtLeast(ratio) } else { Bar::None };
        rows.push(against_lao(gpu, engine, 20.0, at_least(12.0))?)?;
        rows.push(against_lao(gpu, torso, 50.0, at_least(40.0))?)?;
        let from = Vec3::new(20.0, -30.0, 10.0);
        rows.push(clip_ratio(gpu, engine, [from, from + Vec3::X], "moved 1 voxel", at_least(2.5))?)?;
        let to = Vec3::new(-35.0, 25.0, 0.0);
        rows.push(clip_ratio(gpu, engine, [from, to], "at a new place", at_least(1.5))?)?;
    }
    if !software && cli.large {
        let scene = Scene::built_in("engine", 1024, 60.0)?;
        absolute(gpu, &scene, radius, (Quadrature::Hybrid, f64::INFINITY, f64::INFINITY), rows)?;
        rows.push(memory(cli, &scene, radius)?)?;
    }
    Ok(())
}

fn end(cli: &Cli, rows: Rows, machine: &str, software: bool) -> Result<ExitCode> {
    let Rows { rows, mut out, progress } = rows;
    drop(progress);
    let reached = rows.iter().all(Row::reached);
    if cli.data.is_none() {
        out.line("not measured: the real volumes; give their folder by --data");
    }
    if software {
        out.line(
            "not judged: milliseconds, memory and pictures; this is a software driver, and they are small",
        );
        out.line("not measured: dvao's published shape, 274 billion operations on a grid of 128³");
    } else if !cli.large {
        out.line("not measured: 1024³; ask for it by --large");
    }
    out.json(json!({
        "machine": machine,
        "reached": reached,
        "bars": rows.iter().map(|row| {
            let (bar, at_least) = match row.bar {
                Bar::AtLeast(bar) => (Some(bar), Some(true)),
                Bar::AtMost(bar) => (Some(bar), Some(false)),
                Bar::None => (None, None),
            };
            json!({
                "where": row.place, "what": row.what, "bar": bar, "at_least": at_least, "unit": row.unit,
                "median": median(&row.found), "runs": row.found, "reached": row.reached(), "note": row.note,
            })
        }).collect::<Vec<_>>(),
    }));
    out.finish()?;
    Ok(if reached { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
