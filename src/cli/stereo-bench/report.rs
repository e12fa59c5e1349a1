//! What was measured, as tables for people and as JSON for machines.

use super::frames::{Configuration, Frame, Measured, PARTS, Plan};
use super::path;
use super::statistics::{median, percentile};
use super::suite::Outcome;
use super::way::Way;
use anyhow::Result;
use cao_gpu::Stage;
use cao_model::view::View;
use serde_json::{Map, Value, json};
use std::fmt::Write;

fn walls(measured: &Measured) -> Vec<f64> {
    measured.frames().map(|frame| frame.wall).collect()
}

/// Median of a part's times.
fn part(measured: &Measured, part: usize) -> f64 {
    median(&measured.frames().map(|frame| frame.parts()[part]).collect::<Vec<_>>())
}

/// Median time of each run.
fn run_medians(measured: &Measured) -> Vec<f64> {
    let of = |run: &Vec<Frame>| median(&run.iter().map(|frame| frame.wall).collect::<Vec<_>>());
    measured.runs.iter().map(of).collect()
}

/// Share of all voxels that the clip affected (category b), the paper's measure of its work (CAO Table 2), in the mean.
fn affected(measured: &Measured) -> f64 {
    let (mut some, mut all) = (0.0, 0.0);
    for frame in measured.frames() {
        let c = frame.categories;
        some += c.affected as f64;
        all += c.clipped as f64 + c.affected as f64 + c.untouched as f64;
    }
    some / f64::max(all, 1.0)
}

/// How many times as long LAO takes: the median over the frames, each compared with the one before or after it (CAO Table 3).
fn speedup(measured: &Measured, all: &[Measured]) -> Option<f64> {
    let lao = all.iter().find(|m| m.method == Way::BASELINE)?;
    let ratios: Vec<f64> =
        lao.frames().zip(measured.frames()).map(|(lao, own)| lao.wall / own.wall).collect();
    Some(median(&ratios))
}

