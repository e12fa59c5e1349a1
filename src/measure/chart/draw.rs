//! The chart as a drawing: one panel for each kind of change, time against error, both logarithmic, the Pareto front drawn.
//!
//! Colours are methods, shapes rules along the rays, hollow marks equal weights; whiskers are quartiles. Where there are
//! several scenes a mark is the geometric mean of their times and the root of the mean of their squared errors. Meshes have a panel of their own below, where they
//! were measured.

use super::front::front;
use super::{Change, Chart, Point, SceneChart, meshes_panel};
use crate::plot::{Anchor, Axis, Drawing, INK, Marker, Panel, short, text_width};
use cao_model::occlusion::Quadrature;

/// Colours that stay apart for the colour-blind (Okabe and Ito 2008, their yellow darker, on white), in the order of the methods after "solid colour".
/// Further ones are between them, or darker.
const COLOURS: [&str; 15] = [
    "#cc79a7", "#222222", "#8f6f1b", "#0072b2", "#e69f00", "#d55e00", "#56b4e9", "#b8a800", "#009e73",
    "#7a3b8f", "#a3c130", "#7b1e1e", "#2f4f8f", "#c0803f", "#5f9ea0",
];
pub(super) const GREY: &str = "#777777";
pub(super) const FRONT: &str = "#aaaaaa";

/// Radius of a mark.
pub(super) const RADIUS: f64 = 4.5;
/// Size of the labels beside marks.
const SMALL: u32 = 10;
/// Frames of the panels, and what is around them.
const FRAME: [f64; 2] = [440.0, 300.0];
const LEFT: f64 = 70.0;
const TOP: f64 = 66.0;
const BETWEEN: [f64; 2] = [84.0, 86.0];
const WIDTH: f64 = LEFT + 2.0 * FRAME[0] + BETWEEN[0] + 24.0;
/// Height of one of the legend's rows, and what is below the last.
const ROW: f64 = 20.0;
const BELOW: f64 = 4.0;

/// Rules that have a shape of their own: those along rays.
const RULES: [Quadrature; 7] = [
    Quadrature::Left,
    Quadrature::Cell,
    Quadrature::Segment,
    Quadrature::Hybrid,
    Quadrature::Nearest,
    Quadrature::Linear,
    Quadrature::Cone,
];

/// One contender in one panel.
#[derive(Clone, Debug)]
pub struct Mark {
    /// Any of the points that it stands for.
    pub of: Point,
    /// Time, lower and upper quartile: ms, or ratios to the baseline.
    pub time: [f64; 3],
    /// RMSE of the ambient factor.
    pub error: f64,
}

/// The marks of one kind of change over these scenes, in the order of the contenders.
pub fn marks(scenes: &[&SceneChart], change: Change, ratios: bool) -> Vec<Mark> {
    let of_change = |scene: &SceneChart| -> Vec<Point> {
        scene.points.iter().filter(|point| point.change == change).cloned().collect()
    };
    let Some((first, others)) = scenes.split_first() else { return Vec::new() };
    let others: Vec<Vec<Point>> = others.iter().map(|scene| of_change(scene)).collect();
    let mark = |point: Point| {
        let same = |p: &&Point| p.method == point.method && p.setting == point.setting;
        let all: Vec<&Point> = std::iter::once(&point)
            .chain(others.iter().filter_map(|points| points.iter().find(same)))
            .collect();
        let n = all.len() as f64;
        let times = all.iter().map(|p| if ratios { p.ratio() } else { p.ms() });
        let logs = times.fold([0.0; 3], |sum, t| [0, 1, 2].map(|i| sum[i] + t[i].ln() / n));
        let squares = all.iter().map(|p| p.errors.rmse * p.errors.rmse / n).sum::<f64>();
        Mark { time: logs.map(f64::exp), error: squares.sqrt(), of: point }
    };
    of_change(first).into_iter().map(mark).collect()
}

