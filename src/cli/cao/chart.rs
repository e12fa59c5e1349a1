//! `cao chart`: time against error of every method, as a report.

use crate::args::{self, Chart as Args, Global, usage};
use anyhow::{Context, Result};
use cao_cli::output::{Out, Progress, check_targets, check_validation, open_gpu};
use cao_formats::write_atomic;
use cao_measure::chart;
use cao_measure::chart::peers::Peers;
use cao_measure::chart::{Chart, Plan, Scene, csv, draw, report};
use cao_measure::contender::{Change, State};
use cao_measure::reference;
use serde_json::json;
use std::path::Path;
use std::process::ExitCode;

/// Scenes where none is given, of a size at which a software driver takes minutes; and their radius in voxels, a sixth of the
/// edge, so that the clip touches not much more of them than the paper's clips do.
const DEFAULT: [&str; 3] = ["builtin:engine:48", "builtin:fruit:48", "builtin:skeleton:48"];
const DEFAULT_RADIUS: f32 = 8.0;
/// The same for a first look.
const QUICK: [&str; 3] = ["builtin:engine:32", "builtin:fruit:32", "builtin:skeleton:32"];
const QUICK_RADIUS: f32 = 6.0;

pub fn run(global: &Global, args: &Args) -> Result<ExitCode> {
    let folder = Folder::prepare(args)?;
    let peers = args.peers.as_deref().map(read_peers).transpose()?;
    let mut progress = Progress::default();
    progress.stage("reading");
    let scenes = scenes(args)?;
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let plan = plan(args);
    progress.stage("measuring");
    let chart = chart::measure(&gpu, &scenes, &plan, &mut |what, share| {
        progress.say(what);
        progress.set(share);
    })?;
    check_validation(&gpu)?;
    progress.stage("writing");
    let caption = chart.caption();
    let every: Vec<_> = chart.scenes.iter().collect();
    let drawing = draw::draw(&chart, &every, &caption);
    let files = [
        ("runs.csv", csv::runs(&chart).into_bytes()),
        ("chart.svg", drawing.svg().into_bytes()),
        ("chart.png", drawing.png()?),
        ("report.html", report::html(&chart, &machine(), &command(), peers.as_ref())?.into_bytes()),
    ];
    folder.write(&files)?;
    drop(progress);

    let mut out = Out::new(global);
    out.device(&gpu);
    summary(&mut out, &chart);
    for (name, _) in &files {
        out.wrote(&args.output.join(name));
    }
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

fn read_peers(path: &Path) -> Result<Peers> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    Peers::parse(&text).with_context(|| path.display().to_string())
}

/// The processor, which on a software driver is the device.
fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let name = name.map_or(std::env::consts::ARCH, |(_, name)| name.trim());
    format!("{name}, {cores} cores, {}", std::env::consts::OS)
}

/// As it was typed, but for the program's place.
fn command() -> String {
    let typed =
        std::env::args().skip(1).map(|word| if word.contains(' ') { format!("'{word}'") } else { word });
    std::iter::once("cao".to_owned()).chain(typed).collect::<Vec<_>>().join(" ")
}

fn plan(args: &Args) -> Plan {
    let full = reference::Plan { max_voxels: 2000, ..reference::Plan::FULL };
    let quick = reference::Plan { max_voxels: 1000, ..reference::Plan::QUICK };
    Plan {
        quick: args.quick,
        runs: args.runs,
        size: if args.quick { [192, 192] } else { [384, 384] },
        reference: if args.quick { quick } else { full },
    }
}

fn scenes(args: &Args) -> Result<Vec<Scene>> {
    let (names, radius) = match (args.scenes.is_empty(), args.quick) {
        (true, false) => (DEFAULT.map(String::from).to_vec(), Some(DEFAULT_RADIUS)),
        (true, true) => (QUICK.map(String::from).to_vec(), Some(QUICK_RADIUS)),
        (false, _) => (args.scenes.clone(), None),
    };
    for (i, name) in names.iter().enumerate() {
        if names[..i].contains(name) {
            return Err(usage(format!("{name}: is given twice; expected different scenes")));
        }
    }
    names.iter().map(|name| scene(args, name, radius)).collect()
}

