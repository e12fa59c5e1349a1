//! What the command line asks for, measured and reported: the base configuration, then the series.

use super::args::Cli;
use super::common::args::{open, setup, shape, usage};
use super::common::output::{Out, Progress, check_targets, check_validation, open_gpu};
use super::frames::{Configuration, Input, Measured, Plan, measure};
use super::path::PERIOD;
use super::save::Folder;
use super::{csv, machine, report};
use anyhow::{Context, Result};
use cao::gpu::DeviceKind;
use cao::scene::Method;
use cao::transfer::TransferFunction;
use serde_json::{Map, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::rc::Rc;

/// Frames of a run on a software driver, unless the user says how many.
const SOFTWARE_FRAMES: u32 = 10;

pub fn run(cli: &Cli) -> Result<ExitCode> {
    let transfer = cli.settings.transfer.as_deref().unwrap_or("auto");
    let inputs = [cli.input.as_str(), transfer, &cli.clip];
    let targets: Vec<&Path> = cli.csv.iter().map(PathBuf::as_path).collect();
    check_targets(&targets, "csv", inputs.into_iter().map(Path::new))?;
    let mut plan = plan(cli)?;
    let mut progress = Progress::new();
    progress.stage("reading");
    let base = base(cli, transfer)?;
    let series = series(cli, &base, transfer)?;
    // What several series share is measured once; the base comes first.
    let mut wanted = vec![base];
    for (_, configuration) in series.iter().flat_map(|(_, points)| points) {
        if !wanted.contains(configuration) {
            wanted.push(configuration.clone());
        }
    }

    progress.stage("preparing");
    let gpu = open_gpu(&cli.global)?;
    plan.frames = cli.frames.unwrap_or(match gpu.info().kind {
        // A frame that takes a graphics card milliseconds takes a processor seconds.
        DeviceKind::Cpu => SOFTWARE_FRAMES,
        _ => PERIOD,
    });
    let kept = cli.save.as_deref().map(|folder| Folder::new(folder, &gpu)).transpose()?;
    let machine = machine::describe();
    progress.stage("measuring");
    let total = plan.total() * wanted.len() as u64;
    let mut done = 0;
    let mut results = Vec::new();
    for configuration in wanted {
        let measured = measure(&gpu, &configuration, &plan, &mut || {
            done += 1;
            progress.set(done as f64 / total as f64);
        })?;
        results.push((configuration, measured));
    }
    check_validation(&gpu)?;
    drop(progress);

    let mut out = Out::new(&cli.global);
    out.device(&gpu);
    out.line(format!("machine   {machine}"));
    out.json(json!({ "machine": machine, "version": env!("CARGO_PKG_VERSION") }));
    say(cli, &mut out, &plan, &series, &results);
    let (table, summary) = (csv::table(&results), out.text().to_owned());
    if let Some(path) = &cli.csv {
        std::fs::write(path, &table).with_context(|| format!("cannot write {}", path.display()))?;
        out.wrote(path);
    }
    if let Some(folder) = kept {
        for path in folder.write(&gpu, &machine, &table, &summary)? {
            out.wrote(&path);
        }
    }
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

/// What was measured in which way, then the numbers: of the base configuration, which comes first, and of every series.
fn say(cli: &Cli, out: &mut Out, plan: &Plan, series: &[Points], results: &[(Configuration, Vec<Measured>)]) {
    let Some((base, measured)) = results.first() else { return };
    let input = &base.input;
    let methods: Vec<_> = plan.methods.iter().map(|method| method.name()).collect();
    out.volume(&input.name, &input.volume);
    out.occlusion(&methods.join(" "), &base.setup, &input.volume);
    out.line(format!("views     {} of {} x {} pixels, in one pass", base.views, base.size[0], base.size[1]));
    out.line(format!("clip      {}", cli.clip));
    out.line(match cli.all_voxels {
        true => "voxels    all",
        false => "voxels    those that a sample with opacity can touch",
    });
    out.line(report::tables(plan, measured).trim_end());
    out.json(json!({
        "clip": cli.clip,
        "all_voxels": cli.all_voxels,
        "runs": plan.runs,
        "frames_a_run": plan.frames,
        "warm_up_frames": plan.warm_up,
    }));
    out.json(report::as_json(base, measured));
    let find = |wanted: &Configuration| -> &[Measured] {
        let found = results.iter().find(|(configuration, _)| configuration == wanted);
        found.map_or(&[], |(_, measured)| measured)
    };
    let mut scale = Map::new();
    for (name, points) in series {
        let measured = points.iter().map(|(value, configuration)| (value.as_str(), find(configuration)));
        out.line(report::series_table(name, measured, &plan.methods).trim_end_matches('\n'));
        let values = points.iter().map(|(value, configuration)| {
            let mut point = report::as_json(configuration, find(configuration));
            point["value"] = value.as_str().into();
            point
        });
        scale.insert((*name).into(), values.collect());
    }
    out.json(json!({ "scale": scale }));
}

/// A series' name, and its values with their configurations.
type Points = (&'static str, Vec<(String, Configuration)>);

fn series(cli: &Cli, base: &Configuration, transfer: &str) -> Result<Vec<Points>> {
    for (n, series) in cli.scale.iter().enumerate() {
        if cli.scale[..n].contains(series) {
            return Err(usage(format!("--scale: {} is given twice", series.name())));
        }
    }
    cli.scale.iter().map(|series| Ok((series.name(), series.configurations(base, transfer)?))).collect()
}

fn plan(cli: &Cli) -> Result<Plan> {
    for (n, method) in cli.methods.iter().enumerate() {
        if cli.methods[..n].contains(method) {
            return Err(usage(format!("--methods: {method} is given twice")));
        }
    }
    let clip = match cli.clip.as_str() {
        "none" => None,
        name => Some(shape(name).with_context(|| format!("--clip {name}"))?),
    };
    let methods = cli.methods.clone();
    Ok(Plan { methods, clip, frames: PERIOD, runs: cli.runs, warm_up: cli.warm_up })
}

fn base(cli: &Cli, transfer: &str) -> Result<Configuration> {
    let volume = open(&cli.raw.source(&cli.input)?, &cli.input)?;
    let setup = setup(&cli.settings, &volume, Method::Cao, cli.all_voxels)?;
    let transfer = TransferFunction::load(transfer, volume.range())?;
    let input = Rc::new(Input { name: cli.input.clone(), volume, transfer });
    Ok(Configuration { input, setup, size: cli.size, views: cli.views })
}
