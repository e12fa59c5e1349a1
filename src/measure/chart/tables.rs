//! The paper's tables with our numbers beside the printed ones (CAO Tables 1 to 3, Fig. 9), as HTML.

use super::draw::{self, Mark, with_spread};
use super::looks::{self, ERRORS, Looks};
use super::peers::Peers;
use super::{BASELINE, Change, Chart, Point, Run, SceneChart, front};
use crate::contender::{self, SOLID};
use crate::plot::{Anchor, Drawing, INK, short, text_width};
use crate::split::Split;
use cao::stages;
use cao_model::methods::Method;
use cao_model::occlusion::Quadrature;
use cao_model::options::{Levels, Options};
use std::fmt::Write as _;

/// CAO Table 1: author, name, quality, real-time modification to radius, transfer function, clipping.
const TABLE_1: [(&str, &str, &str, [&str; 3]); 7] = [
    ("Stewart", "Vicinity shading", "medium", ["no", "no", "no"]),
    ("Ropinski et al.", "Clustered histograms", "medium", ["no", "yes", "no"]),
    ("Díaz et al.", "SAT of opacities", "low", ["yes", "no", "no"]),
    ("Hernell et al.", "Local Ambient Occlusion", "high", ["yes", "no", "no"]),
    ("Schlegel et al.", "Shelled SAT of opacities", "medium", ["yes", "no", "no"]),
    ("Engel & Ropinski", "Deep-learned AO", "medium", ["no", "yes", "yes"]),
    ("Titov et al.", "Contextual Ambient Occlusion", "high", ["no", "no", "yes"]),
];

/// CAO Table 2: scene, resolution, samples a ray, clipping mesh, % of voxels recalculated.
const TABLE_2: [[&str; 5]; 3] = [
    ["Engine", "256 × 256 × 110", "20", "sphere", "14.94"],
    ["Beetle", "416 × 416 × 247", "40", "cube", "20.24"],
    ["Skeleton", "512 × 512 × 512", "50", "rectangular prism", "16.13"],
];

/// CAO Table 3, RX 6700 XT: scene, frames per second in solid colour; for 6, 14, 26, 54 rays LAO and CAO.
const TABLE_3: [(&str, f64, [[f64; 2]; 4]); 3] = [
    ("Engine", 272.846, [[111.549, 184.902], [67.910, 155.245], [42.831, 126.378], [22.543, 85.363]]),
    ("Beetle", 128.288, [[15.497, 42.581], [7.509, 25.581], [4.192, 16.063], [2.012, 8.526]]),
    ("Skeleton", 95.142, [[4.316, 17.514], [2.020, 9.594], [1.107, 5.729], [0.529, 2.825]]),
];

/// SPAO Table 1.1, GeForce GTX Titan, 512³: level or part, ms by N-buffers and by mip levels.
const TABLE_1_1: [(&str, [f64; 2]); 10] = [
    ("level 0", [30.93, 33.00]),
    ("level 1", [33.99, 4.58]),
    ("level 2", [40.13, 0.66]),
    ("level 3", [41.16, 0.17]),
    ("level 4", [42.69, 0.14]),
    ("level 5", [38.09, 0.13]),
    ("level 6", [41.91, 0.12]),
    ("levels", [268.90, 38.8]),
    ("combination", [63.24, 110.39]),
    ("all", [332.14, 149.19]),
];

/// The paper's ray sets.
const RAYS: [&str; 4] = ["6", "14", "26", "54"];

/// Text as HTML has it.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A table; cells are HTML, all but the first `words` columns numbers.
pub(super) fn table(head: &[&str], words: usize, rows: &[Vec<String>]) -> String {
    let mut html = String::from("<div class=\"wide\"><table><thead><tr>");
    let class = |column: usize| if column < words { "" } else { " class=\"n\"" };
    for (column, name) in head.iter().enumerate() {
        let _ = write!(html, "<th{}>{name}</th>", class(column));
    }
    html += "</tr></thead><tbody>\n";
    for row in rows {
        html += "<tr>";
        for (column, cell) in row.iter().enumerate() {
            let _ = write!(html, "<td{}>{cell}</td>", class(column));
        }
        html += "</tr>\n";
    }
    html + "</tbody></table></div>\n"
}

