//! What [`super::meshes`] found as a page that stands alone, drawings and comma-separated values, the printed numbers (AOV Fig. 9) beside ours.

use super::meshes::{ENOUGH, FACTORS, Found, Of, PRINTED_RAYS, ROWS, Row, SOUGHT, SceneFound};
use super::meshes_panel::{draw, figure_10};
use super::meshes_printed::{FIGURE_9, Printed};
use super::montage::{above, beside};
use super::report::{figures, head, inline, page, section};
use super::tables::table;
use crate::Result;
use crate::plot::short;
use cao_formats::Picture;
use std::fmt::Write as _;

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

    /// The same in a line, where they are one panel of several.
    pub(super) fn in_the_chart(&self) -> String {
        let [width, height] = self.plan.size;
        format!(
            "Meshes: occlusion of the pixels of {} built-in scenes, {width} x {height}, against {} rays a pixel; error by AOV eq. (31), the mean over the scenes, of times the geometric mean.",
            self.built().count(),
            self.plan.rays
        )
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
                    self.built().count(),
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
        lines.push(format!(
            "time of AOV with corners clamped at 2 δ over that without: {}",
            self.each(|found| format!("{:.2}", found.ratio(Of::Clamped)))
        ));
        lines.push(format!(
            "volumes that a pixel lies in, the mean and the most: {}",
            self.each(|found| format!("{} ({})", short(found.overdraw[0].mean()), found.overdraw[0].most()))
        ));
        if self.scenes.iter().any(|found| found.fits.is_none()) {
            return lines;
        }
        let fit = |n: usize| {
            self.each(|found| {
                let best = found.best().map(|best| best[n]);
                best.map_or_else(none, |(factor, error)| format!("{factor} ({})", variance(error)))
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
            let printed = Printed::of(&found.scene.name)
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
                    let printed = of.printed(&found.scene.name);
                    ours + &printed.map_or(String::new(), |[_, error]| format!(" ({})", variance(error)))
                }));
                row
            })
            .collect();
        table(&heads, 1, &rows)
    }

    /// The rest of Fig. 9 of a scene.
    fn scene(&self, found: &SceneFound) -> String {
        let name = &found.scene.name;
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
                let fits = found.fits.into_iter().flatten();
                ["AOV, 1", "Volumetric, 1024"].into_iter().zip(fits).map(|(name, errors)| {
                    let mut row = vec![format!("{}: {name}", found.scene.name)];
                    row.extend(errors.map(variance));
                    row
                })
            })
            .collect();
        table(&head, 1, &rows)
    }

    fn scene_names(&self) -> String {
        let names: Vec<&str> = self.scenes.iter().map(|found| found.scene.name.as_str()).collect();
        names.join(", ")
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
            "Eq. (31); in brackets the printed ones, of the scene that each of ours stands for. The models are not the paper's: orders can be compared, numbers only in size. \
             Scans stand for none of them, and count for no claim.",
        );
        body += &self.errors();
        for found in &self.scenes {
            body += &section(
                &format!("Fig. 9: {}", found.scene.title),
                &format!(
                    "{}. {} triangles, each of which has a volume, a surface in {:.0} % of the pixels, δ = {} mm. Printed times: a GeForce 280 GT, its volumes drawn and static; of rays eight cores.",
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
            "Nearer to the lower left is better. Dashed: the error of Crytek, whose number of samples does not change.",
        );
        body += &inline(&figure_10(self));
        body += &section(
            "Time against error, scene by scene",
            "As Fig. 10, on the same axes; first over the built-in scenes: geometric means of times, means of errors.",
        );
        body += &inline(&draw(self));
        body += &section(
            "Fig. 5: how many volumes a pixel lies in",
            "What drawing volumes costs, and gathering them too: those with a falloff above 0 where the pixel's surface is.",
        );
        body += &self.overdraws();
        body += &inline(&self.overdraw_scale());
        let rows = self.scene_names();
        let shows = format!(
            "volumes that a pixel lies in, and 1 − AO by AOV at every pixel, Volumetric with 1024 lines, Crytek; from above {rows}"
        );
        body += &figures([(5, shows.as_str(), &self.figure_5())], "width: 100%; image-rendering: pixelated")?;
        body += &section("Fig. 11: accessibility", "");
        let picture = self.figure_11();
        let shows = format!(
            "1 − AO by rays, AOV at every pixel, Volumetric with 1024 lines, Crytek; from above {rows}"
        );
        body += &figures([(11, shows.as_str(), &picture)], "width: 100%; image-rendering: pixelated")?;
        Ok(page("cao chart --meshes", &body))
    }

    /// Every row of every scene, its first line the names of the columns; a line for each timed run.
    pub fn runs(&self) -> String {
        let mut text = String::from(
            "scene,triangles,volumes_mean,volumes_most,delta_mm,width,height,reference_rays,method,factor,printed_ms,printed_error,error,rmse,run,ms,over_aov\r\n",
        );
        let [width, height] = self.plan.size;
        for found in &self.scenes {
            let aov = found.row(Of::Gathered(1)).map_or(f64::NAN, Row::median);
            for row in &found.rows {
                let printed = row.of.printed(&found.scene.name);
                let printed = printed.map_or(",".to_owned(), |[ms, error]| format!("{ms},{error}"));
                for (n, ms) in row.ms.iter().enumerate() {
                    let _ = write!(
                        text,
                        "{},{},{},{},{},{width},{height},{},\"{}\",{},{printed},{},{},{},{ms},{}\r\n",
                        found.scene.name,
                        found.triangles,
                        found.overdraw[usize::from(row.of == Of::Clamped)].mean(),
                        found.overdraw[usize::from(row.of == Of::Clamped)].most(),
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
            let fits = found.fits.into_iter().flatten();
            for ((of, errors), printed) in of.into_iter().zip(fits).zip(FACTORS) {
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
                self.built().count(),
                verdict.printed,
                verdict.reached(),
                verdict.holds.join(" ")
            );
        }
        text
    }
}