/// Marks that lie on the Pareto front, from the fastest on. What has no ambient values to compute, and what has them elsewhere than at
/// voxels, does not compete.
pub fn front_of(marks: &[Mark]) -> Vec<usize> {
    let points = marks.iter().map(|mark| {
        let competes = mark.time[1] > 0.0 && !mark.of.on_surface;
        [mark.time[1], if competes { mark.error } else { f64::NAN }]
    });
    front(&points.collect::<Vec<_>>())
}

/// What the time axis shows.
pub fn time_label(ratios: bool) -> &'static str {
    match ratios {
        true => "time to bring ambient occlusion up to date / that of LAO (unit), 26 rays",
        false => "time to bring ambient occlusion up to date, ms",
    }
}

/// Draws the chart of these scenes, `caption` below it, one entry a line.
pub fn draw(chart: &Chart, scenes: &[&SceneChart], caption: &[String]) -> Drawing {
    let ratios = chart.software;
    // They are no part of one scene alone.
    let meshes = chart.meshes.as_ref().filter(|_| scenes.len() == chart.scenes.len());
    let place = |n: usize| {
        let (column, row) = ((n % 2) as f64, (n / 2) as f64);
        [LEFT + column * (FRAME[0] + BETWEEN[0]), TOP + row * (FRAME[1] + BETWEEN[1])]
    };
    let last = Change::ALL.len() - usize::from(meshes.is_none());
    let legend_top = place(last)[1] + FRAME[1] + 62.0;
    let methods = methods(scenes);
    let caption_top = legend_top + legend_height(&methods);
    let height = caption_top + 15.0 * caption.len() as f64 + 10.0;
    let mut drawing = Drawing::new(WIDTH, height);
    let names: Vec<&str> = scenes.iter().map(|scene| scene.name.as_str()).collect();
    let title = |of: &str| format!("Ambient occlusion after a change: time against error. {of}");
    let named = title(&names.join(", "));
    // The caption names them too.
    let fits = text_width(&named, 16) < WIDTH - LEFT;
    let title = if fits { named } else { title(&format!("{} scenes", names.len())) };
    drawing.text([LEFT, 28.0], &title, 16, Anchor::Start, INK, true);

    let panels: Vec<(Change, Vec<Mark>)> =
        Change::ALL.into_iter().map(|change| (change, marks(scenes, change, ratios))).collect();
    let every = || panels.iter().flat_map(|(_, marks)| marks);
    let x = Axis::log(time_label(ratios), every().flat_map(|mark| mark.time));
    let y = Axis::log("error: RMSE of the ambient factor", every().map(|mark| mark.error));
    for (n, (change, marks)) in panels.iter().enumerate() {
        let panel = Panel { at: place(n), size: FRAME, x: x.clone(), y: y.clone() };
        panel.draw(&mut drawing, change.name());
        fill(&mut drawing, &panel, marks, &methods);
    }
    if let Some(found) = meshes {
        meshes_panel::panel(&mut drawing, place(last), FRAME, BETWEEN[0], found);
    }
    legend(&mut drawing, legend_top, &methods);
    for (n, line) in caption.iter().enumerate() {
        let y = caption_top + 15.0 * n as f64;
        drawing.text([LEFT, y], line, 11, Anchor::Start, GREY, false);
    }
    drawing
}

/// Names of the methods, in the order of the contenders.
fn methods(scenes: &[&SceneChart]) -> Vec<&'static str> {
    let mut methods: Vec<&str> = Vec::new();
    for point in scenes.iter().flat_map(|scene| &scene.points) {
        if !methods.contains(&point.method) {
            methods.push(point.method);
        }
    }
    // The baseline is measured first and keeps its place in the list.
    methods.sort_by_key(|method| super::contender::place(method));
    methods
}

fn colour(methods: &[&str], method: &str) -> &'static str {
    match methods.iter().position(|m| *m == method) {
        Some(n) if n > 0 => COLOURS[(n - 1) % COLOURS.len()],
        _ => GREY,
    }
}

fn shape(quadrature: Option<Quadrature>) -> Marker {
    match quadrature {
        Some(Quadrature::Left) => Marker::Circle,
        Some(Quadrature::Cell) => Marker::Square,
        Some(Quadrature::Segment) => Marker::Triangle,
        Some(Quadrature::Nearest) => Marker::Down,
        Some(Quadrature::Hybrid) => Marker::Right,
        Some(Quadrature::Linear) => Marker::Left,
        Some(Quadrature::Cone) => Marker::Hexagon,
        // Without rays.
        _ => Marker::Diamond,
    }
}