/// A time or ratio with its unit.
fn time(chart: &Chart, time: [f64; 3]) -> String {
    let unit = if chart.software { "×" } else { " ms" };
    format!("{}{unit}", with_spread(time))
}

/// CAO Table 1 as printed, and ours as measured times: how fast each method follows each kind of change.
pub(super) fn table_1(chart: &Chart) -> String {
    let printed: Vec<Vec<String>> = TABLE_1
        .iter()
        .map(|(author, name, quality, changes)| {
            let mut row = vec![escaped(author), escaped(name), (*quality).into()];
            row.extend(changes.map(String::from));
            row
        })
        .collect();
    let scenes: Vec<&SceneChart> = chart.scenes.iter().collect();
    let by_change = Change::ALL.map(|change| draw::marks(&scenes, change, chart.software));
    let featured: Vec<&Mark> = by_change[0].iter().filter(|mark| chart.featured(&mark.of)).collect();
    let ours: Vec<Vec<String>> = featured
        .iter()
        .map(|mark| {
            let cell = |change: Change| {
                let marks = by_change.iter().flatten().filter(|m| m.of.change == change);
                let mut own =
                    marks.filter(|m| m.of.method == mark.of.method && m.of.setting == mark.of.setting);
                match own.next() {
                    Some(m) if m.time[1] > 0.0 => time(chart, m.time),
                    Some(_) => "no cost".into(),
                    None => "refused".into(),
                }
            };
            let shape = mean(&scenes, mark, &|p| Some(p.shape.rmse));
            let mut row =
                vec![escaped(mark.of.method), escaped(&mark.of.setting.name()), short(mark.error), shape];
            row.extend([Change::Radius, Change::Transfer, Change::Clip, Change::Volume].map(cell));
            row
        })
        .collect();
    let head = ["author", "method", "quality", "radius", "transfer function", "clipping"];
    let own =
        ["method", "setting", "RMSE", "tone fitted", "radius", "transfer function", "clipping", "new volume"];
    format!(
        "<p>As printed: may it change in real time?</p>\n{}<p>Measured here, {}:</p>\n{}",
        table(&head, 6, &printed),
        if chart.software { "as multiples of LAO (unit), 26 rays, after the same change" } else { "in ms" },
        table(&own, 2, &ours)
    )
}

/// CAO Table 2: the share of voxels that a clip makes recompute.
pub(super) fn table_2(chart: &Chart) -> String {
    let mut rows: Vec<Vec<String>> = TABLE_2
        .iter()
        .map(|row| {
            let mut row: Vec<String> = row.iter().map(|cell| (*cell).into()).collect();
            row[0] = format!("paper: {}", row[0]);
            row.swap(2, 3);
            row.extend([String::new(), String::new()]);
            row
        })
        .collect();
    for scene in &chart.scenes {
        let [x, y, z] = scene.dims;
        let c = scene.categories;
        let all = c.clipped as f64 + c.affected as f64 + c.untouched as f64;
        let smallest = scene.spacing.into_iter().fold(f64::INFINITY, f64::min);
        let samples = (f64::from(scene.radius_mm) / smallest).round();
        rows.push(vec![
            escaped(&scene.name),
            format!("{x} × {y} × {z}"),
            escaped(&scene.clips),
            samples.to_string(),
            format!("{:.2}", 100.0 * c.affected as f64 / all),
            format!("{:.2}", 100.0 * c.clipped as f64 / all),
            format!("{:.1}", 100.0 * scene.recomputed),
        ]);
    }
    let head = ["scene", "resolution", "clip", "samples a ray", "affected, %", "clipped, %", "recomputed, %"];
    let note = "<p>Affected (category b, the paper's \"% voxels recalculated\") and clipped: of all voxels. Recomputed: of the voxels that show.</p>\n";
    note.to_owned() + &table(&head, 3, &rows)
}

