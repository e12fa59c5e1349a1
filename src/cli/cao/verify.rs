//! `cao verify`: the two claims, checked on the user's device and volume, of the methods that he asks for.

use crate::args::{self, Global, PROOF, Verified, Verify, setup};
use anyhow::Result;
use cao::renderer::{COLOUR, Renderer};
use cao_cli::output::{Out, Progress, check_validation, open_gpu};
use cao_formats::feature::FeatureSettings;
use cao_gpu::Timings;
use cao_measure::exactness::{Plan, Report, verify};
use cao_model::METHODS;
use cao_model::clip::Shape;
use cao_model::error::shown_path;
use cao_model::frame::Frame;
use cao_model::methods::Method;
use cao_model::occlusion::Quadrature;
use serde_json::json;
use std::ffi::OsStr;
use std::process::ExitCode;

/// The built-in scenes, at a size that takes seconds each with each method; the last has anisotropic spacing.
const BUILT_IN: [&str; 4] =
    ["builtin:engine:40", "builtin:fruit:32", "builtin:skeleton:40", "builtin:engine:40x36x20:1,1,2"];

pub fn run(global: &Global, args: &Verify) -> Result<ExitCode> {
    let names = match args.input == "built-in" {
        true => BUILT_IN.map(OsStr::new).to_vec(),
        false => vec![args.input.as_os_str()],
    };
    let shapes = match args.shapes.is_empty() {
        true => Shape::ANALYTIC.to_vec(),
        false => args.shapes.iter().map(|name| args::shape(name)).collect::<Result<_>>()?,
    };
    let (methods, left_out) = methods(args.method, args.settings.quadrature);
    let mut progress = Progress::default();
    progress.stage("reading");
    // All of them before the device works for minutes on the first.
    let mut inputs = Vec::new();
    for name in names {
        let mut volume = args.raw.open(name)?;
        let transfer = args.settings.transfer.as_deref().unwrap_or(OsStr::new("auto"));
        let transfer = cao_formats::transfer::load(transfer, volume.range());
        let transfer = args::transfer(transfer, &mut volume, name)?;
        let setup = |method: &Method| setup(&args.settings, &volume, *method, args.all_voxels);
        let setups = methods.iter().map(setup).collect::<Result<Vec<_>>>()?;
        let features = args.parts.of(FeatureSettings::default(), &volume, Frame::default())?;
        inputs.push((shown_path(name), volume, setups, transfer, features));
    }
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let mut out = Out::new(global);
    out.device(&gpu);
    let mut exact = true;
    let mut vacuous = false;
    let mut reports = Vec::new();
    for (input, volume, setups, transfer, features) in inputs {
        for setup in setups {
            progress.stage("preparing");
            let mut renderer = Renderer::new(&gpu, &volume, transfer.clone(), setup, COLOUR)?;
            args.settings.give_network(&mut renderer)?;
            renderer.set_features(features.clone())?;
            let plan = Plan { shapes: shapes.clone(), poses: args.poses, seed: args.seed };
            progress.stage("verifying");
            progress.say(&format!("verifying {}", setup.method.name()));
            let report = verify(&mut renderer, &plan, &mut |done| progress.set(done))?;
            print(&mut out, &input, setup.method, &report, args.seed);
            exact &= report.exact();
            vacuous |= report.vacuous();
            progress.aside(|| out.show())?;
            reports.push(as_json(&input, setup.method, &report));
        }
    }
    drop(progress);
    check_validation(&gpu)?;
    if let (Some(rule), [_, ..]) = (args.settings.quadrature, &left_out[..]) {
        out.line(format!("left out, without quadrature {}: {}", rule.name(), left_out.join(", ")));
    }
    out.line(match (exact, vacuous) {
        (true, _) => "exact: nothing differs",
        (false, true) => "NOT VERIFIED: see the lines above",
        (false, false) => "NOT EXACT: see the lines above",
    });
    out.json(json!({ "exact": exact, "vacuous": vacuous, "seed": args.seed, "volumes": reports, "left_out": left_out }));
    out.finish()?;
    Ok(if exact { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// What to verify, and the names of what is left out, for it lacks the rule that is asked for. A single method that does is refused by
/// the renderer.
fn methods(asked: Option<Verified>, rule: Option<Quadrature>) -> (Vec<Method>, Vec<&'static str>) {
    let named = |method: &Method| match asked {
        None => *method == Method::for_rule(rule) || *method == PROOF,
        Some(Verified::One(only)) => *method == only,
        Some(Verified::All) => true,
    };
    let able =
        |method: &Method| matches!(asked, Some(Verified::One(_))) || rule.is_none_or(|rule| method.has(rule));
    let named = METHODS.iter().map(|entry| entry.method).filter(named);
    let (methods, left_out): (Vec<Method>, Vec<Method>) = named.partition(able);
    (methods, left_out.into_iter().map(Method::name).collect())
}

fn print(out: &mut Out, input: &str, method: Method, report: &Report, seed: u64) {
    let total = report.total();
    let share = 100.0 * total.recomputed as f64 / total.compared.max(1) as f64;
    let like = match method.values() {
        own if own == method => String::new(),
        other => format!(" = {}", other.name()),
    };
    out.line(format!("{input}, {}{like}: {} clips, seed {seed}", method.name(), report.cuts.len()));
    out.line(format!("  voxels compared     {:>12}", total.compared));
    out.line(format!("  voxels that differ  {:>12}", total.different));
    out.line(format!("  largest difference  {:>12}", total.largest));
    out.line(format!("  share recomputed    {share:>11.1} %"));
    out.line(format!(
        "  share affected      {:>11.1} % (of all voxels{})",
        100.0 * report.affected(),
        if method.values() == PROOF.values() { ", the paper's measure" } else { "" }
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
    for cut in report.cuts.iter().filter(|cut| cut.difference.different > 0) {
        let (clip, d) = (&cut.clip, cut.difference);
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

fn as_json(input: &str, method: Method, report: &Report) -> serde_json::Value {
    let total = report.total();
    json!({
        "volume": input,
        "method": method.name(),
        "clips": report.cuts.iter().map(|cut| json!({
            "shape": cut.clip.shape.name(),
            "mode": format!("{:?}", cut.clip.mode).to_lowercase(),
            "translate_mm": cut.clip.pose.translate_mm.to_array(),
            "rotate_deg": cut.clip.pose.rotate_deg.to_array(),
            "scale": cut.clip.pose.scale.to_array(),
            "voxels_different": cut.difference.different,
            "affected": cut.categories.affected,
            "contextual_ms": stages(&cut.contextual),
            "full_ms": stages(&cut.full),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_method_the_default_and_the_proof_are_verified() {
        let of = |asked, rule| methods(asked, rule).0;
        assert_eq!(of(None, None), [PROOF, Method::default()]);
        for rule in Quadrature::ALL {
            let found = of(None, Some(rule));
            assert!(found.contains(&Method::for_rule(Some(rule))), "{rule:?}");
            assert_eq!(found.contains(&PROOF), PROOF.has(rule), "{rule:?}");
            assert!(found.iter().all(|method| method.has(rule)), "{rule:?}");
        }
        let all: Vec<Method> = METHODS.iter().map(|entry| entry.method).collect();
        assert_eq!(methods(Some(Verified::All), None), (all, vec![]));
    }

    #[test]
    fn a_method_without_the_rule_is_left_out_of_all_and_refused_by_itself() {
        let rule = Some(Quadrature::Left);
        let (found, left_out) = methods(Some(Verified::All), rule);
        assert!(found.iter().all(|method| method.has(Quadrature::Left)));
        let without: Vec<_> = METHODS
            .iter()
            .filter(|entry| !entry.method.has(Quadrature::Left))
            .map(|entry| entry.name)
            .collect();
        assert!(without.contains(&"rays") && found.len() == METHODS.len() - without.len());
        assert_eq!(left_out, without);
        // By the renderer.
        assert_eq!(methods(Some(Verified::One(Method::Rays)), rule), (vec![Method::Rays], vec![]));
    }
}
