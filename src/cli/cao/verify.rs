//! `cao verify`: the two claims, checked on the user's device and volume.

use crate::args::{self, Global, Verify, setup};
use anyhow::Result;
use cao::renderer::{COLOUR, Renderer};
use cao::gpu::Timings;
use cao_cli::output::{Out, Progress, check_validation, open_gpu};
use cao_measure::exactness::{Plan, Report, verify};
use cao_model::clip::Shape;
use cao_model::methods::Method;
use serde_json::json;
use std::process::ExitCode;

/// The built-in scenes, at a size that takes seconds each; the last has anisotropic spacing.
const BUILT_IN: [&str; 4] =
    ["builtin:engine:40", "builtin:fruit:32", "builtin:skeleton:40", "builtin:engine:40x36x20:1,1,2"];

pub fn run(global: &Global, args: &Verify) -> Result<ExitCode> {
    let names = match args.input.as_str() {
        "built-in" => BUILT_IN.to_vec(),
        input => vec![input],
    };
    let shapes = match args.shapes.is_empty() {
        true => Shape::ANALYTIC.to_vec(),
        false => args.shapes.iter().map(|name| args::shape(name)).collect::<Result<_>>()?,
    };
    let mut progress = Progress::new();
    progress.stage("reading");
    // All of them before the device works for minutes on the first.
    let mut inputs = Vec::new();
    for name in names {
        let volume = args.raw.open(name)?;
        let setup = setup(&args.settings, &volume, Method::Cao, args.all_voxels)?;
        let transfer = args.settings.transfer.as_deref().unwrap_or("auto");
        let transfer = cao_formats::transfer::load(transfer, volume.range())?;
        inputs.push((name, volume, setup, transfer));
    }
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let mut out = Out::new(global);
    out.device(&gpu);
    let mut exact = true;
    let mut vacuous = false;
    let mut reports = Vec::new();
    for (input, volume, setup, transfer) in inputs {
        progress.stage("preparing");
        let mut renderer = Renderer::new(&gpu, &volume, transfer, setup, COLOUR)?;
        let plan = Plan { shapes: shapes.clone(), poses: args.poses, seed: args.seed };
        progress.stage("verifying");
        let report = verify(&mut renderer, &plan, &mut |done| progress.set(done))?;
        print(&mut out, input, &report, args.seed);
        exact &= report.exact();
        vacuous |= report.vacuous();
        reports.push(as_json(input, &report));
    }
    drop(progress);
    check_validation(&gpu)?;
    out.line(match (exact, vacuous) {
        (true, _) => "exact: nothing differs",
        (false, true) => "NOT VERIFIED: see the lines above",
        (false, false) => "NOT EXACT: see the lines above",
    });
    out.json(json!({ "exact": exact, "vacuous": vacuous, "seed": args.seed, "volumes": reports }));
    out.finish()?;
    Ok(if exact { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn print(out: &mut Out, input: &str, report: &Report, seed: u64) {
    let total = report.total();
    let share = 100.0 * total.recomputed as f64 / total.compared.max(1) as f64;
    out.line(format!("{input}: {} clips, seed {seed}", report.trials.len()));
    out.line(format!("  voxels compared     {:>12}", total.compared));
    out.line(format!("  voxels that differ  {:>12}", total.different));
    out.line(format!("  largest difference  {:>12}", total.largest));
    out.line(format!("  share recomputed    {share:>11.1} %"));
    out.line(format!(
        "  share affected      {:>11.1} % (of all voxels, the paper's measure)",
        100.0 * report.affected()
    ));
    out.line(format!("  full / contextual   {:>11.2} x (median of times)", report.speedup()));
    let stereo = report.stereo;
    out.line(format!("  points both eyes see{:>12}", stereo.points));
    out.line(format!("  points that differ  {:>12}", stereo.different));
    if total.compared == 0 {
        out.line(format!(
            "  nothing to compare: no voxel of {input} has opacity; choose another transfer function"
        ));
    } else if stereo.points == 0 {
        out.line("  nothing to compare between the eyes: both see no point; choose another seed or transfer function");
    }
    for trial in report.trials.iter().filter(|trial| trial.difference.different > 0) {
        let (clip, d) = (&trial.clip, trial.difference);
        out.line(format!(
            "  {} voxels differ by up to {} for {} {:?} {:?}",
            d.different,
            d.largest,
            clip.shape.name(),
            clip.mode,
            clip.pose
        ));
    }
}

fn stages(timings: &Timings) -> serde_json::Value {
    timings.iter().map(|timing| (timing.stage.name, serde_json::Value::from(timing.ms))).collect()
}

fn as_json(input: &str, report: &Report) -> serde_json::Value {
    let total = report.total();
    json!({
        "volume": input,
        "clips": report.trials.iter().map(|trial| json!({
            "shape": trial.clip.shape.name(),
            "mode": format!("{:?}", trial.clip.mode).to_lowercase(),
            "translate_mm": trial.clip.pose.translate_mm.to_array(),
            "rotate_deg": trial.clip.pose.rotate_deg.to_array(),
            "scale": trial.clip.pose.scale.to_array(),
            "voxels_different": trial.difference.different,
            "affected": trial.categories.affected,
            "contextual_ms": stages(&trial.contextual),
            "full_ms": stages(&trial.full),
        })).collect::<Vec<_>>(),
        "voxels_compared": total.compared,
        "voxels_different": total.different,
        "largest_difference": total.largest,
        "share_recomputed": total.recomputed as f64 / total.compared.max(1) as f64,
        "share_affected": report.affected(),
        "vacuous": report.vacuous(),
        "full_over_contextual_time": report.speedup(),
        "points_seen_by_both_eyes": report.stereo.points,
        "points_different": report.stereo.different,
        "largest_difference_between_eyes": report.stereo.largest,
    })
}