/// CAO Table 3: frame rates while the clip moves. `every`: whether CAO computed every voxel, as the paper's does.
pub(super) fn table_3(chart: &Chart, every: bool) -> String {
    let mut rows = Vec::new();
    let row = |scene: String, rays: &str, rates: [String; 3], speed_up: f64| {
        let [solid, lao, cao] = rates;
        vec![scene, rays.into(), solid, lao, cao, format!("{speed_up:.2}")]
    };
    for (scene, solid, rates) in TABLE_3 {
        for (rays, [lao, cao]) in RAYS.into_iter().zip(rates) {
            let printed = [solid, lao, cao].map(|rate| format!("{rate:.3}"));
            rows.push(row(format!("paper: {scene}"), rays, printed, cao / lao));
        }
    }
    for scene in &chart.scenes {
        for rays in RAYS {
            let (Some(lao), Some(cao)) =
                (frame(scene, BASELINE, rays), frame(scene, contender::name(Method::Cao), rays))
            else {
                continue;
            };
            let times = [drawing(scene, SOLID), lao.total(), cao.total()];
            let rates = times.map(|ms| short(1e3 / ms));
            rows.push(row(escaped(&scene.name), rays, rates, lao.total() / cao.total()));
        }
    }
    let [width, height] = chart.plan.size;
    let note = format!(
        "<p>Ours: both eyes, {width} × {height} pixels each{}. LAO is the baseline {BASELINE}; {}.</p>\n",
        if chart.software { ", on a software driver, where only the speed-up means anything" } else { "" },
        match every {
            true => "CAO, too, has a value for every voxel, as the paper's has",
            false => "CAO needs a value only where a voxel shows, the paper's for every voxel",
        }
    );
    note + &table(
        &["scene", "rays", "solid colour", "LAO, frames/s", "CAO, frames/s", "speed-up of CAO"],
        1,
        &rows,
    )
}

/// SPAO Table 1.1: what its levels and their combination take, all new; ours beside.
pub(super) fn spao(chart: &Chart) -> String {
    // A share of all that N-buffers take.
    let share = |ms: f64, of: f64| if ms > 0.0 { format!("{:.4}", ms / of) } else { "–".into() };
    let mut html = String::new();
    for scene in &chart.scenes {
        let ours = [Levels::Nbuffer, Levels::Mip].map(|levels| {
            let options = Options { levels, ..Options::DEFAULT };
            let label = contender::label_of(Method::Spao, &options);
            let own = |p: &&Point| p.change == Change::Volume && p.setting.label == label;
            let point =
                scene.points.iter().filter(|p| p.method == contender::name(Method::Spao)).find(own)?;
            let of = |stage: &str| -> f64 {
                let ms = |run: &Run| run.stages.iter().filter(|t| t.stage.name == stage).map(|t| t.ms).sum();
                front::quartiles(point.runs.iter().map(ms))[1]
            };
            let levels: f64 = stages::LEVELS.iter().map(|stage| of(stage.name)).sum();
            let product = of(stages::PRODUCT.name);
            Some(move |part: &str| match part {
                "levels" => levels,
                "combination" => product,
                "all" => levels + product,
                level => of(level),
            })
        });
        let [Some(nbuffer), Some(mip)] = ours else { continue };
        let rows: Vec<Vec<String>> = TABLE_1_1
            .iter()
            .map(|(part, [printed, printed_mip])| {
                let whole = TABLE_1_1[TABLE_1_1.len() - 1].1[0];
                let mut row = vec![(*part).to_owned(), format!("{printed:.2}"), format!("{printed_mip:.2}")];
                row.extend([share(*printed, whole), share(*printed_mip, whole)]);
                row.extend([share(nbuffer(part), nbuffer("all")), share(mip(part), nbuffer("all"))]);
                row
            })
            .collect();
        let [x, y, z] = scene.dims;
        let _ = writeln!(
            html,
            "<p>{}, {x} × {y} × {z}, all values new, shares of what N-buffers take in all ({} ms here). Our level 0 is the opacity itself, and \
             our combination is of the voxels that show.</p>",
            escaped(&scene.name),
            short(nbuffer("all"))
        );
        let head = [
            "",
            "printed, N-buffers, ms",
            "mip levels, ms",
            "N-buffers",
            "mip levels",
            "ours, N-buffers",
            "ours, mip levels",
        ];
        html += &table(&head, 1, &rows);
    }
    html
}

