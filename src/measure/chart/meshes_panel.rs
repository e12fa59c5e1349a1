//! Time against error of ambient occlusion of meshes: a panel of the chart (measure.md §3), one a scene, and AOV Fig. 10. Both axes are logarithmic, nearer to
//! the lower left is better, the Pareto front is drawn.
//!
//! Colours and shapes are methods, whose settings a line joins; whiskers are quartiles. Over several scenes a mark is the geometric mean of times and the mean
//! of errors, which are mean squares already.

use super::draw::{FRONT, RADIUS, label, stairs};
use super::front::{front, quartiles};
use super::meshes::{Found, Of, PRINTED_RAYS, SceneFound};
use super::meshes_printed::Printed;
use crate::plot::{Anchor, Axis, Drawing, INK, Marker, Panel};

/// A method: its name, colour, marker, settings from the least to the most.
type Line = (&'static str, &'static str, Marker, &'static [Of]);

const LINES: [Line; 7] = [
    ("rays", "#222222", Marker::Circle, &[Of::Rays(1), Of::Rays(292), Of::Rays(1941)]),
    (
        "AOV",
        "#b2182b",
        Marker::Square,
        &[Of::Gathered(15), Of::Gathered(5), Of::Gathered(3), Of::Gathered(1)],
    ),
    (
        "AOV, drawn",
        "#ef8a62",
        Marker::Triangle,
        &[Of::Drawn { is_static: true }, Of::Drawn { is_static: false }],
    ),
    ("AOV, clamped", "#a6761d", Marker::Right, &[Of::Clamped]),
    (
        "Volumetric",
        "#2166ac",
        Marker::Diamond,
        &[Of::Volumetric(1), Of::Volumetric(32), Of::Volumetric(256), Of::Volumetric(1024)],
    ),
    ("Crytek", "#1b7837", Marker::Hexagon, &[Of::Crytek]),
    ("HBAO", "#762a83", Marker::Down, &[Of::Hbao]),
];

/// A row in a panel.
#[derive(Clone, Copy, Debug)]
pub struct Mark {
    /// Which.
    pub of: Of,
    /// Quartiles of its time: ms, or ratios to that of AOV at every pixel.
    pub time: [f64; 3],
    /// Eq. (31).
    pub error: f64,
}

/// What the time axis shows.
fn time_label(ratios: bool) -> &'static str {
    if ratios { "time of the occlusion / AOV, 1" } else { "time of the occlusion, ms" }
}

/// Rows over these scenes, those that not all have over the others.
pub fn marks(scenes: &[&SceneFound], ratios: bool) -> Vec<Mark> {
    let mark = |of: Of| {
        let rows = scenes.iter().filter_map(|scene| Some((scene, scene.row(of)?)));
        let n = rows.clone().count();
        let over = |scene: &SceneFound| {
            let aov = scene.row(Of::Gathered(1)).map_or(f64::NAN, |row| row.median());
            if ratios { aov } else { 1.0 }
        };
        let logs = rows.clone().map(|(scene, row)| {
            quartiles(row.ms.iter().copied()).map(|ms| (ms / over(scene)).ln() / n as f64)
        });
        let time = logs.fold([0.0; 3], |sum, log| [0, 1, 2].map(|i| sum[i] + log[i])).map(f64::exp);
        let error = rows.map(|(_, row)| row.error / n as f64).sum();
        (n > 0).then_some(Mark { of, time, error })
    };
    every_row().filter_map(mark).collect()
}

/// What is printed of a scene, in place of ours.
fn printed(scene: &str, ratios: bool) -> Vec<Mark> {
    let aov = Of::Gathered(1).printed(scene).map_or(f64::NAN, |[ms, _]| ms);
    let mark = |of: Of| {
        let [ms, error] = of.printed(scene)?;
        Some(Mark { of, time: [ms / if ratios { aov } else { 1.0 }; 3], error })
    };
    // Theirs are drawn, static and clamped: one row, which is AOV's.
    every_row().filter(|of| !matches!(of, Of::Drawn { .. } | Of::Clamped)).filter_map(mark).collect()
}

