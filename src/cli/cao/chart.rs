//! `cao chart`: time against error of every method, as a report.

use crate::args::{self, Chart as Args, Global, usage};
use anyhow::{Context, Result, bail};
use cao_cli::output::{Out, Progress, check_validation, open_gpu};
use cao_cli::targets::Targets;
use cao_measure::chart;
use cao_measure::chart::front::quartiles;
use cao_measure::chart::looks::{self, ERRORS, Looks};
use cao_measure::chart::meshes_scenes::MeshScene;
use cao_measure::chart::peers::Peers;
use cao_measure::chart::{Chart, Plan, Scene, csv, draw, looks_draw, meshes, meshes_panel, report};
use cao_measure::contender::{Change, State};
use cao_measure::reference;
use cao_model::error::shown_path;
use cao_model::network::{Label, Network};
use serde_json::json;
use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::process::ExitCode;

/// Scenes where none is given, of a size at which a software driver takes minutes; and their radius in voxels, a sixth of the
/// edge, so that the clip touches not much more of them than the paper's clips do.
const DEFAULT: [&str; 3] = ["builtin:engine:48", "builtin:fruit:48", "builtin:skeleton:48"];
const DEFAULT_RADIUS: f32 = 8.0;
/// The same for a first look.
const QUICK: [&str; 3] = ["builtin:engine:22", "builtin:fruit:22", "builtin:skeleton:22"];
const QUICK_RADIUS: f32 = 4.0;

/// What is written; the last where meshes have a panel.
const FILES: [&str; 8] = [
    "runs.csv",
    "chart.svg",
    "chart.png",
    "pictures.csv",
    "pictures.svg",
    "pictures.png",
    "report.html",
    "meshes.csv",
];

/// What `--paper` writes.
const PAPER: [&str; 10] = [
    "paper.html",
    "runs.csv",
    "figure-1.png",
    "figure-8.png",
    "figure-10-engine.png",
    "figure-10-beetle.png",
    "figure-10-skeleton.png",
    "figure-11-engine.png",
    "figure-11-beetle.png",
    "figure-11-skeleton.png",
];

/// What `--fdao` writes.
const FDAO: [&str; 5] = ["features.html", "features.csv", "figure-1.png", "figure-3.png", "figure-4.png"];

/// What `--dvao` writes.
const DVAO: [&str; 3] = ["network.html", "network.csv", "figure-8.png"];

/// What `--meshes` writes.
const MESHES: [&str; 10] = [
    "meshes.html",
    "meshes.csv",
    "fits.csv",
    "verdicts.csv",
    "meshes.svg",
    "meshes.png",
    "figure-5.png",
    "figure-10.svg",
    "figure-10.png",
    "figure-11.png",
];

