//! The picture's own chart: time of the ray cast against the error of what is shown, a panel for each of the two errors.
//!
//! Colours are rays a pixel, shapes distances between samples; hollow marks draw fewer pixels. Whiskers are quartiles.

use super::Chart;
use super::draw::{FRONT, GREY, RADIUS, label};
use super::looks::{self, ERRORS, Kind, Looks, Mark, STEP_VOXELS, Setting};
use crate::plot::{Anchor, Axis, Drawing, INK, Marker, Panel, short, text_width};
use cao_model::samples::Filter;

/// Okabe and Ito's, of 1, 4 and 16 rays a pixel, and of the Gaussian filter.
const COLOURS: [&str; 4] = ["#0072b2", "#e69f00", "#d55e00", "#009e73"];
/// Of the distances in [`STEP_VOXELS`], and of those between.
const SHAPES: [Marker; 5] = [Marker::Square, Marker::Circle, Marker::Triangle, Marker::Down, Marker::Diamond];

const FRAME: [f64; 2] = [440.0, 320.0];
const LEFT: f64 = 70.0;
const TOP: f64 = 66.0;
const BETWEEN: f64 = 84.0;
const WIDTH: f64 = LEFT + 2.0 * FRAME[0] + BETWEEN + 24.0;
/// Top of the legend's two rows, and of the caption.
const LEGEND: f64 = TOP + FRAME[1] + 66.0;
const CAPTION: f64 = LEGEND + 46.0;

/// What the time axis shows.
pub fn time_label(ratios: bool) -> &'static str {
    if ratios {
        "time of the ray cast, both eyes / that of the default"
    } else {
        "time of the ray cast, both eyes, ms"
    }
}

/// The drawing, with what one has to know to read it below.
pub fn draw(chart: &Chart) -> Drawing {
    let scenes: Vec<&Looks> = chart.scenes.iter().map(|scene| &scene.looks).collect();
    let marks = looks::marks(&scenes, chart.software);
    let caption = chart.looks_caption();
    let mut drawing = Drawing::new(WIDTH, CAPTION + 15.0 * caption.len() as f64);
    let title = "The picture: time of the ray cast against the error of what is shown";
    drawing.text([LEFT, 28.0], title, 16, Anchor::Start, INK, true);
    let x = Axis::log(time_label(chart.software), marks.iter().flat_map(|mark| mark.time));
    for (n, (says, error)) in ERRORS.into_iter().enumerate() {
        let y = Axis::log(says, marks.iter().map(|mark| error(&mark.error)));
        let at = [LEFT + n as f64 * (FRAME[0] + BETWEEN), TOP];
        let panel = Panel { at, size: FRAME, x: x.clone(), y };
        panel.draw(&mut drawing, ["FLIP", "RMSE"][n]);
        fill(&mut drawing, &panel, &marks, error);
    }
    legend(&mut drawing);
    for (n, line) in caption.iter().enumerate() {
        drawing.text([LEFT, CAPTION + 15.0 * n as f64], line, 11, Anchor::Start, GREY, false);
    }
    drawing
}

fn colour(setting: &Setting) -> &'static str {
    match (setting.look.filter, setting.look.samples) {
        (Filter::Gaussian, _) => COLOURS[3],
        (_, 1) => COLOURS[0],
        (_, samples) => {
            if samples <= 4 {
                COLOURS[1]
            } else {
                COLOURS[2]
            }
        }
    }
}

fn shape(setting: &Setting) -> Marker {
    let known = STEP_VOXELS.iter().position(|step| *step == setting.step_voxels);
    SHAPES[known.unwrap_or(STEP_VOXELS.len())]
}

/// Beside a mark, where the legend does not say it.
fn beside(setting: &Setting) -> Option<String> {
    match setting.kind {
        _ if setting.is_default() => Some("default".into()),
        Kind::Budget(level) => Some(format!("level {level}")),
        Kind::Scale => Some("half".into()),
        Kind::Rays => None,
    }
}

