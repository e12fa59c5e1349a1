//! `stereo-bench --bars`: what the project holds itself to, measured in one run, A B A B within one process, and judged.
//!
//! The baseline everywhere is `LAO (unit)` (method.md §2): 54 rays by the sampler, a sample a voxel, every voxel. On large volumes it
//! is timed on a random sample of bricks and scaled by their share of all; the default method is always timed whole, with everything
//! that an update does.

use super::args::Cli;
use super::machine;
use super::statistics::median;
use anyhow::{Context, Result};
use cao::cast::lao::{Bindings, Work};
use cao::cast::volumes::{Kernels, Volumes};
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
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::settings::{Scope, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::volume::Volume;
use cao_twin::Grid;
use glam::Vec3;
use serde_json::json;
use std::path::Path;
use std::process::ExitCode;

const LAO_UNIT: Stage = Stage::new("lao (unit)", Phase::Ambient);

/// Alternating measurements of each row; medians and ranges of them are printed.
const RUNS: usize = 5;

/// Voxels that the baseline is timed on at most, times samples a voxel: some seconds on a software driver.
const BASELINE_SAMPLES: f64 = 1e8;

/// One bar.
struct Row {
    place: &'static str,
    what: &'static str,
    /// The least that is asked for.
    bar: f64,
    /// A ratio for each run.
    ratios: Vec<f64>,
    /// What else to know.
    note: String,
}

impl Row {
    fn reached(&self) -> bool {
        median(&self.ratios) >= self.bar
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
        let opacity = vec![[threshold, 0.0], [threshold + 20.0, 0.8], [255.0, 0.95]];
        let transfer = TransferFunction::new(opacity, vec![[0.0, 1.0, 1.0, 1.0]], None)?;
        Ok(Self { name: name.into(), volume, transfer })
    }

    fn voxel(&self) -> f32 {
        self.volume.min_spacing() as f32
    }
}

/// The default method at its own settings.
fn setup(scene: &Scene, radius_voxels: f32) -> Setup {
    let mut setup = Setup::new(scene.volume.min_spacing());
    setup.occlusion.radius_mm = radius_voxels * scene.voxel();
    setup
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
        let occlusion = Occlusion {
            rays: RaySet::R54,
            radius_mm: radius_voxels * scene.voxel(),
            ..Occlusion::paper(spacing)
        };
        let reference_mm = scene.transfer.reference_mm(spacing);
        let (kernels, volumes) = (Kernels::new(gpu)?, Volumes::new(gpu, &field)?);
        let transfer = TransferBuffer::new(gpu)?;
        let mut rec = gpu.recorder("baseline")?;
        kernels.lao.record_rays(&mut rec, &occlusion)?;
        transfer.record(&mut rec, &scene.transfer)?;
        Opacity::new(gpu)?.record(&mut rec, &field, &transfer, &volumes.opacity)?;
        rec.submit_and_wait()?;

        let all = field.brick_count();
        let samples = occlusion.rays.count() as f64 * f64::from(radius_voxels) * 512.0;
        let wanted = ((BASELINE_SAMPLES / samples) as u32).clamp(1, all);
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
        let (field, count) = (&self.field, self.bricks);
        self.kernels.lao.record_part(
            &mut rec,
            field,
            &self.occlusion,
            self.reference_mm,
            Scope::All,
            Work::Full,
            bindings,
            0,
            count,
        )?;
        rec.end_stage()?;
        Ok(rec.submit_and_wait()?.total() * self.scale)
    }

    fn note(&self) -> String {
        format!("LAO (unit) on {} of {} bricks", self.bricks, self.field.brick_count())
    }
}

/// Time of a whole update in ms: nothing is taken as known.
fn full_update(renderer: &mut Renderer) -> Result<f64> {
    renderer.invalidate();
    Ok(renderer.update(&mut |_| ())?.total())
}