pub fn run(global: &Global, args: &Args) -> Result<ExitCode> {
    // One folder is made; a longer way that is not there is a slip.
    if let Some(around) = args.output.parent().filter(|around| **around != *"" && !around.is_dir()) {
        bail!("cannot write {}: there is no folder {}", shown_path(&args.output), shown_path(around));
    }
    if !(args.data.is_empty() || args.paper || args.meshes) {
        return Err(usage("--data: has no effect without --paper or --meshes"));
    }
    if args.paper {
        return paper(global, args);
    }
    if args.fdao {
        return fdao(global, args);
    }
    if args.dvao {
        return dvao(global, args);
    }
    if args.meshes {
        return only_meshes(global, args);
    }
    // Scenes of one's own are not what meshes are measured on.
    let has_meshes = args.scenes.is_empty();
    let files = FILES.into_iter().take(FILES.len() - usize::from(!has_meshes));
    let targets = Targets::in_folder(&args.output, files.map(str::to_owned))?;
    let peers = args.peers.as_deref().map(read_peers).transpose()?;
    let mut progress = Progress::default();
    progress.stage("reading");
    let scenes = scenes(args)?;
    targets.spare_inputs()?;
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let plan = plan(args);
    if !args.quick {
        let foreseen = chart::foresee(&gpu, &scenes, &plan)?;
        cao_cli::say(&format!(
            "measuring will take some {:.0} minutes on this machine, give or take half, and up to {:.0} MiB of the device's memory; \
             --quick takes two minutes",
            foreseen.minutes.ceil(),
            foreseen.device_bytes as f64 / f64::from(1 << 20)
        ));
    }
    progress.stage("measuring");
    let mut chart = chart::measure(&gpu, &scenes, &plan, &mut |what, share| {
        progress.say(what);
        progress.set(share);
    })?;
    if has_meshes {
        progress.stage("measuring meshes");
        let plan = meshes::Plan::panel(&gpu, args.quick, args.runs);
        chart.meshes = Some(meshes::measure(&gpu, &plan, Vec::new(), &mut |what, share| {
            progress.say(what);
            progress.set(share);
        })?);
    }
    check_validation(&gpu)?;
    progress.stage("writing");
    let caption = chart.caption();
    let every: Vec<_> = chart.scenes.iter().collect();
    let drawing = draw::draw(&chart, &every, &caption);
    let pictures = looks_draw::draw(&chart);
    let mut contents = vec![
        csv::runs(&chart).into_bytes(),
        drawing.svg().into_bytes(),
        drawing.png()?,
        csv::pictures(&chart).into_bytes(),
        pictures.svg().into_bytes(),
        pictures.png()?,
        report::html(&chart, &machine(), &command(), peers.as_ref())?.into_bytes(),
    ];
    contents.extend(chart.meshes.as_ref().map(|found| found.runs().into_bytes()));
    targets.write_all(&contents)?;
    drop(progress);

    let mut out = Out::new(global);
    out.device(&gpu);
    summary(&mut out, &chart);
    for path in targets.paths() {
        out.wrote(path);
    }
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

/// `--paper`: says what it will take, then measures.
fn paper(global: &Global, args: &Args) -> Result<ExitCode> {
    let targets = Targets::in_folder(&args.output, PAPER.map(str::to_owned))?;
    let mut progress = Progress::default();
    progress.stage("reading");
    let files = args.data.iter().map(|name| {
        let volume = args.raw.open(name)?;
        Ok((shown_path(name), volume))
    });
    let files = files.collect::<Result<Vec<_>>>()?;
    targets.spare_inputs()?;
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let plan = chart::paper::Plan::of(&gpu, args.quick, args.runs);
    let scenes = chart::paper::scenes(&plan, files)?;
    let needs = chart::paper::estimate(&gpu, &scenes, &plan)?;
    let mut out = Out::new(global);
    out.device(&gpu);
    let needs = format!(
        "about {:.0} s and {:.2} GB of device memory, by a small update on this device",
        needs.seconds.ceil(),
        needs.bytes as f64 / 1e9
    );
    out.line(format!("foreseen  {needs}"));
    progress.aside(|| out.show())?;
    progress.stage("measuring");
    let found = chart::paper::measure(&gpu, scenes, &plan, &mut |what, share| {
        progress.say(what);
        progress.set(share);
    })?;
    check_validation(&gpu)?;
    progress.stage("writing");
    let mut contents =
        vec![found.html(&machine(), &command())?.into_bytes(), csv::runs(&found.chart).into_bytes()];
    for number in [1, 8, 10, 11] {
        let own: Vec<_> = found.figures.iter().filter(|(of, ..)| *of == number).collect();
        for (.., picture) in own {
            contents.push(picture.png()?);
        }
    }
    targets.write_all(&contents)?;
    drop(progress);
    for line in found.caption() {
        out.line(line);
    }
    for rays in ["6", "54"] {
        let set = cao_model::occlusion::RaySet::parse(rays)?;
        let ups: Vec<String> = found.speed_ups(set).iter().map(|up| format!("{up:.2}")).collect();
        out.line(format!("speed-up of the update with {rays} rays: {}", ups.join(", ")));
    }
    for path in targets.paths() {
        out.wrote(path);
    }
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

/// `--fdao`.
fn fdao(global: &Global, args: &Args) -> Result<ExitCode> {
    let targets = Targets::in_folder(&args.output, FDAO.map(str::to_owned))?;
    let mut progress = Progress::default();
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let plan = chart::features::Plan::of(&gpu, args.quick, args.runs);
    progress.stage("measuring");
    let found = chart::features::measure(&gpu, &plan, &mut |what, share| {
        progress.say(what);
        progress.set(share);
    })?;
    check_validation(&gpu)?;
    progress.stage("writing");
    let mut contents = vec![found.html(&machine(), &command())?.into_bytes(), found.runs().into_bytes()];
    for (.., picture) in &found.figures {
        contents.push(picture.png()?);
    }
    targets.write_all(&contents)?;
    drop(progress);
    let mut out = Out::new(global);
    out.device(&gpu);
    for line in found.caption().into_iter().skip(1).chain(found.ratios()) {
        out.line(line);
    }
    for path in targets.paths() {
        out.wrote(path);
    }
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

/// `--dvao`.
fn dvao(global: &Global, args: &Args) -> Result<ExitCode> {
    let targets = Targets::in_folder(&args.output, DVAO.map(str::to_owned))?;
    let mut progress = Progress::default();
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let plan = chart::deep::Plan::of(&gpu, args.quick, args.runs);
    let network = args.network.clone().unwrap_or_else(Network::small);
    progress.stage("measuring");
    let found = chart::deep::measure(&gpu, &network, &plan, &mut |what, share| {
        progress.say(what);
        progress.set(share);
    })?;
    check_validation(&gpu)?;
    progress.stage("writing");
    let (_, picture) = &found.figure;
    let page = found.html(&machine(), &command())?;
    targets.write_all(&[page.into_bytes(), found.runs().into_bytes(), picture.png()?])?;
    drop(progress);
    let mut out = Out::new(global);
    out.device(&gpu);
    for line in found.caption().into_iter().skip(1).chain(found.lines()) {
        out.line(line);
    }
    let rows: Vec<_> = Label::ALL
        .into_iter()
        .flat_map(|label| found.means(label).into_iter().map(move |row| (label, row)))
        .map(|(label, (of, [ssim, mse], [ms, bytes]))| {
            json!({
                "truth": label.name(), "method": of.name(), "printed": of.printed(),
                "ssim3d": ssim, "mse": mse, "ms": ms, "bytes": bytes
            })
        })
        .collect();
    out.json(json!({ "edge": plan.edge, "rows": rows }));
    for path in targets.paths() {
        out.wrote(path);
    }
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

/// `--meshes`.
fn only_meshes(global: &Global, args: &Args) -> Result<ExitCode> {
    let targets = Targets::in_folder(&args.output, MESHES.map(str::to_owned))?;
    let mut progress = Progress::default();
    progress.stage("reading");
    let scans = args.data.iter().map(|name| MeshScene::scan(Path::new(name))).collect::<Result<_, _>>()?;
    targets.spare_inputs()?;
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let plan = meshes::Plan::of(&gpu, args.quick, args.size, args.rays, args.runs);
    progress.stage("measuring");
    let found = meshes::measure(&gpu, &plan, scans, &mut |what, share| {
        progress.say(what);
        progress.set(share);
    })?;
    check_validation(&gpu)?;
    progress.stage("writing");
    let (panels, figure_10) = (meshes_panel::draw(&found), meshes_panel::figure_10(&found));
    targets.write_all(&[
        found.html(&machine(), &command())?.into_bytes(),
        found.runs().into_bytes(),
        found.fitted().into_bytes(),
        found.judged().into_bytes(),
        panels.svg().into_bytes(),
        panels.png()?,
        found.figure_5().png()?,
        figure_10.svg().into_bytes(),
        figure_10.png()?,
        found.figure_11().png()?,
    ])?;
    drop(progress);
    let mut out = Out::new(global);
    out.device(&gpu);
    for line in found.caption().into_iter().skip(1).chain(found.lines()) {
        out.line(line);
    }
    let rows = found.scenes.iter().flat_map(|scene| scene.rows.iter().map(move |row| (scene, row)));
    let rows: Vec<_> = rows
        .map(|(scene, row)| {
            json!({
                "scene": scene.scene.name, "method": row.of.name(plan.rays), "printed": row.of.printed(&scene.scene.name),
                "error": row.error, "rmse": row.rmse, "ms": row.median(), "over_aov": scene.ratio(row.of)
            })
        })
        .collect();
    let verdicts: Vec<_> = found
        .verdicts()
        .into_iter()
        .map(|verdict| {
            json!({
                "claim": verdict.claim, "holds": verdict.holds, "printed": verdict.printed, "reached": verdict.reached()
            })
        })
        .collect();
    out.json(json!({ "size": plan.size, "rays": plan.rays, "rows": rows, "verdicts": verdicts }));
    for path in targets.paths() {
        out.wrote(path);
    }
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

fn read_peers(path: &Path) -> Result<Peers> {
    let text = cao_formats::file::read_text(path)?;
    Peers::parse(&text).with_context(|| shown_path(path))
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
    let typed = std::env::args_os()
        .skip(1)
        .map(shown_path)
        .map(|word| if word.contains(' ') { format!("'{word}'") } else { word });
    std::iter::once("cao".to_owned()).chain(typed).collect::<Vec<_>>().join(" ")
}

fn plan(args: &Args) -> Plan {
    let full = reference::Plan { max_voxels: 2000, ..reference::Plan::FULL };
    let quick = reference::Plan { max_voxels: 1000, ..reference::Plan::QUICK };
    Plan {
        quick: args.quick,
        runs: args.runs,
        size: if args.quick { [128, 128] } else { [384, 384] },
        pictures: if args.quick { [32, 32] } else { [128, 128] },
        reference: if args.quick { quick } else { full },
    }
}

fn scenes(args: &Args) -> Result<Vec<Scene>> {
    let (names, radius) = match (args.scenes.is_empty(), args.quick) {
        (true, false) => (DEFAULT.map(OsString::from).to_vec(), Some(DEFAULT_RADIUS)),
        (true, true) => (QUICK.map(OsString::from).to_vec(), Some(QUICK_RADIUS)),
        (false, _) => (args.scenes.clone(), None),
    };
    for (i, name) in names.iter().enumerate() {
        if names[..i].contains(name) {
            return Err(usage(format!("{}: is given twice; expected different scenes", shown_path(name))));
        }
    }
    names.iter().map(|name| scene(args, name, radius)).collect()
}

fn scene(args: &Args, name: &OsStr, radius: Option<f32>) -> Result<Scene> {
    let is_scene = args::has_extension(name, "toml");
    if let Some(flag) = args.raw.given().filter(|_| is_scene) {
        return Err(usage(format!("{flag}: the scene {} says what its volume is", shown_path(name))));
    }
    let described = match is_scene {
        true => cao_formats::Scene::load(Path::new(name))?,
        false => cao_formats::Scene::default_for(args.raw.source(name)?),
    };
    let volume =
        args::open(args::volume_of(&described, name)?, args.raw.choices.or(described.reading), name)?;
    let (mut volume, turn) = described.frame.arrange(volume)?;
    let transfer = match &args.transfer {
        Some(spec) => cao_formats::transfer::load(spec, volume.range()),
        None => described.transfer(volume.range()),
    };
    let transfer = args::transfer(transfer, &mut volume, name)?;
    let resolved = described.occlusion.setup(volume.min_spacing())?.occlusion;
    let clips = match described.clips.is_empty() {
        true => vec![Scene::default_clip(&volume)],
        false => turn.clips(&described.clips),
    };
    let radius_mm = args.radius_mm.or(radius).unwrap_or(resolved.radius_mm);
    let rig = turn.rig(&described.stereo.rig(turn.extent(volume.size_mm())));
    Ok(Scene { name: shown_path(name), volume, state: State { clips, transfer, radius_mm }, rig })
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
    if let Some(found) = &chart.meshes {
        summary_of_meshes(out, found);
    }
    for scene in &chart.scenes {
        scene.left_out.iter().for_each(|left_out| out.line(format!("{}: {left_out}", scene.name)));
    }
    let looks: Vec<&Looks> = chart.scenes.iter().map(|scene| &scene.looks).collect();
    let marks = looks::marks(&looks, ratios);
    out.line(format!("picture: Pareto front by FLIP, ray cast in {unit}"));
    for mark in looks::front_of(&marks, ERRORS[0].1).into_iter().map(|i| &marks[i]) {
        let [low, time, high] = mark.time;
        out.line(format!(
            "  {:<27} {time:>9.4} {unit} ({low:.4} … {high:.4})   FLIP {:.4}, RMSE {:.2} levels{}",
            mark.setting.name(),
            mark.error.flip,
            mark.error.levels,
            if mark.setting.is_default() { ", the default" } else { "" }
        ));
    }
    out.line(format!("  {}", chart.verdict()));
    let pictures: Vec<_> = chart.scenes.iter().flat_map(|scene| scene.looks.drawn.iter().map(move |drawn| (scene, drawn)))
        .map(|(scene, drawn)| json!({
            "scene": scene.name, "setting": drawn.setting.name(), "default": drawn.setting.is_default(),
            "ms": quartiles(drawn.runs.iter().map(|run| run[0])), "ratio": quartiles(drawn.runs.iter().map(|run| run[1])),
            "flip": drawn.error.flip, "rmse_levels": drawn.error.levels
        }))
        .collect();
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
    let left_out = chart.scenes.iter().flat_map(|scene| scene.left_out.iter().map(move |out| (scene, out)));
    let left_out: Vec<_> = left_out
        .map(|(scene, out)| {
            json!({
                "scene": scene.name, "method": out.method, "setting": out.setting.name(),
                "change": out.change.map(Change::name), "why": out.why
            })
        })
        .collect();
    out.json(json!({
        "quoted_as": if ratios { "ratio" } else { "ms" }, "points": points, "left_out": left_out, "pictures": pictures
    }));
}

fn summary_of_meshes(out: &mut Out, found: &meshes::Found) {
    let unit = if found.software { "x" } else { "ms" };
    out.line(format!("meshes: Pareto front, time in {unit}"));
    let marks = meshes_panel::marks(&found.built().collect::<Vec<_>>(), found.software);
    for mark in meshes_panel::front_of(&marks).into_iter().map(|i| &marks[i]) {
        let [low, time, high] = mark.time;
        out.line(format!(
            "  {:<27} {time:>9.4} {unit} ({low:.4} … {high:.4})   error {:.2}",
            mark.of.name(found.plan.rays),
            mark.error
        ));
    }
    let marks: Vec<_> = marks
        .iter()
        .map(
            |mark| json!({ "method": mark.of.name(found.plan.rays), "time": mark.time, "error": mark.error }),
        )
        .collect();
    out.json(json!({ "meshes": marks }));
}
