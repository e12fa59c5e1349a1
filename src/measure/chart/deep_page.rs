//! What [`super::deep`] found as a page that stands alone and as comma-separated values, the printed numbers (DVAO Table 3) beside ours.

use super::deep::{Found, Of};
use super::report::{figures, head, page, section};
use super::tables::table;
use crate::Result;
use crate::plot::short;
use cao_model::network::Label;
use std::fmt::Write as _;

const MIB: f64 = (1 << 20) as f64;

/// A mean squared error as the paper has it.
fn squared(mse: f64) -> String {
    format!("{mse:.1e}")
}

impl Found {
    /// What one has to know to read it, line by line.
    pub fn caption(&self) -> Vec<String> {
        let [device, driver] = &self.device;
        let (plan, shape) = (&self.plan, &self.shape);
        let names: Vec<&str> =
            self.against.iter().filter(|a| a.label == shape.label).map(|against| against.scene).collect();
        let mut lines = vec![
            format!("{device}, {driver}."),
            format!(
                "{0}: {1} × {1} × {1} voxels, R a tenth of the diagonal, preset auto; every voxel has a value and counts. Means over the volumes, medians of {2} updates of \
                 everything.",
                names.join(", "),
                plan.edge,
                plan.runs
            ),
            format!(
                "The network: {} weights, trained for `{}` on grids of {}³, which is the grid that it has here, whatever the volume's size.",
                shape.weights(),
                shape.label.name(),
                shape.edge
            ),
            format!(
                "Truths: {} directions (printed: 512). SSIM-3D: constants as in the authors' program, (0.01)² and (0.03)²; every voxel has its window, where that program leaves \
                 out 5 at the rim.",
                plan.directions
            ),
        ];
        if self.software {
            lines.push("A software driver: its ratios say something, its times do not.".to_owned());
        }
        lines
    }

    /// Each row against one truth, as a line.
    pub fn lines(&self) -> Vec<String> {
        let of = |label: Label| {
            self.means(label).into_iter().map(move |(of, [ssim, mse], [ms, bytes])| {
                let cost = ms.zip(bytes).map_or(String::new(), |(ms, bytes)| {
                    format!("   {} ms, {:.1} MiB", short(ms), bytes / MIB)
                });
                format!("{:<5} {:<28} SSIM {ssim:.3}, MSE {}{cost}", label.name(), of.name(), squared(mse))
            })
        };
        Label::ALL.into_iter().flat_map(of).collect()
    }

    fn table_3(&self, label: Label) -> String {
        let means = self.means(label);
        let lao = means.iter().find(|(of, ..)| matches!(of, Of::Rays(_, 32))).and_then(|(.., [ms, _])| *ms);
        let rows: Vec<Vec<String>> = means
            .iter()
            .map(|(of, [ssim, mse], [ms, bytes])| {
                let none = || "–".to_owned();
                let printed = of.printed();
                let print =
                    |n: usize, with: &dyn Fn(f64) -> String| printed.map_or_else(none, |p| with(p[n]));
                vec![
                    of.name(),
                    print(0, &|v| format!("{v:.2}")),
                    format!("{ssim:.3}"),
                    print(1, &|v| format!("{v:.0e}")),
                    squared(*mse),
                    print(2, &|v| format!("{v}")),
                    ms.map_or_else(none, short),
                    ms.zip(lao).map_or_else(none, |(ms, lao)| format!("{:.2}", ms / lao)),
                    print(3, &|v| format!("{v}")),
                    bytes.map_or_else(none, |bytes| format!("{:.1}", bytes / MIB)),
                ]
            })
            .collect();
        let head = [
            "",
            "SSIM, printed",
            "SSIM",
            "MSE, printed",
            "MSE",
            "ms, printed",
            "ms",
            "× lao, 32",
            "MiB, printed",
            "MiB",
        ];
        table(&head, 1, &rows)
    }

    /// One page that needs no other file.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] where a picture cannot be encoded.
    pub fn html(&self, machine: &str, command: &str) -> Result<String> {
        let mut body =
            head("Deep volumetric ambient occlusion beside rays", machine, command, &self.caption());
        body += &section(
            "Against the mean transmittance along rays",
            "Table 3 of the paper (RTX 2070, 128³ voxels, the published network), and ours against the ambient reference, which is what this program's methods stand for. The printed \
             numbers are against the transmittance at the rays' ends: only orders can be compared.",
        );
        body += &self.table_3(Label::Mean);
        body += &section(
            "Against the transmittance at the rays' ends",
            "The same against DVAO eq. (1) as its authors programmed it: samples every half voxel, opacities per half a voxel. LAO are fewer of the same rays; no method of this program has \
             them, and so they have no times. The network has a row where it was trained for this truth.",
        );
        body += &self.table_3(Label::End);
        body += &section("Pictures", "As the paper's Fig. 8, of values and not of pictures lit by them.");
        let (shows, picture) = &self.figure;
        body += &figures([(8, shows.as_str(), picture)], "max-width: 100%; image-rendering: pixelated")?;
        Ok(page("cao chart --dvao", &body))
    }

    /// Every row of every scene, its first line the names of the columns; a line for each timed run, one where nothing was timed.
    pub fn runs(&self) -> String {
        let mut text = String::from("scene,edge,truth,directions,method,ssim3d,mse,mib,run,ms\r\n");
        for against in &self.against {
            for row in &against.rows {
                let mib = row.bytes.map_or(String::new(), |bytes| format!("{:.3}", bytes as f64 / MIB));
                let head = format!(
                    "{},{},{},{},\"{}\",{},{},{mib}",
                    against.scene,
                    self.plan.edge,
                    against.label.name(),
                    self.plan.directions,
                    row.of.name(),
                    row.ssim,
                    row.mse
                );
                if row.ms.is_empty() {
                    let _ = write!(text, "{head},,\r\n");
                }
                for (n, ms) in row.ms.iter().enumerate() {
                    let _ = write!(text, "{head},{},{ms}\r\n", n + 1);
                }
            }
        }
        text
    }
}