fn against_lao(gpu: &Gpu, scene: &Scene, radius_voxels: f32, bar: (&'static str, f64)) -> Result<Row> {
    let baseline = Baseline::new(gpu, scene, radius_voxels)?;
    let setup = setup(scene, radius_voxels);
    let mut renderer = Renderer::new(gpu, &scene.volume, scene.transfer.clone(), setup, COLOUR)?;
    let mut ratios = Vec::new();
    let mut times = [Vec::new(), Vec::new()];
    full_update(&mut renderer)?;
    for _ in 0..RUNS {
        times[0].push(baseline.measure(gpu)?);
        times[1].push(full_update(&mut renderer)?);
        ratios.push(times[0][times[0].len() - 1] / times[1][times[1].len() - 1]);
    }
    let note = format!(
        "{}: {:.0} against {:.1} ms; {}",
        scene.name,
        median(&times[0]),
        median(&times[1]),
        baseline.note()
    );
    Ok(Row { place: bar.0, what: "full update against LAO (unit), 54 rays", bar: bar.1, ratios, note })
}

/// Error of LAO (unit), 54 rays, over that of the default, both against the ambient reference.
fn error_ratio(
    gpu: &Gpu,
    scene: &Scene,
    radius_voxels: f32,
    (place, bar): (&'static str, f64),
) -> Result<Row> {
    let grid = Grid { dims: scene.volume.dims, spacing: scene.volume.spacing };
    let own = setup(scene, radius_voxels);
    let mut renderer = Renderer::new(gpu, &scene.volume, scene.transfer.clone(), own, COLOUR)?;
    renderer.update(&mut |_| ())?;
    let (opacity, found) = (renderer.read_opacity()?, renderer.read_ambient()?);
    drop(renderer);
    let plan = Plan { directions: 1000, steps_per_voxel: 8, max_voxels: 3000 };
    let reference_mm = f64::from(scene.transfer.reference_mm(scene.volume.min_spacing()));
    let radius_mm = f64::from(radius_voxels * scene.voxel());
    let offset_mm = 0.5 * scene.volume.min_spacing();
    let reference = ambient(gpu, &grid, &opacity, radius_mm, offset_mm, reference_mm, &plan, &mut |_| ())?;
    let own = errors(&found, &reference.ambient, &reference.counts);

    // LAO (unit) at the bricks of the same voxels.
    let baseline = Baseline::new(gpu, scene, radius_voxels)?;
    let [bx, by, _] = baseline.field.bricks();
    let mut bricks: Vec<u32> = (0..grid.len())
        .filter(|&i| reference.counts[i])
        .map(|i| grid.voxel(i).map(|c| c as u32 / 8))
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
        "{}: RMSE {:.5} against {:.5} at {} voxels; the reference's own {:.5}",
        scene.name, own.rmse, lao.rmse, own.count, reference.convergence.rmse
    );
    Ok(Row {
        place,
        what: "error of LAO (unit), 54 rays, over ours",
        bar,
        ratios: vec![lao.rmse / own.rmse],
        note,
    })
}

/// A sphere of a quarter of the volume's size in a place of its material, moved one voxel or to a new place.
fn clip_update(gpu: &Gpu, scene: &Scene, moves: [Vec3; 2], place: &'static str, bar: f64) -> Result<Row> {
    let setup = setup(scene, 20.0);
    let mut renderer = Renderer::new(gpu, &scene.volume, scene.transfer.clone(), setup, COLOUR)?;
    let radius = 0.125 * scene.volume.size_mm().into_iter().fold(0.0, f64::max) as f32;
    let clip = |place: Vec3| {
        let pose =
            Pose { translate_mm: place * scene.voxel(), scale: Vec3::splat(radius), ..Pose::default() };
        Clip { pose, ..Clip::remove(Shape::Sphere) }
    };
    renderer.set_clips(&[clip(moves[0])])?;
    full_update(&mut renderer)?;
    let mut times = [Vec::new(), Vec::new()];
    let mut touched = 0.0;
    for run in 0..RUNS {
        times[0].push(full_update(&mut renderer)?);
        renderer.set_clips(&[clip(moves[(run + 1) % 2])])?;
        times[1].push(renderer.update(&mut |_| ())?.total());
        touched = f64::from(renderer.categories()?.affected) / scene.volume.len() as f64;
    }
    let ratios = times[0].iter().zip(&times[1]).map(|(full, update)| full / update).collect();
    let note = format!(
        "{}: {:.1} against {:.1} ms, {:.1} % of all voxels recomputed",
        scene.name,
        median(&times[0]),
        median(&times[1]),
        100.0 * touched
    );
    Ok(Row { place, what: "clip update against full update", bar, ratios, note })
}

fn real(folder: &Path, name: &str, threshold: f32) -> Result<Scene> {
    let path = folder.join("volumes").join(name);
    let volume =
        cao_formats::open(&path.to_string_lossy()).with_context(|| format!("--data {}", folder.display()))?;
    Scene::new(name.split('_').next().unwrap_or(name), volume, threshold)
}

pub fn run(cli: &Cli) -> Result<ExitCode> {
    let mut progress = Progress::default();
    progress.stage("reading");
    let built_in = Scene::new("builtin:engine:128", cao_formats::open("builtin:engine:128")?, 60.0)?;
    let data = cli.data.as_deref();
    let engine = data.map(|folder| real(folder, "engine_256x256x128_uint8.nrrd", 60.0)).transpose()?;
    let torso = data.map(|folder| real(folder, "torso_s0024_287x287x486_uint8.nrrd", 130.0)).transpose()?;
    progress.stage("measuring");
    let gpu = open_gpu(&cli.global)?;
    let mut rows = Vec::new();
    let total = if data.is_some() { 8.0 } else { 2.0 };
    let mut push = |row: Row| {
        rows.push(row);
        progress.set(rows.len() as f64 / total);
    };
    push(against_lao(&gpu, &built_in, 20.0, ("128³, R = 20", 8.0))?);
    push(against_lao(&gpu, &built_in, 50.0, ("128³, R = 50", 10.0))?);
    if let (Some(engine), Some(torso)) = (&engine, &torso) {
        push(against_lao(&gpu, engine, 20.0, ("engine, R = 20", 12.0))?);
        push(against_lao(&gpu, torso, 50.0, ("torso, R = 50", 40.0))?);
        push(error_ratio(&gpu, engine, 20.0, ("engine, R = 20", 5.0))?);
        push(error_ratio(&gpu, torso, 50.0, ("torso, R = 50", 1.3))?);
        let from = Vec3::new(20.0, -30.0, 10.0);
        push(clip_update(&gpu, engine, [from, from + Vec3::X], "engine, R = 20, sphere moved 1 voxel", 2.5)?);
        let to = Vec3::new(-35.0, 25.0, 0.0);
        push(clip_update(&gpu, engine, [from, to], "engine, R = 20, sphere at a new place", 1.5)?);
    }
    check_validation(&gpu)?;
    drop(progress);

    let mut out = Out::new(&cli.global);
    out.device(&gpu);
    let machine = machine::describe();
    out.line(format!("machine   {machine}"));
    out.line(format!("medians of {RUNS} alternating runs in one process, lowest and highest in brackets"));
    let mut reached = true;
    for row in &rows {
        let range = |pick: fn(f64, f64) -> f64| row.ratios.iter().copied().reduce(pick).unwrap_or(f64::NAN);
        let (low, high) = (range(f64::min), range(f64::max));
        reached &= row.reached();
        out.line(format!(
            "{:<6} {:<38} {:<42} {:>7.2} x [{low:.2} … {high:.2}], bar ≥ {}",
            if row.reached() { "ok" } else { "MISSED" },
            row.place,
            row.what,
            median(&row.ratios),
            row.bar
        ));
        out.line(format!("       {}", row.note));
    }
    if data.is_none() {
        out.line("not measured: the real volumes; give their folder by --data");
    }
    if gpu.info().kind == DeviceKind::Cpu {
        out.line("not measured: the bars of a data-centre GPU; this is a software driver");
    }
    out.json(json!({
        "machine": machine,
        "reached": reached,
        "bars": rows.iter().map(|row| json!({
            "where": row.place, "what": row.what, "bar": row.bar,
            "median": median(&row.ratios), "ratios": row.ratios, "reached": row.reached(), "note": row.note,
        })).collect::<Vec<_>>(),
    }));
    out.finish()?;
    Ok(if reached { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