fn drawing(scene: &SceneChart, method: &str) -> f64 {
    scene.draws.iter().find(|(name, _)| *name == method).map_or(f64::NAN, |(_, ms)| *ms)
}

/// The frame of a method with the paper's sum and so many equal rays.
fn frame(scene: &SceneChart, method: &str, rays: &str) -> Option<Split> {
    let own = |p: &&Point| {
        let left = p.setting.quadrature == Some(Quadrature::Left);
        p.change == Change::Clip && p.method == method && p.setting.label == rays && left
    };
    let point = scene.points.iter().find(own)?;
    Some(Split {
        clipping: point.part_ms(|split| split.clipping),
        rays: point.part_ms(|split| split.rays),
        // The picture is measured for itself; what its rays may leap over belongs to the update.
        rendering: point.part_ms(|split| split.rendering) + drawing(scene, method),
    })
}

/// CAO Fig. 9: what a frame is spent on, as bars.
pub(super) fn figure_9(chart: &Chart) -> Drawing {
    const PARTS: [(&str, &str); 3] = [
        ("clipping (step 4)", "#56b4e9"),
        ("spherical ray cast (step 5)", "#d55e00"),
        ("rendering (step 6)", "#009e73"),
    ];
    let mut bars = Vec::new();
    for scene in &chart.scenes {
        for rays in ["6", "26", "54"] {
            for method in [BASELINE, contender::name(Method::Cao)] {
                if let Some(parts) = frame(scene, method, rays) {
                    bars.push((format!("{}, {rays} rays, {method}", scene.name), parts));
                }
            }
        }
    }
    let longest = bars.iter().map(|(_, parts)| parts.total()).fold(1e-9, f64::max);
    let left = bars.iter().map(|(name, _)| text_width(name, 11)).fold(80.0, f64::max) + 20.0;
    let (row, top, width) = (20.0, 44.0, 560.0);
    let mut drawing = Drawing::new(left + width + 90.0, top + row * bars.len() as f64 + 12.0);
    let mut x = left;
    for (name, colour) in PARTS {
        drawing.rectangle([x, 12.0], [14.0, 12.0], colour);
        drawing.text([x + 19.0, 22.0], name, 12, Anchor::Start, INK, false);
        x += 19.0 + text_width(name, 12) + 18.0;
    }
    for (n, (name, parts)) in bars.iter().enumerate() {
        let y = top + row * n as f64;
        drawing.text([left - 8.0, y + 11.0], name, 11, Anchor::End, INK, false);
        let mut x = left;
        for ((_, colour), ms) in PARTS.into_iter().zip([parts.clipping, parts.rays, parts.rendering]) {
            let length = width * ms / longest;
            drawing.rectangle([x, y], [length, 14.0], colour);
            x += length;
        }
        let text = format!("{} ms", short(parts.total()));
        drawing.text([x + 5.0, y + 11.0], &text, 11, Anchor::Start, INK, false);
    }
    drawing
}

/// The mean over the scenes of a number of a mark's contender after its change, if all have it.
fn mean(scenes: &[&SceneChart], mark: &Mark, of: &dyn Fn(&Point) -> Option<f64>) -> String {
    let (change, method, setting) = (mark.of.change, mark.of.method, &mark.of.setting);
    let same = |p: &&Point| p.change == change && p.method == method && p.setting == *setting;
    let points = scenes.iter().filter_map(|scene| scene.points.iter().find(same));
    let values: Option<Vec<f64>> = points.map(of).collect();
    values.map_or("–".into(), |v| format!("{:.4}", v.iter().sum::<f64>() / v.len().max(1) as f64))
}