/// Equal weights, as in the paper.
fn hollow(point: &Point) -> bool {
    point.setting.quadrature.is_some() && !point.setting.label.contains('w')
}

fn fill(drawing: &mut Drawing, panel: &Panel, marks: &[Mark], methods: &[&str]) {
    let [left, right] = [panel.at[0], panel.at[0] + panel.size[0]];
    let front = front_of(marks);
    let place = |mark: &Mark| panel.place(mark.time[1], mark.error);
    stairs(drawing, panel, &front.iter().map(|&i| place(&marks[i])).collect::<Vec<_>>());

    let mut taken: Vec<[f64; 4]> = Vec::new();
    let mut labels = Vec::new();
    for (i, mark) in marks.iter().enumerate() {
        let at = place(mark);
        let colour = colour(methods, mark.of.method);
        if mark.time[1] <= 0.0 {
            drawing.line([left, at[1]], [right, at[1]], colour, 1.5, true);
            let text = format!("{}, no cost", mark.of.method);
            drawing.text([right - 6.0, at[1] - 5.0], &text, SMALL, Anchor::End, colour, false);
            let width = text_width(&text, SMALL);
            taken.push([right - 6.0 - width, at[1] - 15.0, right - 6.0, at[1] + 2.0]);
            continue;
        }
        let [low, _, high] = mark.time.map(|t| panel.place(t, mark.error)[0]);
        drawing.line([low, at[1]], [high, at[1]], colour, 1.0, false);
        drawing.marker(shape(mark.of.setting.quadrature), at, RADIUS, colour, hollow(&mark.of));
        let around = RADIUS + 1.0;
        taken.push([at[0] - around, at[1] - around, at[0] + around, at[1] + around]);
        if front.contains(&i) || mark.of.is_baseline() || mark.of.on_surface {
            labels.push((at, mark.of.setting.label.clone(), colour));
        }
    }
    for (at, text, colour) in labels {
        label(drawing, panel, at, &text, colour, &mut taken);
    }
}

/// The front, from the fastest on, as the stairs that bound what has been reached.
pub(super) fn stairs(drawing: &mut Drawing, panel: &Panel, front: &[[f64; 2]]) {
    let mut stairs: Vec<[f64; 2]> = Vec::new();
    for &[x, y] in front {
        match stairs.last() {
            Some(&[_, before]) => stairs.extend([[x, before], [x, y]]),
            None => stairs.extend([[x, panel.at[1]], [x, y]]),
        }
    }
    stairs.extend(stairs.last().map(|&[_, y]| [panel.at[0] + panel.size[0], y]));
    drawing.polyline(&stairs, FRONT, 2.0, false);
}

/// Writes a label near a mark where it covers nothing; nowhere if there is no such place.
pub(super) fn label(
    drawing: &mut Drawing,
    panel: &Panel,
    [x, y]: [f64; 2],
    text: &str,
    colour: &str,
    taken: &mut Vec<[f64; 4]>,
) {
    let (width, height) = (text_width(text, SMALL), f64::from(SMALL));
    // Left edge and base line, near to far.
    let away = RADIUS + 4.0;
    let near = |d: f64| {
        [
            [x - 0.5 * width, y + d + 0.8 * height],
            [x - d - width, y + d + 0.4 * height],
            [x + d, y - d],
            [x - d - width, y - d],
            [x - 0.5 * width, y - d],
            [x + d, y + d + 0.4 * height],
        ]
    };
    let ([left, top], [w, h]) = (panel.at, panel.size);
    for [x, base] in [away, away + 10.0, away + 22.0].into_iter().flat_map(near) {
        let own = [x - 1.0, base - height, x + width + 1.0, base + 3.0];
        let inside = own[0] > left && own[1] > top && own[2] < left + w && own[3] < top + h;
        let free = taken.iter().all(|t| own[2] < t[0] || t[2] < own[0] || own[3] < t[1] || t[3] < own[1]);
        if inside && free {
            drawing.text([x, base], text, SMALL, Anchor::Start, colour, false);
            taken.push(own);
            return;
        }
    }
}