fn scene(args: &Args, name: &str, radius: Option<f32>) -> Result<Scene> {
    let is_scene = name.to_lowercase().ends_with(".toml");
    if let Some(flag) = args.raw.given().filter(|_| is_scene) {
        return Err(usage(format!("{flag}: the scene {name} says what its volume is")));
    }
    let described = match is_scene {
        true => cao_formats::Scene::load(Path::new(name))?,
        false => cao_formats::Scene::default_for(args.raw.source(name)?),
    };
    let volume = args::open(&described.volume, name)?;
    let transfer = match &args.transfer {
        Some(spec) => cao_formats::transfer::load(spec, volume.range())?,
        None => described.transfer(volume.range())?,
    };
    let resolved = described.occlusion.setup(volume.min_spacing())?.occlusion;
    let clips = match described.clips.is_empty() {
        true => vec![Scene::default_clip(&volume)],
        false => described.clips,
    };
    let radius_mm = args.radius_mm.or(radius).unwrap_or(resolved.radius_mm);
    let rig = described.stereo.rig(volume.size_mm());
    Ok(Scene { name: name.into(), volume, state: State { clips, transfer, radius_mm }, rig })
}

/// The folder that is written to.
struct Folder<'a> {
    path: &'a Path,
    /// Made here, and to be removed again if nothing comes of it.
    made: bool,
}

impl<'a> Folder<'a> {
    /// Makes sure, before anything long begins, that files can be written.
    fn prepare(args: &'a Args) -> Result<Self> {
        let path = args.output.as_path();
        let shown = path.display();
        if path.exists() && !path.is_dir() {
            return Err(usage(format!("{shown}: is a file, expected a folder")));
        }
        let made = !path.exists();
        if made {
            std::fs::create_dir(path).with_context(|| format!("cannot make the folder {shown}"))?;
        }
        let folder = Self { path, made };
        let inputs = || args.scenes.iter().map(Path::new);
        for file in ["runs.csv", "chart.svg", "chart.png", "report.html"] {
            let extension = file.split('.').next_back().unwrap_or_default();
            check_targets(&[&path.join(file)], extension, inputs())?;
        }
        Ok(folder)
    }

    fn write(mut self, files: &[(&str, Vec<u8>)]) -> Result<()> {
        for (name, content) in files {
            write_atomic(&self.path.join(name), |file| file.write_all(content))?;
        }
        self.made = false;
        Ok(())
    }
}

impl Drop for Folder<'_> {
    fn drop(&mut self) {
        if self.made {
            // Only if it is empty; a failure to tidy up hides no other.
            let _ = std::fs::remove_dir(self.path);
        }
    }
}

fn summary(out: &mut Out, chart: &Chart) {
    let ratios = chart.software;
    let every: Vec<_> = chart.scenes.iter().collect();
    let unit = if ratios { "x" } else { "ms" };
    for change in Change::ALL {
        out.line(format!("{}: Pareto front, time in {unit}", change.name()));
        let marks = draw::marks(&every, change, ratios);
        for mark in draw::front_of(&marks).into_iter().map(|i| &marks[i]) {
            let setting = mark.of.setting.name();
            let [low, time, high] = mark.time;
            out.line(format!(
                "  {:<12} {setting:<14} {time:>9.4} {unit} ({low:.4} … {high:.4})   rmse {:.4}",
                mark.of.method, mark.error
            ));
        }
    }
    let points = chart.scenes.iter().flat_map(|scene| scene.points.iter().map(move |point| (scene, point)));
    let points: Vec<_> = points
        .map(|(scene, point)| {
            json!({
                "scene": scene.name, "change": point.change.name(), "method": point.method,
                "setting": point.setting.name(), "details": point.setting.details,
                "ms": point.ms(), "ratio": point.ratio(), "runs": point.runs.len(),
                "errors_at": if point.on_surface { "surface" } else { "voxels" },
                "points": point.errors.count, "rmse": point.errors.rmse, "max": point.errors.max,
                "bias": point.errors.bias, "rmse_shape": point.shape.rmse, "ssim3d": point.ssim_3d
            })
        })
        .collect();
    out.json(json!({ "quoted_as": if ratios { "ratio" } else { "ms" }, "points": points }));
}