/// Frame times and their parts, one line a method.
pub fn tables(plan: &Plan, all: &[Measured]) -> String {
    let mut text = String::new();
    let mut line = |row: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", row.trim_end());
    };
    line(format!(
        "frames    {} for each method: {} run{} of {}, methods in turn; {} before each run are not counted",
        u64::from(plan.runs) * u64::from(plan.frames),
        plan.runs,
        if plan.runs == 1 { "" } else { "s" },
        plan.frames,
        plan.warm_up
    ));
    line(String::new());
    line(format!(
        "{:<12}{:>10}{:>10}{:>10}{:>10}{:>10}  {:<19}{:>10}{:>10}",
        "frame, ms", "median", "95 %", "99 %", "least", "most", "medians of runs", "speed-up", "affected"
    ));
    for m in all {
        let walls = walls(m);
        let [p0, p50, p95, p99, p100] = [0.0, 50.0, 95.0, 99.0, 100.0].map(|p| percentile(&walls, p));
        let runs = run_medians(m);
        let range = format!("{:.2} ... {:.2}", percentile(&runs, 0.0), percentile(&runs, 100.0));
        let speedup = speedup(m, all).map_or("-".into(), |ratio| format!("{ratio:.2}"));
        let share = format!("{:.1} %", 100.0 * affected(m));
        line(format!(
            "{:<12}{p50:>10.2}{p95:>10.2}{p99:>10.2}{p0:>10.2}{p100:>10.2}  {range:<19}{speedup:>10}{share:>10}",
            m.method.name()
        ));
    }
    if all.iter().any(|m| m.method == Way::BASELINE) {
        line("            speed-up: LAO's time over the method's, median of the frames' ratios (the paper's Table 3)".into());
    }
    line(
        "            affected: share of the voxels near what the clip changed, of rays by brick in whole ones, mean (the paper's Table 2)"
            .into(),
    );
    line(String::new());
    line(format!("{:<12}{:>20}{:>20}{:>20}{:>20}", "parts, ms", PARTS[0], PARTS[1], PARTS[2], PARTS[3]));
    for m in all {
        let total = median(&walls(m));
        let cells = [0, 1, 2, 3].map(|n| {
            let ms = part(m, n);
            format!("{ms:>11.2} {:>6}", format!("({:.0} %)", 100.0 * ms / total))
        });
        line(format!("{:<12}{}", m.method.name(), cells.map(|cell| format!("{cell:>20}")).concat()));
    }
    line("            medians, and their share of the median frame (the paper's Fig. 9)".into());
    line(String::new());
    line(format!(
        "{:<12}{:>20}{:>20}{:>20}{:>20}{:>20}",
        "update, host", "clips, ms", "recording, ms", "commands", "barriers", "calls"
    ));
    for m in all {
        let of = |of: fn(&Frame) -> f64| median(&m.frames().map(of).collect::<Vec<_>>());
        let [clips, ms] = [of(|frame| frame.clips), of(|frame| frame.recording)];
        let [commands, barriers, calls] = [
            of(|frame| frame.asked.commands as f64),
            of(|frame| frame.asked.barriers as f64),
            of(|frame| frame.asked.calls as f64),
        ];
        line(format!(
            "{:<12}{clips:>20.3}{ms:>20.3}{commands:>20}{barriers:>20}{calls:>20}",
            m.method.name()
        ));
    }
    line("            medians; one submission a frame, which the host makes".into());
    if let Some(budget) = plan.draw_budget_ms {
        line(String::new());
        line(format!(
            "{:<12}{:>10}{:>10}{:>10}{:>10}{:>10}{:>22}{:>22}",
            "drawing, ms", "budget", "median", "95 %", "99 %", "expected", "scale", "step, mm"
        ));
        for m in all {
            let of = |of: fn(&Frame) -> f64| m.frames().map(of).collect::<Vec<_>>();
            let times = of(|frame| frame.parts()[2]);
            let [p50, p95, p99] = [50.0, 95.0, 99.0].map(|p| percentile(&times, p));
            let foreseen = |f: &Frame| f.drawn.quality.expected_ms.map(f64::from);
            let expected: Vec<f64> = m.frames().filter_map(foreseen).collect();
            let expected = if expected.is_empty() { "-".into() } else { format!("{:.2}", median(&expected)) };
            let range = |values: Vec<f64>| {
                let [least, middle, most] = [0.0, 50.0, 100.0].map(|p| percentile(&values, p));
                format!("{middle:.2} ({least:.2} ... {most:.2})")
            };
            let scale = range(of(|frame| f64::from(frame.drawn.quality.scale)));
            let step = range(of(|frame| f64::from(frame.drawn.step_mm)));
            line(format!(
                "{:<12}{budget:>10.2}{p50:>10.2}{p95:>10.2}{p99:>10.2}{expected:>10}{scale:>22}{step:>22}",
                m.method.name()
            ));
        }
        line("            what --draw-budget-ms chose: share of the pixels along each axis, distance of samples; medians, least, most".into());
    }
    if let Some(budget) = plan.budget_ms {
        line(String::new());
        line(format!(
            "{:<12}{:>10}{:>10}{:>10}{:>10}{:>10}{:>22}{:>24}",
            "frames, ms",
            "budget",
            "median",
            "90 %",
            "99 %",
            "most",
            "update, 99 %, most",
            "behind, median, most"
        ));
        for m in all {
            let of = |of: fn(&Frame) -> f64| m.frames().map(of).collect::<Vec<_>>();
            let (frames, updates) = (of(|frame| frame.wall), of(|frame| frame.update));
            let [p50, p90, p99, most] = PERCENTILES.map(|p| percentile(&frames, p));
            let [.., p99_update, most_update] = PERCENTILES.map(|p| percentile(&updates, p));
            let behind = of(|frame| frame.behind as f64);
            let update = format!("{p99_update:.2} {most_update:.2}");
            let behind = format!("{:.0} {:.0}", median(&behind), percentile(&behind, 100.0));
            line(format!(
                "{:<12}{budget:>10.2}{p50:>10.2}{p90:>10.2}{p99:>10.2}{most:>10.2}{update:>22}{behind:>24}",
                m.method.name()
            ));
        }
        line("            what --budget-ms did to frames, and to updates alone; behind: frames by which the ambient volume lags the clip".into());
    }
    if all.iter().any(|m| m.frames().any(|frame| frame.stages.is_empty())) {
        line("            this device has no timestamps: all of a frame is overhead".into());
    }
    text
}

/// Median over the frames of a method's time here over its time there: the two took turns.
fn growth(here: &Measured, there: &Measured) -> f64 {
    median(&here.frames().zip(there.frames()).map(|(here, there)| here.wall / there.wall).collect::<Vec<_>>())
}

/// One series: median frame times, one line a value, and how many times those of the first value they are.
pub fn series_table(points: &[Outcome]) -> String {
    let Some(first) = points.first() else { return String::new() };
    let heads: String = first.measured.iter().map(|m| format!("{:>22}", m.method.name())).collect();
    let mut text = format!("\n{:<14}{heads}\n", format!("{}, ms", first.series));
    for point in points {
        let cells = point.measured.iter().zip(&first.measured).map(|(m, first)| {
            let growth = format!("(x {:.2})", growth(m, first));
            format!("{:>11.2} {growth:>10}", median(&walls(m)))
        });
        text += &format!("{:<14}{}\n", point.value, cells.collect::<String>());
    }
    text + "              medians of frames, and of their ratios to the first line's; all take turns\n"
}

