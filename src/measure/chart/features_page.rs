//! What [`super::features`] found as a page that stands alone and as comma-separated values, the printed numbers (fdAO Tables 2 and 3) beside ours.

use super::features::{Found, SceneFound};
use super::report::{figures, head, page, section};
use super::tables::table;
use crate::Result;
use std::fmt::Write as _;

/// fdAO Table 3: data set, fdAO, and with bricks for each feature and for all, ms.
const TABLE_3: [(&str, [f64; 3]); 2] =
    [("Human Head", [3282.0, 3275.0, 2865.0]), ("CT Knee", [4049.0, 3615.0, 3604.0])];

fn percent(part: usize, all: usize) -> String {
    format!("{:.1} %", 100.0 * part as f64 / all.max(1) as f64)
}

impl Found {
    /// What one has to know to read it, line by line.
    pub fn caption(&self) -> Vec<String> {
        let [device, driver] = &self.device;
        let plan = &self.plan;
        let mut lines = vec![
            format!("{device}, {driver}."),
            format!(
                "Volumes of {0} × {0} × {0} voxels, 16 rays on a spiral, timed with R = {1} voxels (printed: 16), drawn with R = {2} where nothing else is said; \
                 medians of {3} updates of everything, settings in turns.",
                plan.edge, plan.radius, plan.shown, plan.runs
            ),
        ];
        if self.software {
            lines.push("A software driver: its ratios say something, its times do not.".to_owned());
        }
        let [own, features] = self.changes;
        let [small, _, large] = plan.radii();
        lines.push(format!(
            "Fig. 4: from R = {small} to {large} voxels (printed: 8 to 32) the lit pixels change by {own:.1} levels of 255 by LAO, by {features:.1} with features."
        ));
        lines
    }

    /// Ratios of a scene's rules to `rays`, as a line.
    pub fn ratios(&self) -> Vec<String> {
        let line = |scene: &SceneFound| {
            let [ao, features] = scene.printed;
            let rules = scene.settings.iter().skip(1);
            let rules: Vec<String> =
                rules.map(|(name, _)| format!("{name} {:.2}", scene.medians(name)[1])).collect();
            format!(
                "{}, {} features: {} times rays (printed, {}: {:.2})",
                scene.name,
                scene.features.len(),
                rules.join(", "),
                scene.printed_as,
                features / ao
            )
        };
        self.scenes.iter().map(line).collect()
    }

    fn table_2(&self) -> String {
        let mut head =
            vec!["scene", "in place of", "features", "AO, printed", "fdAO, printed", "ratio, printed"];
        let rules: Vec<&str> = self
            .scenes
            .first()
            .map_or(Vec::new(), |scene| scene.settings.iter().map(|(name, _)| *name).collect());
        head.extend(rules);
        let row = |scene: &SceneFound| {
            let [ao, features] = scene.printed;
            let mut row = vec![
                scene.name.to_owned(),
                scene.printed_as.to_owned(),
                scene.features.len().to_string(),
                format!("{ao} ms"),
                format!("{features} ms"),
                format!("{:.2}", features / ao),
            ];
            row.extend(scene.settings.iter().map(|(name, _)| {
                let [ms, ratio] = scene.medians(name);
                format!("{ms:.2} ms, × {ratio:.2}")
            }));
            row
        };
        table(&head, 2, &self.scenes.iter().map(row).collect::<Vec<_>>())
    }

    fn table_3(&self) -> String {
        let printed = TABLE_3.map(|(name, [plain, each, all])| {
            let gain = |ms: f64| format!("{} ms, {:.1} %", plain - ms, 100.0 * (plain - ms) / plain);
            vec![name.to_owned(), format!("{plain} ms"), gain(each), gain(all)]
        });
        let mut rows = Vec::new();
        for scene in &self.scenes {
            let bricks = &scene.bricks;
            let air = percent(bricks.all - bricks.matter, bricks.all);
            for (k, feature) in scene.features.iter().enumerate() {
                let of = |part: usize| percent(part, bricks.matter);
                rows.push(vec![
                    scene.name.to_owned(),
                    (*feature).to_owned(),
                    bricks.all.to_string(),
                    air.clone(),
                    of(bricks.empty[k]),
                    of(bricks.skipped[k]),
                ]);
            }
        }
        let head =
            ["scene", "feature", "bricks", "empty for all", "empty for the feature", "skipped by its pass"];
        let printed = table(
            &["printed", "fdAO", "gain by bricks of each feature", "gain by bricks of all"],
            1,
            &printed,
        );
        printed + &table(&head, 2, &rows)
    }

    /// One page that needs no other file.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] where a picture cannot be encoded.
    pub fn html(&self, machine: &str, command: &str) -> Result<String> {
        let title = "Feature-driven ambient occlusion: the paper's tables and pictures";
        let mut body = head(title, machine, command, &self.caption());
        body += &section(
            "What features cost",
            "Table 2 of the paper (GeForce GTX 295, R = 16, every voxel, without bricks), and ours: AO is rays, fdAO by each rule. The paper casts all rays once \
             for each feature; ours casts from voxels that ask for a feature. With more than four features sample is max.",
        );
        body += &self.table_2();
        body += &section(
            "Bricks that are empty",
            "The paper's Table 3 has times with and without bricks. Ours cannot be told not to skip them, so these are counts and no times: the share of all bricks that \
             have no matter, which no pass works on; and of those with matter the share that has none of a feature in it or beside it, as the paper looks, and the share that \
             has none within reach of a ray, where the feature's pass walks nothing.",
        );
        body += &self.table_3();
        body += &section("Pictures", "By the paper's numbers; left eye.");
        let shown = self.figures.iter().map(|(number, shows, picture)| (*number, shows.as_str(), picture));
        body += &figures(shown, "max-width: 100%")?;
        Ok(page("cao chart --fdao", &body))
    }

    /// Every run of every setting, its first line the names of the columns.
    pub fn runs(&self) -> String {
        let mut text =
            String::from("scene,edge,radius_voxels,features,setting,run,ms,ratio,printed_ratio\r\n");
        for scene in &self.scenes {
            let [ao, features] = scene.printed;
            for (setting, runs) in &scene.settings {
                for (n, [ms, ratio]) in runs.iter().enumerate() {
                    // What is printed is of all rules.
                    let printed = if *setting == "rays" { 1.0 } else { features / ao };
                    let _ = write!(
                        text,
                        "{},{},{},{},{setting},{},{ms},{ratio},{printed:.2}\r\n",
                        scene.name,
                        self.plan.edge,
                        self.plan.radius,
                        scene.features.len(),
                        n + 1
                    );
                }
            }
        }
        text
    }
}