fn fill(drawing: &mut Drawing, panel: &Panel, marks: &[Mark], error: looks::Error) {
    let place = |mark: &Mark| panel.place(mark.time[1], error(&mark.error));
    let front: Vec<[f64; 2]> = looks::front_of(marks, error).into_iter().map(|i| place(&marks[i])).collect();
    super::draw::stairs(drawing, panel, &front);
    let mut taken = Vec::new();
    for mark in marks {
        let (at, colour) = (place(mark), colour(&mark.setting));
        let [low, _, high] = mark.time.map(|time| panel.place(time, error(&mark.error))[0]);
        drawing.line([low, at[1]], [high, at[1]], colour, 1.0, false);
        if mark.setting.is_default() {
            drawing.marker(Marker::Circle, at, 2.0 * RADIUS, INK, true);
        }
        drawing.marker(shape(&mark.setting), at, RADIUS, colour, mark.setting.scale < 1.0);
        let around = RADIUS + 1.0;
        taken.push([at[0] - around, at[1] - around, at[0] + around, at[1] + around]);
    }
    for mark in marks {
        if let Some(text) = beside(&mark.setting) {
            label(drawing, panel, place(mark), &text, colour(&mark.setting), &mut taken);
        }
    }
}

fn legend(drawing: &mut Drawing) {
    type Entry<'a> = (&'a str, Option<(Marker, &'a str, bool)>);
    let of = |n: usize| Some((Marker::Circle, COLOURS[n], false));
    let step = |n: usize| Some((SHAPES[n], INK, false));
    let rays: [Entry; 5] = [
        ("1 sample a pixel", of(0)),
        ("4", of(1)),
        ("16", of(2)),
        ("the most, Gaussian filter", of(3)),
        ("Pareto front", None),
    ];
    let steps: [Entry; 6] = [
        ("step 1/8 voxel", step(0)),
        ("1/4", step(1)),
        ("1/2", step(2)),
        ("1", step(3)),
        ("between", step(4)),
        ("hollow: fewer pixels drawn, the rest interpolated", Some((Marker::Diamond, INK, true))),
    ];
    for (row, entries) in [&rays[..], &steps[..]].into_iter().enumerate() {
        let (mut x, y) = (LEFT, LEGEND + 20.0 * row as f64);
        for (text, mark) in entries {
            match mark {
                Some((marker, colour, hollow)) => {
                    drawing.marker(*marker, [x + 8.0, y], RADIUS, colour, *hollow)
                }
                None => drawing.line([x, y], [x + 16.0, y], FRONT, 2.0, false),
            }
            drawing.text([x + 22.0, y + 4.0], text, 12, Anchor::Start, INK, false);
            x += 22.0 + text_width(text, 12) + 16.0;
        }
    }
}

impl Chart {
    /// What one has to know to read the picture's chart, line by line.
    pub fn looks_caption(&self) -> Vec<String> {
        let names: Vec<&str> = self.scenes.iter().map(|scene| scene.name.as_str()).collect();
        let most = |error: looks::Error| {
            self.scenes.iter().map(|scene| error(&scene.looks.convergence)).fold(0.0, f64::max)
        };
        let [width, height] = self.plan.pictures;
        vec![
            format!(
                "{}, {}. {}; {width} x {height} pixels an eye.",
                self.device,
                self.driver,
                names.join(", ")
            ),
            format!(
                "Reference: 64 samples a pixel, step 1/16 voxel, no ray ended early; with half of both it moves by FLIP {} and {} levels at most. Errors count the background.",
                short(most(ERRORS[0].1)),
                short(most(ERRORS[1].1))
            ),
            format!(
                "Medians of {} runs in one process, settings alternating; whiskers: quartiles. Levels: what a budget draws, of 16, interpolated as the kernel does it.",
                self.plan.runs
            ),
            self.verdict(),
        ]
    }

    /// Where the default stands, in a sentence made from the numbers.
    pub fn verdict(&self) -> String {
        let scenes: Vec<&Looks> = self.scenes.iter().map(|scene| &scene.looks).collect();
        let marks = looks::marks(&scenes, self.software);
        let says = ERRORS.into_iter().zip(["FLIP", "RMSE"]).map(|((_, error), name)| {
            let better = looks::better(&marks, 0, error);
            let Some(least) = better
                .iter()
                .copied()
                .min_by(|a, b| error(&marks[*a].error).total_cmp(&error(&marks[*b].error)))
            else {
                return format!("by {name} nothing as near is faster beyond the noise");
            };
            let (best, own) = (&marks[least], &marks[0]);
            format!(
                "by {name} {} is as near ({} against {}) in {} of the time",
                best.setting.name(),
                short(error(&best.error)),
                short(error(&own.error)),
                short(best.time[1] / own.time[1])
            )
        });
        format!("The default: {}.", says.collect::<Vec<_>>().join("; "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_setting_can_be_told_from_every_other() {
        let all = looks::settings(1.0, false);
        let look = |s: &Setting| (colour(s), shape(s), s.scale < 1.0, beside(s));
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| look(a) != look(b)), "{}", a.name());
        }
    }
}