/// An entry of the legend: text, colour, its mark or none for a line, hollow.
type Entry = (String, &'static str, Option<Marker>, bool);

/// Entries of the legend, rows that begin anew; each goes on in the next one where the sheet ends.
fn entries(methods: &[&str]) -> [Vec<Entry>; 3] {
    let of = |method: &&str| ((*method).to_owned(), colour(methods, method), None, false);
    let rule = |rule: Quadrature| (format!("{} rule", rule.name()), INK, Some(shape(Some(rule))), false);
    let others = [
        ("equal weights", INK, Some(Marker::Circle), true),
        ("weighted rays", INK, Some(Marker::Circle), false),
        ("no rays", INK, Some(Marker::Diamond), false),
        ("Pareto front; numbers are rays", FRONT, None, false),
    ];
    [
        methods.iter().map(of).collect(),
        RULES.map(rule).into(),
        others.map(|(text, colour, marker, hollow)| (text.to_owned(), colour, marker, hollow)).into(),
    ]
}

/// Where each entry stands: left edge and row.
fn places(entries: &[Vec<Entry>; 3]) -> Vec<(f64, usize, &Entry)> {
    let (mut placed, mut row) = (Vec::new(), 0);
    for of_row in entries {
        let mut x = LEFT;
        for entry in of_row {
            let width = 22.0 + text_width(&entry.0, 12) + 16.0;
            if x > LEFT && x + width > WIDTH {
                (x, row) = (LEFT, row + 1);
            }
            placed.push((x, row, entry));
            x += width;
        }
        row += 1;
    }
    placed
}

fn legend_height(methods: &[&str]) -> f64 {
    let rows = places(&entries(methods)).last().map_or(0, |(_, row, _)| row + 1);
    ROW * rows as f64 + BELOW
}

fn legend(drawing: &mut Drawing, top: f64, methods: &[&str]) {
    for (x, row, (text, colour, marker, hollow)) in places(&entries(methods)) {
        let y = top + ROW * row as f64;
        match marker {
            Some(marker) => drawing.marker(*marker, [x + 8.0, y], RADIUS, colour, *hollow),
            None if *colour == FRONT => drawing.line([x, y], [x + 16.0, y], FRONT, 2.0, false),
            None => drawing.line([x, y], [x + 16.0, y], colour, 5.0, *colour == GREY),
        }
        drawing.text([x + 22.0, y + 4.0], text, 12, Anchor::Start, INK, false);
    }
}

/// Two numbers with a sign between them, for captions: median and half the distance of the quartiles.
pub fn with_spread([low, middle, high]: [f64; 3]) -> String {
    format!("{} ± {}", short(middle), short(0.5 * (high - low)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_legend_stays_on_the_sheet_and_above_the_caption() {
        let methods: Vec<&str> = ["solid colour", "image space", "LAO (unit)", "CAO literal", "CAO", "rays"]
            .into_iter()
            .chain(cao_model::METHODS.iter().flat_map(|entry| [entry.name, entry.title]))
            .collect();
        let height = legend_height(&methods);
        // As one row each they would leave it.
        assert!(height > 3.0 * ROW + BELOW);
        let mut drawing = Drawing::new(WIDTH, height);
        legend(&mut drawing, 0.0, &methods);
        let svg = drawing.svg();
        let texts: Vec<_> = svg.split("<text ").skip(1).collect();
        assert_eq!(texts.len(), methods.len() + RULES.len() + 4);
        for text in texts {
            let of = |name: &str| -> f64 {
                let from = text.split(&format!("{name}=\"")).nth(1).unwrap();
                from.split('"').next().unwrap().parse().unwrap()
            };
            let words = text.split(['>', '<']).nth(1).unwrap();
            assert!(of("x") + text_width(words, 12) <= WIDTH, "{words} leaves the sheet");
            assert!(of("y") + 12.0 <= height, "{words} is in the caption");
        }
    }
}