/// What the counted frames show, for whoever draws the same with another program: eyes and clip of each, light, step.
pub fn path_json(c: &Configuration, plan: &Plan) -> Result<Value> {
    let size_mm = c.input.volume.size_mm();
    let aspect = c.size[0] as f32 / c.size[1] as f32;
    let frame = |number| -> Result<Value> {
        let views = path::views(size_mm, aspect, c.views, number)?;
        let clip = plan.clip.iter().map(|shape| path::clip(shape, size_mm, number).pose).next();
        Ok(json!({
            "views": views.iter().map(view_json).collect::<Vec<_>>(),
            "clip": clip.map(|pose| json!({
                "translate_mm": pose.translate_mm.to_array(),
                "rotate_deg": pose.rotate_deg.to_array(),
                "scale": pose.scale.to_array(),
            })),
        }))
    };
    // The path closes.
    let frames = (0..plan.frames.min(path::PERIOD).into()).map(frame).collect::<Result<Vec<_>>>()?;
    let look = Way::BASELINE.look();
    Ok(json!({
        "ambient": look.ambient,
        "diffuse": look.diffuse,
        "light": look.light.to_array(),
        "step_mm": look.step(c.input.volume.min_spacing() as f32),
        "frames": frames,
    }))
}

fn view_json(view: &View) -> Value {
    let tan = view.tan;
    json!({
        "position_mm": view.position.to_array(),
        "orientation_xyzw": view.orientation.to_array(),
        "tan": { "left": tan.left, "right": tan.right, "up": tan.up, "down": tan.down },
        "near_mm": view.near_mm,
        "far_mm": view.far_mm,
    })
}

/// One configuration and its methods; in a series with its value and the growth since the series' first.
pub fn as_json(result: &Outcome, first: Option<&Outcome>) -> Value {
    let (c, all) = (&result.configuration, &result.measured);
    let o = c.setup.occlusion;
    let mut methods: Vec<Value> = all.iter().map(|m| method_json(c, m, all)).collect();
    for ((method, m), first) in methods.iter_mut().zip(all).zip(first.iter().flat_map(|f| &f.measured)) {
        method["over_first_of_series"] = growth(m, first).into();
    }
    let mut json = json!({
        "volume": c.input.name,
        "dims": c.input.volume.dims,
        "rays": o.rays.name(),
        "radius_mm": o.radius_mm,
        "view_size": c.size,
        "views": c.views,
        "methods": methods,
    });
    if first.is_some() {
        json["value"] = result.value.as_str().into();
    }
    json
}

fn method_json(c: &Configuration, m: &Measured, all: &[Measured]) -> Value {
    let walls = walls(m);
    let parts: Map<String, Value> =
        PARTS.iter().enumerate().map(|(n, name)| (name.replace(' ', "_"), part(m, n).into())).collect();
    json!({
        "method": m.method.name(),
        "quadrature": m.method.setup(c.setup).occlusion.quadrature.name(),
        "frames": walls.len(),
        "median_ms": median(&walls),
        "p95_ms": percentile(&walls, 95.0),
        "p99_ms": percentile(&walls, 99.0),
        "least_ms": percentile(&walls, 0.0),
        "most_ms": percentile(&walls, 100.0),
        "run_medians_ms": run_medians(m),
        "lao_over_this": speedup(m, all),
        "affected_share": affected(m),
        "clips_ms": median(&m.frames().map(|frame| frame.clips).collect::<Vec<_>>()),
        "recording_ms": median(&m.frames().map(|frame| frame.recording).collect::<Vec<_>>()),
        "commands": median(&m.frames().map(|frame| frame.asked.commands as f64).collect::<Vec<_>>()),
        "calls": median(&m.frames().map(|frame| frame.asked.calls as f64).collect::<Vec<_>>()),
        "update_ms": percentiles(&m.frames().map(|frame| frame.update).collect::<Vec<_>>()),
        "wall_ms": percentiles(&walls),
        "frames_behind": percentiles(&m.frames().map(|frame| frame.behind as f64).collect::<Vec<_>>()),
        "drawn_scale": median(&m.frames().map(|frame| frame.drawn.quality.scale.into()).collect::<Vec<_>>()),
        "drawn_step_mm": median(&m.frames().map(|frame| frame.drawn.step_mm.into()).collect::<Vec<_>>()),
        "parts_ms": parts,
        "stages_ms": stages(m),
    })
}

/// Of frames under a budget.
const PERCENTILES: [f64; 4] = [50.0, 90.0, 99.0, 100.0];

fn percentiles(values: &[f64]) -> Value {
    let [p50, p90, p99, most] = PERCENTILES.map(|p| percentile(values, p));
    json!({ "p50": p50, "p90": p90, "p99": p99, "most": most })
}

/// Median time of every stage, by the stage's own name; a stage that a frame lacks took no time in it.
fn stages(m: &Measured) -> Map<String, Value> {
    let mut stages: Vec<Stage> = Vec::new();
    for timing in m.frames().flat_map(|frame| &frame.stages) {
        if !stages.contains(&timing.stage) {
            stages.push(timing.stage);
        }
    }
    let time = |frame: &Frame, stage: Stage| -> f64 {
        frame.stages.iter().filter(|t| t.stage == stage).map(|t| t.ms).sum()
    };
    let times = |stage| m.frames().map(|frame| time(frame, stage)).collect::<Vec<_>>();
    stages.into_iter().map(|stage| (stage.name.to_owned(), median(&times(stage)).into())).collect()
}
