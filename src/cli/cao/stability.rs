//! `cao stability`: the trials of where methods fail, as data, charts and one sentence each.

use crate::args::{Global, Stability, usage};
use anyhow::{Result, bail};
use cao_cli::output::{Out, Progress, check_validation, open_gpu};
use cao_cli::targets::Targets;
use cao_formats::Outputs;
use cao_measure::stability::{Effort, Finding, Ours, TRIALS, Trial, page};
use cao_model::error::shown_path;
use serde_json::json;
use std::path::Path;
use std::process::ExitCode;

pub fn run(global: &Global, args: &Stability) -> Result<ExitCode> {
    let mut out = Out::new(global);
    if args.list {
        for trial in TRIALS {
            out.line(format!("{:<12} {}", trial.name, trial.title));
        }
        out.json(json!({ "trials": TRIALS.map(|s| json!({ "name": s.name, "title": s.title })) }));
        out.finish()?;
        return Ok(ExitCode::SUCCESS);
    }
    let folder = args.output.as_deref().ok_or_else(|| usage("-o DIR is missing: where to write"))?;
    if folder.exists() && !folder.is_dir() {
        bail!("cannot write into {}: it is a file, expected a folder or a new name", shown_path(folder));
    }
    let trials = match args.only.is_empty() {
        true => TRIALS.to_vec(),
        false => args.only.clone(),
    };
    let effort = if args.quick { Effort::Quick } else { Effort::Full };
    let index = "index.html".to_owned();
    let targets = Targets::in_folder(folder, trials.iter().map(data).chain([index.clone()]))?;

    let mut progress = Progress::default();
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    out.device(&gpu);
    let mut findings = Vec::new();
    for trial in trials {
        progress.stage(trial.name);
        let finding = (trial.run)(&gpu, effort, &mut |done| progress.set(done))?;
        findings.push((trial, finding));
    }
    drop(progress);
    check_validation(&gpu)?;
    let info = gpu.info();
    let head = format!(
        "cao {}, cao stability{}, on {} ({})",
        env!("CARGO_PKG_VERSION"),
        if args.quick { " --quick" } else { "" },
        info.name,
        info.driver
    );
    let html = page::html(&head, &findings);
    let index = folder.join(index);
    targets.write(|files| {
        findings.iter().try_for_each(|(trial, finding)| write(files, folder, trial, finding))?;
        Ok(files.write(&index, |file| file.write_all(html.as_bytes()))?)
    })?;
    for (trial, finding) in &findings {
        out.line(format!("{:<10} {:<8} {}", trial.name, finding.ours.name(), finding.sentence));
        if !finding.control_fails {
            out.line("           the method that has to fail here did not: this trial shows nothing");
        }
    }
    let good = |f: &Finding| f.ours != Ours::Fails && f.control_fails;
    let all_good = findings.iter().all(|(_, finding)| good(finding));
    out.json(json!({
        "good": all_good,
        "trials": findings.iter().map(|(trial, f)| json!({
            "name": trial.name,
            "title": trial.title,
            "ours": f.ours.name(),
            "control_fails": f.control_fails,
            "sentence": f.sentence,
            "setting": f.setting,
        })).collect::<Vec<_>>(),
    }));
    out.wrote(&index);
    out.finish()?;
    Ok(if all_good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Name of the file with a trial's data.
fn data(trial: &Trial) -> String {
    format!("{}.csv", trial.name)
}

fn write(files: &mut Outputs, folder: &Path, trial: &Trial, finding: &Finding) -> Result<()> {
    let mut put = |name: String, bytes: &[u8]| files.write(&folder.join(name), |file| file.write_all(bytes));
    put(data(trial), page::csv(finding).as_bytes())?;
    for (n, chart) in finding.charts.iter().enumerate() {
        let drawing = page::draw(chart, &finding.setting);
        put(format!("{}-{}.svg", trial.name, n + 1), drawing.svg().as_bytes())?;
        put(format!("{}-{}.png", trial.name, n + 1), &drawing.png()?)?;
    }
    Ok(())
}
