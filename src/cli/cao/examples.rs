//! `cao examples`: volumes, transfer functions and exact ambient values to train a network on, as files.
//!
//! `examples.u16` holds of each example some cubes of edge³ numbers of 16 bits, little-endian, x fastest, 65535 for 1; `examples.json` says
//! which (opacity, labels, values), edge, seed, and what each example is of. In NumPy:
//! `numpy.fromfile("examples.u16", "<u2").reshape(-1, cubes, edge, edge, edge)`, the last three z, y, x.

use crate::args::{Examples, Global, usage};
use anyhow::{Context, Result};
use cao_cli::output::{Out, Progress, check_validation, open_gpu};
use cao_cli::targets::Targets;
use cao_measure::error::Errors;
use cao_measure::examples::labels::radius;
use cao_measure::examples::source::{SOLIDS, Scan, Source};
use cao_measure::examples::{Example, Maker, Plan};
use cao_model::builtin::NAMES;
use cao_model::error::shown_path;
use cao_model::network::Label;
use serde_json::{Value, json};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

const DATA: &str = "examples.u16";
const INDEX: &str = "examples.json";

pub fn run(global: &Global, args: &Examples) -> Result<ExitCode> {
    let mut progress = Progress::default();
    progress.stage("reading");
    let sources = sources(args)?;
    let targets = Targets::in_folder(&args.output, [DATA, INDEX].map(str::to_owned))?;
    targets.spare_inputs()?;
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let labels = if args.label.is_empty() { Label::ALL.to_vec() } else { args.label.clone() };
    let plan = Plan {
        edge: args.edge as usize,
        samples: args.samples as usize,
        seed: args.seed,
        labels: labels.clone(),
    };
    let mut maker = Maker::new(&gpu, plan, sources)?;
    progress.stage("examples");
    let mut made = Vec::new();
    let mut checked: Vec<Vec<Errors>> = Vec::new();
    targets.write(|files| {
        let mut failed = Ok(());
        files.write(&args.output.join(DATA), |file| {
            for i in 0..args.count {
                match maker.make(i as usize) {
                    Ok(example) => {
                        file.write_all(&bytes(&example))?;
                        made.push(described(&labels, &example));
                        checked.extend((!example.errors.is_empty()).then_some(example.errors));
                    }
                    Err(error) => {
                        failed = Err(error);
                        break;
                    }
                }
                progress.set(f64::from(i + 1) / f64::from(args.count));
            }
            Ok(())
        })?;
        failed?;
        let cubes = ["opacity"].into_iter().chain(labels.iter().map(|label| label.name())).chain(["values"]);
        let index = json!({
            "program": format!("cao {}", env!("CARGO_PKG_VERSION")),
            "device": gpu.info().name,
            "edge": args.edge, "samples": args.samples, "seed": args.seed, "radius": radius(args.edge as usize),
            "cubes": cubes.collect::<Vec<_>>(),
            "examples": made,
        });
        let text = serde_json::to_string_pretty(&index).context("the index is no JSON")?;
        Ok(files.write(&args.output.join(INDEX), |file| file.write_all(text.as_bytes()))?)
    })?;
    check_validation(&gpu)?;
    drop(progress);
    let mut out = Out::new(global);
    out.device(&gpu);
    out.line(format!("examples  {} of {} voxels along each axis, seed {}", args.count, args.edge, args.seed));
    let mut stated = serde_json::Map::new();
    for (k, label) in labels.into_iter().enumerate() {
        let worst = checked.iter().map(|errors| errors[k].rmse).fold(0.0, f64::max);
        let (name, count) = (label.name(), checked.len());
        out.line(format!(
            "  {name:<7} off by at most {worst:.4} (root mean square) in the {count} that were checked"
        ));
        stated.insert(name.into(), worst.into());
    }
    out.json(json!({ "examples": args.count, "checked": checked.len(), "largest_rmse": stated }));
    targets.paths().iter().for_each(|path| out.wrote(path));
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

/// Those that are named, else those that are made.
fn sources(args: &Examples) -> Result<Vec<Source>> {
    let known = || NAMES.iter().map(|(name, _)| *name).chain([SOLIDS]);
    let mut sources = Vec::new();
    for name in &args.builtin {
        if !known().any(|one| one == name) {
            let known = known().collect::<Vec<_>>().join(", ");
            return Err(usage(format!("--builtin {name}: no such volume; expected one of {known}")));
        }
        sources.push(if name == SOLIDS { Source::Solids } else { Source::Builtin(name.clone()) });
    }
    for path in &args.volume {
        let volume = args.raw.open(path)?;
        let name = Path::new(path).file_name().map_or_else(|| shown_path(path), shown_path);
        sources.push(Source::Given(Arc::new(Scan::new(&name, &volume))));
    }
    if sources.is_empty() {
        return Err(usage("nothing to make examples of; expected --builtin NAME or --volume FILE"));
    }
    Ok(sources)
}

fn bytes(example: &Example) -> Vec<u8> {
    let cubes = [&example.opacity].into_iter().chain(&example.labels).chain([&example.values]);
    cubes.flatten().flat_map(|value| value.to_le_bytes()).collect()
}

fn described(labels: &[Label], example: &Example) -> Value {
    let of = |errors: &Errors| json!({ "rmse": errors.rmse, "bias": errors.bias, "voxels": errors.count });
    let checked: serde_json::Map<String, Value> =
        labels.iter().zip(&example.errors).map(|(label, errors)| (label.name().into(), of(errors))).collect();
    json!({
        "source": example.source,
        "given": example.given,
        "transfer": example.transfer,
        "off": checked,
    })
}