fn every_row() -> impl Iterator<Item = Of> {
    LINES.iter().flat_map(|(.., rows)| rows.iter().copied())
}

/// Marks that nothing as fast or faster is as near as, from the fastest on.
pub fn front_of(marks: &[Mark]) -> Vec<usize> {
    front(&marks.iter().map(|mark| [mark.time[1], mark.error]).collect::<Vec<_>>())
}

/// Beside a mark: what its method's name does not say.
fn beside(of: Of, all: u32) -> String {
    match of {
        Of::Rays(part) if part > 1 => {
            (f64::from(part) / f64::from(PRINTED_RAYS) * f64::from(all)).round().to_string()
        }
        Of::Rays(_) => "1 ray".into(),
        Of::Gathered(1) => "every pixel".into(),
        Of::Gathered(step) => format!("1/{}", step * step),
        Of::Drawn { is_static: true } => "static".into(),
        Of::Drawn { is_static: false } => "dynamic".into(),
        Of::Clamped => "clamped".into(),
        Of::Volumetric(samples) => samples.to_string(),
        Of::Crytek => "Crytek".into(),
        Of::Hbao => "HBAO".into(),
    }
}

/// Axes that hold all of these.
fn axes(marks: &[Mark], ratios: bool) -> [Axis; 2] {
    let x = Axis::log(time_label(ratios), marks.iter().flat_map(|mark| mark.time));
    [x, Axis::log("error, AOV eq. (31)", marks.iter().map(|mark| mark.error))]
}

fn fill(drawing: &mut Drawing, panel: &Panel, marks: &[Mark], all: u32) {
    let place = |mark: &Mark| panel.place(mark.time[1], mark.error);
    let front = front_of(marks);
    stairs(drawing, panel, &front.iter().map(|&i| place(&marks[i])).collect::<Vec<_>>());
    let mut taken = Vec::new();
    for (_, colour, marker, rows) in LINES {
        let own: Vec<&Mark> = rows.iter().filter_map(|of| marks.iter().find(|mark| mark.of == *of)).collect();
        let points: Vec<[f64; 2]> = own.iter().map(|mark| place(mark)).collect();
        drawing.polyline(&points, colour, 1.5, false);
        if let (&[Of::Crytek], [[_, y]]) = (rows, &points[..]) {
            drawing.polyline(&[[panel.at[0], *y], [panel.at[0] + panel.size[0], *y]], colour, 1.0, true);
        }
        for (mark, [x, y]) in own.into_iter().zip(points) {
            let [low, _, high] = mark.time.map(|time| panel.place(time, mark.error)[0]);
            drawing.line([low, y], [high, y], colour, 1.0, false);
            drawing.marker(marker, [x, y], RADIUS, colour, false);
            let around = RADIUS + 1.0;
            taken.push([x - around, y - around, x + around, y + around]);
        }
    }
    for mark in front.into_iter().map(|i| &marks[i]) {
        let colour = LINES.iter().find(|(.., rows)| rows.contains(&mark.of)).map_or(INK, |line| line.1);
        label(drawing, panel, place(mark), &beside(mark.of, all), colour, &mut taken);
    }
}

/// Names of the methods, from the top down.
fn legend(drawing: &mut Drawing, [x, y]: [f64; 2]) {
    for (n, (name, colour, marker, _)) in LINES.into_iter().enumerate() {
        let y = y + 20.0 * n as f64;
        drawing.marker(marker, [x + 8.0, y], RADIUS, colour, false);
        drawing.text([x + 22.0, y + 4.0], name, 12, Anchor::Start, INK, false);
    }
    let lines = [("Pareto front", FRONT, 2.0, false), ("error of Crytek", LINES[5].1, 1.0, true)];
    for (n, (text, colour, width, dashed)) in lines.into_iter().enumerate() {
        let y = y + 20.0 * (LINES.len() + n) as f64;
        drawing.line([x, y], [x + 16.0, y], colour, width, dashed);
        drawing.text([x + 22.0, y + 4.0], text, 12, Anchor::Start, INK, false);
    }
}