/// Every contender after one kind of change, over all scenes.
pub(super) fn everything(chart: &Chart, change: Change) -> String {
    let scenes: Vec<&SceneChart> = chart.scenes.iter().collect();
    let marks = draw::marks(&scenes, change, chart.software);
    let front = draw::front_of(&marks);
    let rows: Vec<Vec<String>> = marks
        .iter()
        .enumerate()
        .map(|(i, mark)| {
            let largest = |p: &Point| Some(p.errors.max);
            vec![
                if front.contains(&i) { "●".into() } else { String::new() },
                escaped(mark.of.method),
                escaped(&mark.of.setting.name()),
                if mark.time[1] > 0.0 { time(chart, mark.time) } else { "no cost".into() },
                format!("{:.4}", mark.error),
                mean(&scenes, mark, &|p| Some(p.shape.rmse)),
                mean(&scenes, mark, &|p| Some(p.errors.bias)),
                mean(&scenes, mark, &largest),
                mean(&scenes, mark, &|p| p.ssim_3d),
                escaped(&mark.of.setting.details),
            ]
        })
        .collect();
    let head = [
        "front",
        "method",
        "setting",
        "time",
        "RMSE",
        "tone fitted",
        "bias",
        "largest",
        "SSIM-3D",
        "details",
    ];
    table(&head, 3, &rows)
}

/// Every way to draw, over all scenes.
pub(super) fn pictures(chart: &Chart) -> String {
    let scenes: Vec<&Looks> = chart.scenes.iter().map(|scene| &scene.looks).collect();
    let marks = looks::marks(&scenes, chart.software);
    let fronts = ERRORS.map(|(_, error)| looks::front_of(&marks, error));
    let rows: Vec<Vec<String>> = marks
        .iter()
        .enumerate()
        .map(|(i, mark)| {
            let on = |front: &Vec<usize>| if front.contains(&i) { "●".into() } else { String::new() };
            let name = mark.setting.name();
            vec![
                on(&fronts[0]),
                on(&fronts[1]),
                if mark.setting.is_default() { format!("<b>{name}</b> (default)") } else { name },
                time(chart, mark.time),
                format!("{:.4}", mark.error.flip),
                format!("{:.2}", mark.error.levels),
            ]
        })
        .collect();
    let time = if chart.software { "ray cast / default's" } else { "ray cast" };
    table(&["front by FLIP", "by RMSE", "setting", time, "FLIP", "RMSE, levels"], 3, &rows)
}

/// What `tools/peers` measured.
pub(super) fn peers(peers: &Peers) -> String {
    let [x, y, z] = peers.dims;
    let [width, height] = peers.image_size;
    let times: Vec<Vec<String>> = peers
        .rows
        .iter()
        .map(|row| {
            vec![
                escaped(&row.system),
                escaped(&row.what),
                short(row.median_ms),
                format!("{} … {}", short(row.low), short(row.high)),
                format!("{:.3}", row.ratio_to_cao),
            ]
        })
        .collect();
    let stereo: Vec<Vec<String>> = peers
        .stereo
        .rows
        .iter()
        .map(|row| {
            vec![
                escaped(&row.what),
                row.points.to_string(),
                format!("{:.4}", row.mean),
                format!("{:.4}", row.p99),
            ]
        })
        .collect();
    let shadow: Vec<Vec<String>> = peers
        .clip_shadow
        .rows
        .iter()
        .map(|row| {
            vec![
                escaped(&row.what),
                format!("{:.1}", row.mean_brightness),
                format!("{} of {}", row.too_dark, row.floor_pixels),
            ]
        })
        .collect();
    let notes: String = peers.notes.iter().map(|note| format!("<li>{}</li>\n", escaped(note))).collect();
    format!(
        "<p>{}, {x} × {y} × {z} voxels, both eyes of {width} × {height} pixels, occlusion within {} mm; frames after a move of the clip plane, {} rounds in turn. {}.</p>\n{}<p>Occlusion at points that both eyes see, left minus right:</p>\n{}<p>Brightness, 0 … 255, of a floor below a block that is clipped away:</p>\n{}<ul>{notes}</ul>\n",
        escaped(&peers.volume),
        short(peers.radius_mm),
        peers.rounds,
        escaped(&peers.machine),
        table(&["system", "what", "median ms", "quartiles", "by CAO"], 2, &times),
        table(&["what", "points", "mean", "99th percentile"], 1, &stereo),
        table(&["what", "mean", "pixels too dark"], 1, &shadow),
    )
}
