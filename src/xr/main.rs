//! The program `cao-xr`: a volume in an OpenXR headset.

#![forbid(unsafe_code)]

use anyhow::{Result, bail};
use cao::model::frame::Frame;
use cao::{Look, Method};
use cao_cli::args::{self, Raw, Settings, methods_help};
use cao_xr::device::Device;
use cao_xr::runtime::Runtime;
use cao_xr::session::{self, Plan, Report, Show};
use clap::Parser;
use openxr::SessionState;
use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A volume in an OpenXR headset, clipped by hand.
#[derive(Parser)]
#[command(version, arg_required_else_help = true, after_help = HANDS)]
struct Cli {
    /// Volume file or builtin:NAME:SIZE
    input: OsString,
    /// End after so many frames [default: when the headset's menu or Ctrl-C says so]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), required_if_eq("check", "true"))]
    frames: Option<u64>,
    /// Run under the validation layer, and fail unless the session was focused, both eyes were shown the same scene and the layer has
    /// nothing to say
    #[arg(long)]
    check: bool,
    #[command(flatten)]
    settings: Settings,
    #[arg(long, value_name = "METHOD", value_parser = |s: &str| Method::parse(s), help_heading = "Occlusion", help = methods_help())]
    method: Option<Method>,
    #[command(flatten)]
    raw: Raw,
}

const HANDS: &str = "\
Hands:
  the clip is where the right grip is; the left trigger takes it over
  trigger      next shape
  thumbstick   larger, smaller
  grip         carries the volume; with the thumbstick, larger and smaller

Without a headset: tools/openxr.";

fn main() -> ExitCode {
    let (cli, _) = match cao_cli::parse::<Cli>() {
        Ok(parsed) => parsed,
        Err(code) => return code,
    };
    cao_cli::end("cao-xr", run(&cli))
}

fn run(cli: &Cli) -> Result<ExitCode> {
    // First: without a headset there is no need to read a volume.
    let runtime = Runtime::open()?;
    let volume = cli.raw.open(&cli.input)?;
    let (mut volume, turn) = Frame::Patient.arrange(volume)?;
    let spec = cli.settings.transfer.clone().unwrap_or_else(|| "auto".into());
    let loaded = cao_formats::transfer::load(&spec, volume.range());
    let transfer = args::transfer(loaded, &mut volume, &cli.input)?;
    let setup = args::setup(&cli.settings, &volume, cli.method.unwrap_or_default(), false)?;
    // A highlight is where an eye sees it, and not the same for both.
    let specular = if cli.check { 0.0 } else { Look::default().specular };
    let look = Look { specular, ..Look::default() };
    let show = Show { volume, turn, transfer, setup, look };
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, stop.clone())?;
    }
    let device = Device::new(&runtime, cli.check)?;
    let log = device.log.clone();
    let plan = Plan { frames: cli.frames, check: cli.check, stop: &stop };
    let report = session::run(&runtime, &device, &show, &plan)?;
    // Destroying what was made has its messages too.
    drop(device);
    print(&runtime, &report)?;
    if cli.check {
        check(&report, &log.messages(), cli.frames.unwrap_or_default())?;
    }
    Ok(ExitCode::SUCCESS)
}

fn print(runtime: &Runtime, report: &Report) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let states: Vec<_> = report.states.iter().map(|state| format!("{state:?}")).collect();
    let [width, height] = report.size;
    let depth = if report.depth { "colour and depth" } else { "colour, no depth" };
    let [total, drawing] = report.device_ms.map(|ms| ms / report.timed.max(1) as f64);
    writeln!(out, "runtime: {}", runtime.name())?;
    writeln!(out, "session: {}", states.join(", "))?;
    writeln!(
        out,
        "frames:  {}, {} of them with a clip; 2 × {width}×{height}, {depth}",
        report.frames, report.clipped
    )?;
    writeln!(out, "device:  {total:.2} ms a frame, {drawing:.2} of them for drawing")?;
    for v in &report.verdicts {
        let [left, right] = v.covered.map(|share| share * 100.0);
        writeln!(
            out,
            "views:   {left:.1} and {right:.1} % covered, {:.1} % of the pixels differ",
            v.different * 100.0
        )?;
        writeln!(
            out,
            "points:  {} seen by both eyes, {:.2} % of them equally lit (control: {:.2} %)",
            v.points,
            v.equal * 100.0,
            v.control * 100.0
        )?;
    }
    Ok(())
}

fn check(report: &Report, messages: &[String], frames: u64) -> Result<()> {
    let mut wrong = Vec::new();
    if !report.states.contains(&SessionState::FOCUSED) {
        wrong.push("the session was never FOCUSED".into());
    }
    if report.frames < frames {
        wrong.push(format!("{} frames were drawn, expected {frames}", report.frames));
    }
    match &report.verdicts[..] {
        [first, last] => wrong.extend(first.problems_until(last)),
        other => {
            wrong.push(format!("{} frames were read back, expected the first and the last", other.len()))
        }
    }
    if !messages.is_empty() {
        wrong.push(format!(
            "the validation layer reported {} problems:\n{}",
            messages.len(),
            messages.join("\n")
        ));
    }
    if wrong.is_empty() {
        return Ok(());
    }
    bail!("{}", wrong.join("\n"));
}