/// The panel of all built-in scenes into a drawing: where it is, its size; its legend right of it.
pub(super) fn panel(drawing: &mut Drawing, at: [f64; 2], size: [f64; 2], aside: f64, found: &Found) {
    let scenes: Vec<&SceneFound> = found.built().collect();
    let marks = marks(&scenes, found.software);
    let [x, y] = axes(&marks, found.software);
    let panel = Panel { at, size, x, y };
    panel.draw(drawing, &format!("meshes: {} scenes, the left eye's pixels", scenes.len()));
    fill(drawing, &panel, &marks, found.plan.rays);
    legend(drawing, [at[0] + size[0] + aside, at[1] + 10.0]);
}

/// Frames of small panels, three a row, and what is around them.
const SMALL: [f64; 2] = [280.0, 210.0];
const LEFT: f64 = 70.0;
const TOP: f64 = 40.0;
const BETWEEN: [f64; 2] = [66.0, 76.0];

/// A panel of all built-in scenes, one of each scene, on the same axes.
pub fn draw(found: &Found) -> Drawing {
    let built: Vec<&SceneFound> = found.built().collect();
    let mut panels = vec![(format!("{} scenes", built.len()), marks(&built, found.software))];
    let of = |scene: &SceneFound| (scene.scene.name.clone(), marks(&[scene], found.software));
    panels.extend(found.scenes.iter().map(of));
    let every: Vec<Mark> = panels.iter().flat_map(|(_, marks)| marks.iter().copied()).collect();
    let [x, y] = axes(&every, found.software);
    let place = |n: usize| {
        let (column, row) = ((n % 3) as f64, (n / 3) as f64);
        [LEFT + column * (SMALL[0] + BETWEEN[0]), TOP + row * (SMALL[1] + BETWEEN[1])]
    };
    let [right, bottom] = [place(2)[0], place(panels.len())[1]];
    let mut drawing = Drawing::new(right + SMALL[0] + 24.0, bottom + SMALL[1] + 56.0);
    for (n, (title, marks)) in panels.iter().enumerate() {
        let panel = Panel { at: place(n), size: SMALL, x: x.clone(), y: y.clone() };
        panel.draw(&mut drawing, title);
        fill(&mut drawing, &panel, marks, found.plan.rays);
    }
    let [x, y] = place(panels.len());
    legend(&mut drawing, [x, y + 10.0]);
    drawing
}

/// Size of Fig. 10, its two panels and what is around them.
const SHEET: [f64; 2] = [1240.0, 400.0];
const FRAME: [f64; 2] = [410.0, 300.0];

