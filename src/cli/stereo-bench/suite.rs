//! What the command line asks for, measured and reported: the base configuration, then the series.

use super::args::Cli;
use super::frames::{Configuration, Input, Measured, Plan, measure};
use super::path::PERIOD;
use super::{csv, machine, report, save};
use anyhow::{Context, Result};
use cao_cli::args::{self, setup, shape, usage};
use cao_cli::output::{Out, Progress, check_validation, open_gpu};
use cao_cli::targets::Targets;
use cao_gpu::DeviceKind;
use cao_model::clip::Shape;
use cao_model::error::shown_path;
use cao_model::methods::Method;
use serde_json::{Map, json};
use std::ffi::OsStr;
use std::process::ExitCode;
use std::rc::Rc;

/// Frames of a run on a software driver, unless the user says how many.
const SOFTWARE_FRAMES: u32 = 10;

pub fn run(cli: &Cli) -> Result<ExitCode> {
    let transfer = cli.settings.transfer.as_deref().unwrap_or(OsStr::new("auto"));
    let table = Targets::files(&cli.csv, "csv")?;
    let mut plan = plan(cli)?;
    let mut progress = Progress::default();
    progress.stage("reading");
    let base = base(cli, transfer)?;
    let groups = groups(cli, base, transfer)?;
    table.spare_inputs()?;

    progress.stage("preparing");
    let gpu = open_gpu(&cli.global)?;
    plan.frames = cli.frames.unwrap_or(match gpu.info().kind {
        // A frame that takes a graphics card milliseconds takes a processor seconds.
        DeviceKind::Cpu => SOFTWARE_FRAMES,
        _ => PERIOD,
    });
    // The folder's name is found anew at the end: another run may have taken it.
    let keep = || cli.save.as_deref().map(|parent| save::targets(parent, &gpu)).transpose();
    keep()?;
    let machine = machine::describe();
    progress.stage("measuring");
    let points: usize = groups.iter().map(|group| group.points.len()).sum();
    let total = plan.total() * points as u64;
    let mut done = 0;
    let mut results = Vec::new();
    for Group { series, points } in groups {
        let (values, configurations): (Vec<_>, Vec<_>) = points.into_iter().unzip();
        let measured = measure(&gpu, &configurations, &plan, &mut || {
            done += 1;
            progress.set(done as f64 / total as f64);
        })?;
        let points = values.into_iter().zip(configurations).zip(measured);
        results.extend(points.map(|((value, configuration), measured)| Outcome {
            series,
            value,
            configuration,
            measured,
        }));
    }
    check_validation(&gpu)?;
    drop(progress);

    let mut out = Out::new(&cli.global);
    out.device(&gpu);
    out.line(format!("machine   {machine}"));
    out.json(json!({ "machine": machine, "version": env!("CARGO_PKG_VERSION") }));
    say(cli, &mut out, &plan, &results);
    if let Some(base) = results.first() {
        out.json(json!({ "path": report::path_json(&base.configuration, &plan)? }));
    }
    let text = csv::table(&results);
    let mut contents = vec![text.clone(); table.paths().len()];
    let mut targets = table;
    if let Some(kept) = keep()? {
        targets = targets.and(kept);
        contents.extend(save::contents(&gpu, &machine, text, out.text().to_owned()));
    }
    targets.write_all(&contents)?;
    for path in targets.paths() {
        out.wrote(path);
    }
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

/// What was measured in which way, then the numbers: of the base configuration, which comes first, and of every series.
fn say(cli: &Cli, out: &mut Out, plan: &Plan, results: &[Outcome]) {
    let Some((base, series)) = results.split_first() else { return };
    let Configuration { input, setup, size, views } = &base.configuration;
    let methods: Vec<_> = plan.methods.iter().map(|method| method.name()).collect();
    out.volume(&input.name, &input.volume);
    out.occlusion(&methods.join(" "), setup, &input.volume);
    out.line(format!("views     {views} of {} x {} pixels, in one dispatch", size[0], size[1]));
    let form = if cli.deform { ", of another form in every frame" } else { "" };
    out.line(format!("clip      {}{form}", shown_path(&cli.clip)));
    out.line(match cli.all_voxels {
        true => "voxels    all",
        false => "voxels    those that a sample with opacity can touch",
    });
    out.line(report::tables(plan, &base.measured).trim_end());
    out.json(json!({
        "clip": cli.clip.to_string_lossy(),
        "deforms": cli.deform,
        "all_voxels": cli.all_voxels,
        "runs": plan.runs,
        "frames_a_run": plan.frames,
        "warm_up_frames": plan.warm_up,
    }));
    out.json(report::as_json(base, None));
    let mut scale = Map::new();
    for points in series.chunk_by(|a, b| a.series == b.series) {
        out.line(report::series_table(points).trim_end_matches('\n'));
        let values = points.iter().map(|point| report::as_json(point, points.first()));
        scale.insert(points[0].series.into(), values.collect());
    }
    out.json(json!({ "scale": scale }));
}

/// One configuration with what was measured.
pub struct Outcome {
    /// Name of the series; "base" for what the command line says.
    pub series: &'static str,
    /// What is varied, in words.
    pub value: String,
    pub configuration: Configuration,
    /// In the order of the methods.
    pub measured: Vec<Measured>,
}

/// Configurations that take turns.
struct Group {
    series: &'static str,
    /// The value of what is varied, in words, and the configuration.
    points: Vec<(String, Configuration)>,
}

/// The base configuration by itself, then every series.
fn groups(cli: &Cli, base: Configuration, transfer: &OsStr) -> Result<Vec<Group>> {
    let mut groups = vec![Group { series: "base", points: vec![(String::new(), base.clone())] }];
    for series in &cli.scale {
        if groups.iter().any(|group| group.series == series.name()) {
            return Err(usage(format!("--scale: {} is given twice", series.name())));
        }
        groups.push(Group { series: series.name(), points: series.configurations(&base, transfer)? });
    }
    Ok(groups)
}

fn plan(cli: &Cli) -> Result<Plan> {
    for (n, method) in cli.methods.iter().enumerate() {
        if cli.methods[..n].contains(method) {
            return Err(usage(format!("--methods: {method} is given twice")));
        }
    }
    let clip = match cli.clip == "none" {
        true => None,
        false => Some(shape(&cli.clip).with_context(|| format!("--clip {}", shown_path(&cli.clip)))?),
    };
    let methods = cli.methods.clone();
    let (draw_budget_ms, budget_ms) = (cli.draw_budget_ms, cli.budget_ms);
    if cli.deform && !matches!(clip, Some(Shape::Mesh(_))) {
        return Err(usage("--deform needs a mesh: --clip MESH.obj"));
    }
    let (frames, runs, warm_up, deform) = (PERIOD, cli.runs, cli.warm_up, cli.deform);
    Ok(Plan { methods, clip, deform, frames, runs, warm_up, draw_budget_ms, budget_ms })
}

fn base(cli: &Cli, transfer: &OsStr) -> Result<Configuration> {
    let mut volume = cli.raw.open(&cli.input)?;
    // A rule asks for a method that has it; other methods take their own.
    let method = cli.settings.quadrature.map_or(Method::Cao, |rule| Method::for_rule(Some(rule)));
    let setup = setup(&cli.settings, &volume, method, cli.all_voxels)?;
    let transfer = cao_formats::transfer::load(transfer, volume.range());
    let transfer = args::transfer(transfer, &mut volume, &cli.input)?;
    let input = Rc::new(Input {
        name: shown_path(&cli.input),
        volume,
        transfer,
        network: cli.settings.network.clone(),
    });
    Ok(Configuration { input, setup, size: cli.size, views: cli.views })
}
