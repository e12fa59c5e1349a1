//! What [`super::meshes`] found as a page that stands alone, drawings and comma-separated values, the printed numbers (AOV Fig. 9) beside ours.

use super::meshes::{ENOUGH, FACTORS, Found, Of, PRINTED_RAYS, ROWS, Row, SOUGHT, SceneFound};
use super::meshes_printed::{FIGURE_9, Printed};
use super::montage::{above, beside};
use super::report::{figures, head, inline, page, section};
use super::tables::table;
use crate::Result;
use crate::plot::{Anchor, Axis, Drawing, INK, Marker, Panel, short};
use cao_formats::Picture;
use std::fmt::Write as _;

/// Size and places of the two panels of Fig. 10.
const SHEET: [f64; 2] = [1080.0, 430.0];
const FRAME: [f64; 2] = [410.0, 300.0];
const LEFTS: [f64; 2] = [80.0, 590.0];

/// A line of Fig. 10: its name, colour, marker, rows.
type Line = (&'static str, &'static str, Marker, &'static [Of]);

const LINES: [Line; 6] = [
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
    (
        "Volumetric",
        "#2166ac",
        Marker::Diamond,
        &[Of::Volumetric(1), Of::Volumetric(32), Of::Volumetric(256), Of::Volumetric(1024)],
    ),
    ("Crytek", "#1b7837", Marker::Hexagon, &[Of::Crytek]),
    ("HBAO", "#762a83", Marker::Down, &[Of::Hbao]),
];

/// An error as the paper has it.
fn variance(error: f64) -> String {
    format!("{error:.2}")
}

fn none() -> String {
    "–".to_owned()
}

impl Found {
    /// What one has to know to read it, line by line.
    pub fn caption(&self) -> Vec<String> {
        let [device, driver] = &self.device;
        let plan = &self.plan;
        let [width, height] = plan.size;
        let mut lines = vec![
            format!("{device}, {driver}."),
            format!(
                "Left eye, {width} × {height} pixels (printed: 1280 × 720), {} rays a pixel as the reference (printed: {PRINTED_RAYS}). Error: eq. (31), of 8 bits, all pixels, \
                 natural logarithm; RMSE: of 1 − AO where a surface is. Rows of rays are apart from the reference's, but for its first half.",
                plan.rays
            ),
            format!(
                "Times: the ambient occlusion alone, medians of {} runs after one that is not counted; of more than 100 rays of one run. δ of the scene for rays, Crytek and HBAO, × {} \
                 for AOV and × {} for Volumetric, as printed.",
                plan.runs, FACTORS[0], FACTORS[1]
            ),
            format!(
                "Convergence: the reference's first half against all of it: {}.",
                self.each(|found| {
                    let half = found.row(Of::Rays(PRINTED_RAYS / 2));
                    half.map_or(none(), |row| format!("{} (RMSE {})", variance(row.error), short(row.rmse)))
                })
            ),
        ];
        if self.software {
            lines.push(
                "A software driver: its ratios say something, its times do not. Few pixels weigh noise and edges more than many do.".to_owned(),
            );
        }
        let left_out = self.scenes.iter().flat_map(|found| {
            found.left_out.iter().map(|why| format!("Left out of {}: {why}.", found.scene.name))
        });
        lines.extend(left_out);
        lines
    }

    /// Something of each scene in a line.
    fn each(&self, of: impl Fn(&SceneFound) -> String) -> String {
        let all: Vec<String> =
            self.scenes.iter().map(|found| format!("{} {}", found.scene.name, of(found))).collect();
        all.join(", ")
    }

    /// Verdicts, and what is said beside them, as lines.
    pub fn lines(&self) -> Vec<String> {
        let mut lines: Vec<String> = self
            .verdicts()
            .iter()
            .map(|verdict| {
                format!(
                    "{:<6} {}: {} of {} scenes ({}); printed: {} of {}; asked for: {ENOUGH}",
                    if verdict.reached() { "ok" } else { "FAILED" },
                    verdict.claim,
                    verdict.holds.len(),
                    self.scenes.len(),
                    verdict.holds.join(", "),
                    verdict.printed,
                    FIGURE_9.len()
                )
            })
            .collect();
        lines.push(format!(
            "dynamic volumes over static ones, drawn (printed: about 1.25): {}",
            self.each(|found| format!("{:.2}", found.dynamic()))
        ));
        let fit = |n: usize| {
            self.each(|found| {
                let (factor, error) = found.best()[n];
                format!("{factor} ({})", variance(error))
            })
        };
        lines.push(format!(
            "best δ of AOV over that of rays, its error (printed: {}): {}",
            FACTORS[0],
            fit(0)
        ));
        lines.push(format!("best δ of Volumetric (printed: {}): {}", FACTORS[1], fit(1)));
        lines
    }

    /// Fig. 9: errors of all scenes, the printed ones in brackets.
    fn errors(&self) -> String {
        let mut heads: Vec<String> = vec![String::new()];
        for found in &self.scenes {
            let printed = Printed::of(found.scene.name)
                .map_or(String::new(), |printed| format!(" ({}, {})", printed.theirs, printed.triangles));
            heads.push(format!("{}, {}{printed}", found.scene.name, found.triangles));
        }
        let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
        let rows: Vec<Vec<String>> = ROWS
            .into_iter()
            .map(|of| {
                let mut row = vec![of.name(self.plan.rays)];
                row.extend(self.scenes.iter().map(|found| {
                    let ours = found.row(of).map_or(none(), |row| variance(row.error));
                    let printed = of.printed(found.scene.name);
                    ours + &printed.map_or(String::new(), |[_, error]| format!(" ({})", variance(error)))
                }));
                row
            })
            .collect();
        table(&heads, 1, &rows)
    }

    /// The rest of Fig. 9 of a scene.
    fn scene(&self, found: &SceneFound) -> String {
        let name = found.scene.name;
        let printed_aov = Of::Gathered(1).printed(name);
        let row = |row: &Row| {
            let printed = row.of.printed(name);
            let print = |with: &dyn Fn([f64; 2]) -> String| printed.map_or_else(none, with);
            let over = printed_aov.map_or(f64::NAN, |[ms, _]| ms);
            vec![
                row.of.name(self.plan.rays),
                short(row.median()),
                print(&|[ms, _]| short(ms)),
                short(found.ratio(row.of)),
                print(&|[ms, _]| short(ms / over)),
                variance(row.error),
                print(&|[_, error]| variance(error)),
                short(row.rmse),
            ]
        };
        let rows: Vec<Vec<String>> = found.rows.iter().map(row).collect();
        let head =
            ["", "ms", "printed", "× AOV, 1", "printed", "error, eq. (31)", "printed", "RMSE of 1 − AO"];
        table(&head, 1, &rows)
    }

    /// Errors by δ.
    fn fits(&self) -> String {
        let factors = SOUGHT.map(|factor| format!("× {factor}"));
        let mut head = vec![""];
        head.extend(factors.iter().map(String::as_str));
        let rows: Vec<Vec<String>> = self
            .scenes
            .iter()
            .flat_map(|found| {
                ["AOV, 1", "Volumetric, 1024"].into_iter().zip(found.fits).map(|(name, errors)| {
                    let mut row = vec![format!("{}: {name}", found.scene.name)];
                    row.extend(errors.map(variance));
                    row
                })
            })
            .collect();
        table(&head, 1, &rows)
    }

    /// Fig. 10: time against error of the first scene, ours and as printed.
    pub fn figure_10(&self) -> Drawing {
        let mut drawing = Drawing::new(SHEET[0], SHEET[1]);
        let Some(found) = self.scenes.first() else { return drawing };
        let name = found.scene.name;
        let theirs = Printed::of(name).map_or("", |printed| printed.theirs);
        // Times of a software driver are no times of anything else.
        let over = |ms: f64| if self.software { ms } else { 1.0 };
        let label = if self.software { "time / that of AOV at every pixel" } else { "ms" };
        let aov = found.row(Of::Gathered(1)).map_or(f64::NAN, Row::median);
        let ours = |of: Of| found.row(of).map(|row| [row.median() / over(aov), row.error]);
        let printed_aov = Of::Gathered(1).printed(name).map_or(f64::NAN, |[ms, _]| ms);
        let printed = |of: Of| match of {
            Of::Drawn { .. } => None,
            of => of.printed(name).map(|[ms, error]| [ms / over(printed_aov), error]),
        };
        let titles = [
            format!("{name}, {} × {}", self.plan.size[0], self.plan.size[1]),
            format!("{theirs}, as printed"),
        ];
        panel(&mut drawing, LEFTS[0], [&titles[0], label], &ours);
        panel(&mut drawing, LEFTS[1], [&titles[1], label], &printed);
        let mut x = LEFTS[0];
        for (name, colour, marker, _) in LINES {
            drawing.marker(marker, [x, SHEET[1] - 22.0], 4.0, colour, false);
            drawing.text([x + 10.0, SHEET[1] - 18.0], name, 12, Anchor::Start, INK, false);
            x += 130.0;
        }
        drawing
    }

    /// Fig. 11: accessibility, a scene a row: reference, AOV, Volumetric, Crytek.
    pub fn figure_11(&self) -> Picture {
        let rows: Vec<Picture> = self.scenes.iter().map(|found| beside(&found.pictures)).collect();
        above(&rows)
    }

    /// One page that needs no other file.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] where a picture cannot be encoded.
    pub fn html(&self, machine: &str, command: &str) -> Result<String> {
        let mut body = head("Ambient occlusion of meshes beside rays", machine, command, &self.caption());
        body += &section("What was to be shown", "");
        body += "<ul>\n";
        for line in self.lines() {
            let _ = writeln!(body, "<li class=\"small\">{}</li>", super::tables::escaped(&line));
        }
        body += "</ul>\n";
        body += &section(
            "Fig. 9: errors",
            "Eq. (31); in brackets the printed ones, of the scene that each of ours stands for. The models are not the paper's: orders can be compared, numbers only in size. Each triangle \
             has a volume; how often they overlap on the screen, as Fig. 5 shows it, is not counted.",
        );
        body += &self.errors();
        for found in &self.scenes {
            body += &section(
                &format!("Fig. 9: {}", found.scene.title),
                &format!(
                    "{}. {} triangles, a surface in {:.0} % of the pixels, δ = {} mm. Printed times: a GeForce 280 GT, its volumes drawn and static; of rays eight cores.",
                    found.scene.what,
                    found.triangles,
                    100.0 * found.covered,
                    found.scene.delta_mm
                ),
            );
            body += &self.scene(found);
        }
        body += &section(
            "The best δ",
            "Eq. (31) by δ over that of the rays; the paper has chosen .6 for AOV and 1.1 for Volumetric for its own scenes.",
        );
        body += &self.fits();
        body += &section(
            "Fig. 10: time against error",
            "Nearer to the lower left is better. Dashed: the error of Crytek, whose number of samples does not change. Of the other scenes meshes.csv has the numbers.",
        );
        body += &inline(&self.figure_10());
        body += &section("Fig. 11: accessibility", "");
        let picture = self.figure_11();
        let names: Vec<&str> = self.scenes.iter().map(|found| found.scene.name).collect();
        let shows = format!(
            "1 − AO by rays, AOV at every pixel, Volumetric with 1024 lines, Crytek; from above {}",
            names.join(", ")
        );
        body += &figures([(11, shows.as_str(), &picture)], "width: 100%; image-rendering: pixelated")?;
        Ok(page("cao chart --meshes", &body))
    }

    /// Every row of every scene, its first line the names of the columns; a line for each timed run.
    pub fn runs(&self) -> String {
        let mut text = String::from(
            "scene,triangles,delta_mm,width,height,reference_rays,method,factor,printed_ms,printed_error,error,rmse,run,ms,over_aov\r\n",
        );
        let [width, height] = self.plan.size;
        for found in &self.scenes {
            let aov = found.row(Of::Gathered(1)).map_or(f64::NAN, Row::median);
            for row in &found.rows {
                let printed = row.of.printed(found.scene.name);
                let printed = printed.map_or(",".to_owned(), |[ms, error]| format!("{ms},{error}"));
                for (n, ms) in row.ms.iter().enumerate() {
                    let _ = write!(
                        text,
                        "{},{},{},{width},{height},{},\"{}\",{},{printed},{},{},{},{ms},{}\r\n",
                        found.scene.name,
                        found.triangles,
                        found.scene.delta_mm,
                        self.plan.rays,
                        row.of.name(self.plan.rays),
                        row.of.factor(),
                        row.error,
                        row.rmse,
                        n + 1,
                        ms / aov
                    );
                }
            }
        }
        text
    }

    /// Errors by δ of AOV and Volumetric.
    pub fn fitted(&self) -> String {
        let mut text = String::from("scene,method,factor,error,printed_factor\r\n");
        for found in &self.scenes {
            let of = [Of::Gathered(1), Of::Volumetric(1024)];
            for ((of, errors), printed) in of.into_iter().zip(found.fits).zip(FACTORS) {
                for (factor, error) in SOUGHT.into_iter().zip(errors) {
                    let name = of.name(self.plan.rays);
                    let _ = write!(text, "{},\"{name}\",{factor},{error},{printed}\r\n", found.scene.name);
                }
            }
        }
        text
    }

    /// Verdicts: the claim, scenes in which it holds, of how many, printed ones of seven, whether that is enough.
    pub fn judged(&self) -> String {
        let mut text = String::from("claim,holds,scenes,printed,reached,where\r\n");
        for verdict in self.verdicts() {
            let _ = write!(
                text,
                "\"{}\",{},{},{},{},\"{}\"\r\n",
                verdict.claim,
                verdict.holds.len(),
                self.scenes.len(),
                verdict.printed,
                verdict.reached(),
                verdict.holds.join(" ")
            );
        }
        text
    }
}

/// Time against error: a line of each method.
fn panel(
    drawing: &mut Drawing,
    left: f64,
    [title, label]: [&str; 2],
    value: &dyn Fn(Of) -> Option<[f64; 2]>,
) {
    let every: Vec<[f64; 2]> =
        LINES.iter().flat_map(|(.., rows)| rows.iter().filter_map(|of| value(*of))).collect();
    let panel = Panel {
        at: [left, 40.0],
        size: FRAME,
        x: Axis::log(label, every.iter().map(|[ms, _]| *ms)),
        y: Axis::log("error, AOV eq. (31)", every.iter().map(|[_, error]| *error)),
    };
    panel.draw(drawing, title);
    for (_, colour, marker, rows) in LINES {
        let points: Vec<[f64; 2]> =
            rows.iter().filter_map(|of| value(*of)).map(|[ms, error]| panel.place(ms, error)).collect();
        drawing.polyline(&points, colour, 1.5, false);
        if let (&[Of::Crytek], [[_, y]]) = (rows, &points[..]) {
            drawing.polyline(&[[left, *y], [left + FRAME[0], *y]], colour, 1.0, true);
        }
        for point in points {
            drawing.marker(marker, point, 4.0, colour, false);
        }
    }
}