/// Fig. 10: the first scene, ours and as printed.
pub fn figure_10(found: &Found) -> Drawing {
    let mut drawing = Drawing::new(SHEET[0], SHEET[1]);
    let Some(scene) = found.scenes.first() else { return drawing };
    let name = &scene.scene.name;
    let theirs = Printed::of(name).map_or("", |printed| printed.theirs);
    let [width, height] = found.plan.size;
    // Times of a software driver are no times of anything else.
    let ratios = found.software;
    let halves = [
        (format!("{name}, {width} × {height}"), marks(&[scene], ratios), found.plan.rays),
        (format!("{theirs}, as printed"), printed(name, ratios), PRINTED_RAYS),
    ];
    for (n, (title, marks, all)) in halves.into_iter().enumerate() {
        let [x, y] = axes(&marks, ratios);
        let panel = Panel { at: [LEFT + 490.0 * n as f64, TOP], size: FRAME, x, y };
        panel.draw(&mut drawing, &title);
        fill(&mut drawing, &panel, &marks, all);
    }
    legend(&mut drawing, [LEFT + 930.0, TOP + 10.0]);
    drawing
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::meshes::{Plan, ROWS, Row};
    use crate::chart::meshes_scenes::About;
    use cao_model::scenes::SCENES;

    fn scene(of: usize, rows: &[(Of, f64, f64)]) -> SceneFound {
        let about = About::built(&SCENES[of]);
        let row =
            |(of, ms, error): &(Of, f64, f64)| Row { of: *of, error: *error, rmse: 0.0, ms: vec![*ms; 2] };
        SceneFound {
            scene: about,
            triangles: 1,
            covered: 1.0,
            rows: rows.iter().map(row).collect(),
            fits: None,
            overdraw: [(); 2].map(|()| crate::chart::meshes_overdraw::Overdraw {
                width: 1,
                height: 1,
                counts: vec![None],
            }),
            pictures: Vec::new(),
            left_out: Vec::new(),
        }
    }

    #[test]
    fn a_mark_is_the_mean_of_scenes_and_the_front_is_of_marks() {
        let first = scene(0, &[(Of::Gathered(1), 2.0, 1.0), (Of::Crytek, 1.0, 4.0), (Of::Hbao, 6.0, 2.0)]);
        let second = scene(1, &[(Of::Gathered(1), 8.0, 3.0), (Of::Crytek, 1.0, 6.0)]);
        let of = |marks: &[Mark], of: Of| {
            let mark = marks.iter().find(|mark| mark.of == of).unwrap();
            [mark.time[1], mark.error].map(|value| (1e6 * value).round() / 1e6)
        };
        let found = marks(&[&first, &second], false);
        assert_eq!((of(&found, Of::Gathered(1)), of(&found, Of::Crytek)), ([4.0, 2.0], [1.0, 5.0]));
        // Over that of AOV in the same scene: 1/2 and 1/8.
        let found = marks(&[&first, &second], true);
        assert_eq!((of(&found, Of::Gathered(1)), of(&found, Of::Crytek)), ([1.0, 2.0], [0.25, 5.0]));
        // Of the scene that has it, and behind the front.
        assert_eq!(of(&found, Of::Hbao), [3.0, 2.0]);
        let front: Vec<Of> = front_of(&found).into_iter().map(|i| found[i].of).collect();
        assert_eq!(front, [Of::Crytek, Of::Gathered(1)]);
    }

    #[test]
    fn every_row_but_the_reference_and_its_half_has_a_mark_of_its_own() {
        let drawn: Vec<Of> = every_row().collect();
        assert_eq!(drawn.len(), ROWS.len() - 2);
        for of in ROWS {
            let apart = matches!(of, Of::Rays(part) if part >= PRINTED_RAYS / 2);
            assert_eq!(drawn.iter().filter(|own| **own == of).count(), usize::from(!apart), "{of:?}");
        }
    }

    #[test]
    fn every_scene_has_a_panel() {
        let rows: Vec<(Of, f64, f64)> =
            every_row().enumerate().map(|(n, of)| (of, 1.0 + n as f64, 20.0 - n as f64)).collect();
        let plan = Plan { size: [1; 2], rays: 1000, runs: 2, detail: None, sought: false };
        let scenes = vec![scene(0, &rows), scene(1, &rows)];
        let found = Found { device: [String::new(), String::new()], software: true, scenes, plan };
        let svg = draw(&found).svg();
        for said in ["2 scenes", "colonnade", "fence", "AOV, clamped", "Pareto front", "388"] {
            assert!(svg.contains(said), "{said} is not in the drawing");
        }
        let svg = figure_10(&found).svg();
        for said in ["colonnade, 1 × 1", "Sponza, as printed", "388"] {
            assert!(svg.contains(said), "{said} is not in figure 10");
        }
        // Of ours, where every row is on the front, and of the printed ones.
        assert_eq!(svg.matches("every pixel").count(), 2);
    }
}
