//! `cao chart`: every method after every kind of change, in numbers, drawings and a page that stands alone.

use crate::support::Folder;
use cao::renderer::{COLOUR, Renderer};
use cao_measure::chart::looks::{self, ERRORS};
use cao_measure::chart::peers::Peers;
use cao_measure::chart::{
    Chart, Plan, Scene, csv, deep, draw, features, foresee, looks_draw, measure, meshes, meshes_panel, paper,
    report,
};
use cao_measure::contender::{self, Arena, Asked, BASELINE, Change, State};
use cao_measure::reference;
use cao_model::builtin::builtin;
use cao_model::methods::Method;
use cao_model::network::{Label, Shape};
use cao_model::occlusion::{Quadrature, RaySet};
use cao_model::samples::Filter;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::StereoRig;
use cao_testing::networks::network;
use cao_testing::{close, open};
use std::collections::BTreeMap;
use std::time::Instant;

/// Those of a first look: without `histograms`.
const METHODS: [&str; 13] = [
    "solid colour",
    "image space",
    BASELINE,
    "fdAO",
    "LAO",
    "CAO literal",
    "CAO",
    "SPAO",
    "cones",
    "rays",
    "SAT",
    "shells",
    "vicinity",
];
const RUNS: u32 = 2;
/// How far off foreseen minutes may be.
const FORESEEN: f64 = 8.0;

fn scene(name: &str, edge: usize) -> Scene {
    let volume = builtin(name, edge).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let rig = StereoRig::framing(volume.size_mm(), 30.0, 25.0);
    let state = State { clips: vec![Scene::default_clip(&volume)], transfer, radius_mm: edge as f32 / 3.6 };
    Scene { name: format!("builtin:{name}:{edge}"), volume, state, rig }
}

fn plan() -> Plan {
    let reference =
        reference::Plan { directions: 200, steps_per_voxel: 4, max_voxels: 300, ..reference::Plan::FULL };
    Plan { quick: true, runs: RUNS, size: [64, 48], pictures: [48, 36], reference }
}

/// Measured once, for it takes seconds; what has to hold of it is in the functions that this calls.
#[test]
fn every_method_is_charted_and_what_the_chart_says_holds() {
    let gpu = open();
    let mut shares = Vec::new();
    let scenes = [scene("engine", 18), scene("fruit", 16)];
    let foreseen = foresee(&gpu, &scenes, &plan()).unwrap();
    let start = Instant::now();
    let mut chart = measure(&gpu, &scenes, &plan(), &mut |_, share| shares.push(share)).unwrap();
    let minutes = start.elapsed().as_secs_f64() / 60.0;
    let plan = meshes::Plan { size: [24, 14], rays: 8, runs: RUNS, detail: Some(1), sought: false };
    chart.meshes = Some(meshes::measure(&gpu, &plan, Vec::new(), &mut |_, _| ()).unwrap());
    close(gpu);
    // Machines do other things meanwhile, and small scenes have more of everything that is not counted.
    let off = foreseen.minutes / minutes;
    println!("{} minutes foreseen, {minutes} taken", foreseen.minutes);
    assert!((1.0 / FORESEEN..FORESEEN).contains(&off), "{off} times as long");
    assert!(foreseen.device_bytes >= scenes[0].volume.len() as u64 * 24, "{foreseen:?}");
    assert!(shares.is_sorted() && *shares.last().unwrap() <= 1.0, "{shares:?}");
    assert!(shares.last().unwrap() > &0.8, "work that nobody counted: {shares:?}");

    every_run_of_every_method_and_change_is_a_record_whose_parts_fit_together(&chart);
    errors_are_in_the_order_that_the_methods_promise(&chart);
    the_front_of_each_panel_is_beaten_by_nothing_and_beats_all_else(&chart);
    drawings_are_well_formed_and_show_every_method_and_change(&chart);
    the_report_stands_alone_and_has_every_part(&chart);
    the_picture_is_drawn_in_every_way_and_more_work_errs_less(&chart);
    meshes_have_a_panel_of_their_own(&chart);
}

/// Over all scenes; one alone has none, nor a chart for which none was measured.
fn meshes_have_a_panel_of_their_own(chart: &Chart) {
    const TITLE: &str = "meshes: 7 scenes";
    let scenes: Vec<_> = chart.scenes.iter().collect();
    let svg = |chart: &Chart, scenes: &[&_]| draw::draw(chart, scenes, &chart.caption()).svg();
    let with = svg(chart, &scenes);
    assert!(with.contains(TITLE) && with.contains("AOV, clamped") && with.contains("24 x 14"), "{with}");
    let without = Chart { meshes: None, ..chart.clone() };
    assert!(!svg(&without, &scenes).contains("meshes") && !svg(chart, &scenes[..1]).contains(TITLE));
    let page = |chart| report::html(chart, "a machine", "cao chart", None).unwrap();
    assert!(page(chart).contains("Meshes: time against error") && page(chart).contains("colonnade"));
    assert!(!page(&without).contains("Meshes:"));
    // Nothing beats what is on its front, which is not all there is.
    let found = chart.meshes.as_ref().unwrap();
    let marks = meshes_panel::marks(&found.built().collect::<Vec<_>>(), true);
    let front = meshes_panel::front_of(&marks);
    assert!(!front.is_empty() && front.len() < marks.len());
    let beats = |a: &meshes_panel::Mark, b: &meshes_panel::Mark| a.time[1] <= b.time[1] && a.error < b.error;
    assert!(front.iter().all(|&i| !marks.iter().any(|other| beats(other, &marks[i]))));
}

/// Sizes of a sixteenth: what is tested is that everything is there and belongs together.
#[test]
fn the_papers_scenes_have_their_shares_tables_and_pictures() {
    let gpu = open();
    let plan = paper::Plan { divide: 16, runs: 1, size: [48; 2] };
    let scenes = paper::scenes(&plan, Vec::new()).unwrap();
    assert_eq!(
        scenes.iter().map(|s| s.volume.dims).collect::<Vec<_>>(),
        [[16, 16, 6], [26, 26, 15], [32; 3]]
    );
    let needs = paper::estimate(&gpu, &scenes, &plan).unwrap();
    assert!(needs.seconds > 0.0 && needs.bytes > 32_768);
    let found = paper::measure(&gpu, scenes, &plan, &mut |_, share| assert!(share <= 1.0)).unwrap();
    close(gpu);
    for ([printed, share], expected) in found.shares.iter().zip([14.94, 20.24, 16.13]) {
        // One layer of voxels more or less is more than a tenth of a percent of volumes so small.
        assert!(*printed == expected && (share - printed).abs() < 1.0, "{share} for {printed}");
    }
    for scene in &found.chart.scenes {
        assert_eq!(scene.points.len(), 8);
        assert!(scene.points.iter().all(|p| p.runs.len() == 2 && p.ms()[1] > 0.0));
        let methods: Vec<&str> = scene.draws.iter().map(|(name, _)| *name).collect();
        assert_eq!(methods, ["solid colour", BASELINE, "CAO"]);
    }
    let numbers: Vec<u32> = found.figures.iter().map(|(number, ..)| *number).collect();
    assert_eq!(numbers, [1, 8, 10, 10, 10, 11, 11, 11]);
    for (number, shows, picture) in &found.figures {
        let width = picture.width as usize;
        assert_eq!(width, if *number == 1 { 48 } else { 96 }, "{shows}");
        // At this size an engine's rays have one sample, before which nothing is occluded, and bones are thinner than voxels.
        if shows.starts_with("skeleton") {
            continue;
        }
        let lit = picture.pixels.iter().filter(|p| p.iter().any(|&c| c > 20)).count();
        assert!(20 * lit > picture.pixels.len(), "{shows} shows nothing");
        if shows.starts_with("beetle") {
            // Its halves differ by their rays.
            let different = picture.pixels.chunks(width).filter(|row| row[..48] != row[48..]).count();
            assert!(different > 0, "{shows}");
        }
    }
    assert!(found.speed_ups(RaySet::R54).iter().all(|up| up.is_finite()));
    let page = found.html("a machine", "cao chart --paper").unwrap();
    for part in ["paper: Beetle", "÷ 16", "Fig. 8, engine", "85.363", "spherical ray cast", "printed 20.24 %"]
    {
        assert!(page.contains(part), "{part}");
    }
    let four = (0..4).map(|n| (n.to_string(), builtin("voxel", 4).unwrap())).collect();
    let refused = paper::scenes(&plan, four).unwrap_err().to_string();
    assert!(refused.contains("--data") && refused.contains("engine, beetle, skeleton"), "{refused}");
}

/// A first look's shape at half its size: the tables have every row, the figures every picture, and rules show different things.
#[test]
fn the_paper_of_features_has_its_tables_and_pictures() {
    let gpu = open();
    let plan = features::Plan { edge: 16, radius: 4, shown: 4, runs: 1, size: 48 };
    let found = features::measure(&gpu, &plan, &mut |_, share| assert!(share <= 1.0)).unwrap();
    close(gpu);
    assert_eq!(found.scenes.iter().map(|s| s.features.len()).collect::<Vec<_>>(), [5, 3, 2]);
    for scene in &found.scenes {
        for (setting, runs) in &scene.settings {
            assert!(
                runs.len() == 1 && runs[0].iter().all(|n| n.is_finite() && *n > 0.0),
                "{setting} {runs:?}"
            );
        }
        let bricks = &scene.bricks;
        // Two bricks along each axis: a ray from one comes to all.
        assert!(
            bricks.all == 8 && bricks.matter == 8 && bricks.skipped.iter().all(|n| *n == 0),
            "{bricks:?}"
        );
    }
    assert_eq!(found.runs().lines().count(), 1 + 3 * 5);
    let sizes: Vec<_> = found.figures.iter().map(|(number, _, p)| (*number, p.width, p.height)).collect();
    assert_eq!(sizes, [(1, 4 * 48, 3 * 48), (3, 4 * 48, 2 * 48), (4, 3 * 48, 2 * 48)]);
    // Pictures of a figure, in pixels of 48.
    let part = |figure: usize, column: usize, row: usize| -> Vec<[u8; 3]> {
        let picture = &found.figures[figure].2;
        let rows = picture.pixels.chunks(picture.width as usize).skip(48 * row).take(48);
        rows.flat_map(|line| &line[48 * column..48 * (column + 1)]).copied().collect()
    };
    for row in 0..3 {
        for column in 0..4 {
            let shown = part(0, column, row);
            let lit = shown.iter().filter(|p| p.iter().any(|&c| c > 20)).count();
            assert!(10 * lit > shown.len(), "row {row}, column {column} shows nothing");
            assert!(column == 0 || shown != part(0, column - 1, row), "row {row}, column {column}");
        }
    }
    assert!(part(1, 0, 0) != part(1, 2, 0) && part(1, 0, 1) != part(1, 2, 1), "own and max are the same");
    // Rules are compared at one radius: that of the second column of Fig. 4.
    assert!(part(1, 3, 0) == part(2, 1, 1) && part(1, 3, 0) != part(2, 1, 0), "sample is not itself");
    assert!(found.changes.iter().all(|change| *change > 0.0), "{:?}", found.changes);
    let page = found.html("a machine", "cao chart --fdao").unwrap();
    well_formed(&page).unwrap();
    for printed in ["237 ms", "912 ms", "3.85", "2.45", "1.66", "417 ms, 12.7 %", "434 ms, 10.7 %", "liners"]
    {
        assert!(page.contains(printed), "{printed}");
    }
}

/// At half of a first look's size, by a small net of random weights for the transmittance at the ends of rays: it has a row against that and none against
/// the other truth, and more rays are nearer to either.
#[test]
fn table_3_of_a_network_has_its_rows_beside_the_printed() {
    let gpu = open();
    let plan = deep::Plan { edge: 16, scenes: 1, directions: 512, runs: 1 };
    let net = network(Shape { edge: 8, filters: 2, cap: 4, levels: 2, label: Label::End }, 5);
    let found = deep::measure(&gpu, &net, &plan, &mut |_, share| assert!(share < 1.0)).unwrap();
    close(gpu);
    let [mean, end] = [Label::Mean, Label::End].map(|label| found.means(label));
    assert_eq!((mean.len(), end.len()), (6, 4));
    let (of, [ssim, mse], costs) = end[0];
    assert_eq!(of, deep::Of::Network);
    assert!(
        ssim < 0.9 && mse > 1e-2 && costs.iter().all(|cost| *cost > Some(0.0)),
        "random weights: {end:?}"
    );
    for rows in [&mean[..3], &mean[3..], &end[1..]] {
        // From 32 rays on what steps miss may be all that is left.
        assert!(rows[2].1[1] < rows[0].1[1] && rows[2].1[0] > 0.98, "{rows:?}");
        // No method has rays to their ends.
        let timed = matches!(rows[0].0, deep::Of::Rays(..));
        assert!(rows.iter().all(|(.., costs)| costs.iter().all(|cost| cost.is_some() == timed)), "{rows:?}");
    }
    assert_eq!(found.runs().lines().count(), 1 + 6 + 4);
    let (shows, picture) = &found.figure;
    assert!(shows.contains("truth, DVAO; LAO to its rays' ends, 16;"), "{shows}");
    assert_eq!((picture.width, picture.height), (5 * 48, 2 * 48));
    let page = found.html("a machine", "cao chart --dvao").unwrap();
    well_formed(&page).unwrap();
    for printed in ["0.81", "7e-3", "1322", "0.96", "8e-5", "417", "rays, 190", "Fig. 8, engine"] {
        assert!(page.contains(printed), "{printed}");
    }
}

/// A grid of 22 · 11.085 / 0.5 voxels along each axis: what leaves a method out of a chart is a refusal and no failure.
#[test]
fn a_radius_that_needs_too_fine_a_grid_is_refused_by_name() {
    let gpu = open();
    let mut scene = scene("engine", 22);
    scene.state.radius_mm = 0.5;
    let asked = Asked { min_spacing: 1.0, radius: 0.5, quick: false };
    let net = contender::all(&asked).into_iter().find(|e| e.method == "DVAO").unwrap();
    let views = scene.rig.views(1.0, 1.0, 500.0).unwrap();
    let arena = Arena { gpu: &gpu, volume: &scene.volume, views: &views, size: [8; 2] };
    match (net.open)(arena, &scene.state) {
        Err(cao_measure::Error::Cao(cao::Error::Model(error @ cao_model::Error::Config { .. }))) => {
            assert!(error.to_string().contains("radius"), "{error}");
        }
        Err(other) => panic!("not a refusal: {other}"),
        Ok(_) => panic!("it was not refused"),
    }
    close(gpu);
}

/// Known by hand: one voxel in a row of bricks.
#[test]
fn bricks_are_empty_where_no_voxel_of_a_feature_is() {
    let named = |name: &str| cao_model::feature::Feature::new(name);
    let mut values = vec![0_u8; 64 * 8 * 8];
    // In the first brick, beside the second; and in the last.
    (values[7], values[63]) = (10, 20);
    let values = cao_model::values::Values::U8(values);
    let volume = cao_model::volume::Volume::new([64, 8, 8], [1.0; 3], values).unwrap();
    let both = vec![(named("a"), [10.0, 20.0]), (named("b"), [20.0, 30.0])];
    let both = cao_model::feature::Features::by_intervals(both).unwrap();
    let opacity = vec![[5.0, 0.0], [6.0, 1.0]];
    let transfer = TransferFunction::new(opacity, vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap();
    let found = features::bricks(&volume, &transfer, &both, 4);
    let expected = features::Bricks { all: 8, matter: 3, empty: vec![1, 2], skipped: vec![1, 2] };
    assert_eq!(found, expected);
    // From the last brick a ray of 48 voxels comes to the second, one of 54 to the first.
    assert_eq!(features::bricks(&volume, &transfer, &both, 45).skipped, [1, 1]);
    assert_eq!(features::bricks(&volume, &transfer, &both, 54).skipped, [0, 0]);
}

fn the_picture_is_drawn_in_every_way_and_more_work_errs_less(chart: &Chart) {
    let ways = looks::settings(1.0, true);
    let records = records(&csv::pictures(chart));
    assert_eq!(records.len(), chart.scenes.len() * ways.len() * RUNS as usize);
    for record in &records {
        let number = |name: &str| record[name].parse::<f64>().unwrap();
        assert!(
            number("raycast_ms") > 0.0 && number("flip") > 0.0 && number("rmse_levels") > 0.0,
            "{record:?}"
        );
        assert_eq!(record["setting"] == ways[0].name(), record["ratio"] == "1", "{record:?}");
    }
    let scenes: Vec<_> = chart.scenes.iter().map(|scene| &scene.looks).collect();
    let marks = looks::marks(&scenes, true);
    let of = |samples: u32, step: f32| {
        let same = |m: &&looks::Mark| {
            let rays = m.setting.kind == looks::Kind::Rays && m.setting.look.filter == Filter::Box;
            rays && m.setting.look.samples == samples && m.setting.step_voxels == step
        };
        marks.iter().find(same).unwrap().error
    };
    for (_, error) in ERRORS {
        let least = marks.iter().map(|mark| error(&mark.error)).fold(f64::INFINITY, f64::min);
        // Between the two finest steps the rays a pixel are what is left, and the order is a matter of luck.
        assert!(error(&of(4, 0.125)) < 1.05 * least, "{} {least}", error(&of(4, 0.125)));
        assert!(error(&of(1, 1.0)) > error(&of(1, 0.25)) && error(&of(1, 0.25)) > error(&of(4, 0.25)));
        let half = marks.iter().find(|mark| mark.setting.kind == looks::Kind::Scale).unwrap();
        assert!(error(&half.error) > error(&of(1, 0.25)));
        assert!(scenes.iter().all(|scene| error(&scene.convergence) < error(&scene.drawn[0].error)));
    }
    let svg = looks_draw::draw(chart).svg();
    well_formed(&svg).unwrap();
    for text in ["default", "level 16", "half", "FLIP", "RMSE", "The default: by FLIP"] {
        assert!(svg.contains(text), "{text}");
    }
}

/// The reference is off by nothing; half of the light is farther off than any setting, and beaten by nearly all.
#[test]
fn a_picture_with_a_fault_is_far_off_the_front() {
    let gpu = open();
    let scene = scene("engine", 18);
    let setup = Setup::of(Method::default(), 1.0);
    let mut renderer =
        Renderer::new(&gpu, &scene.volume, scene.state.transfer.clone(), setup, COLOUR).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let views = scene.rig.views(1.0, 1.0, 500.0).unwrap();
    let mut ways = looks::settings(1.0, true);
    let count = ways.len();
    let mut half = ways[0].clone();
    (half.look.ambient, half.look.diffuse) = (0.5 * half.look.ambient, 0.5 * half.look.diffuse);
    let truth = looks::Setting { look: looks::reference(1.0, 1), step_voxels: 1.0 / 16.0, ..ways[0].clone() };
    ways.extend([half, truth]);
    let found = looks::measure(&renderer, &views, [32, 32], 1.0, &ways, 2, &mut |_| ()).unwrap();
    assert_eq!(found.drawn[count + 1].error, looks::Apart { flip: 0.0, levels: 0.0 });
    let marks = looks::marks(&[&found], true);
    for (_, error) in ERRORS {
        assert!(!looks::front_of(&marks, error).contains(&count));
        let most = marks[..count].iter().map(|mark| error(&mark.error)).fold(0.0, f64::max);
        // The default's light is all that differs, and yet it is off by more than the coarsest setting there is.
        let (off, default) = (error(&marks[count].error), error(&marks[0].error));
        assert!(off > most && off > 2.0 * default, "{off}, default {default}, others at most {most}");
        assert!(!looks::better(&marks, count, error).is_empty());
    }
    drop(renderer);
    close(gpu);
}

/// Records of RFC 4180, by the names of the first.
fn records(text: &str) -> Vec<BTreeMap<String, String>> {
    let mut rows = vec![vec![String::new()]];
    let mut quoted = false;
    for c in text.strip_suffix("\r\n").unwrap().replace("\r\n", "\n").chars() {
        let row = rows.last_mut().unwrap();
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => row.push(String::new()),
            '\n' if !quoted => rows.push(vec![String::new()]),
            c => row.last_mut().unwrap().push(c),
        }
    }
    let names = rows.remove(0);
    rows.into_iter()
        .map(|row| {
            assert_eq!(row.len(), names.len(), "{row:?}");
            names.iter().cloned().zip(row).collect()
        })
        .collect()
}

/// Every element closed by its own name; attributes quoted. Void elements of HTML may stay open.
fn well_formed(text: &str) -> Result<(), String> {
    const VOID: [&str; 2] = ["meta", "img"];
    let mut open: Vec<String> = Vec::new();
    let mut rest = text;
    while let Some((before, tag)) = rest.split_once('<') {
        if before.contains('>') && !open.iter().any(|name| name == "style") {
            return Err(format!("a loose > in {before:?}"));
        }
        if let Some(comment) = tag.strip_prefix("!--") {
            rest = comment.split_once("-->").ok_or("an open comment")?.1;
            continue;
        }
        let (tag, after) = tag.split_once('>').ok_or_else(|| format!("an open tag {tag:?}"))?;
        rest = after;
        if tag.matches('"').count() % 2 == 1 {
            return Err(format!("quotes of <{tag}>"));
        }
        let name = |tag: &str| tag.split([' ', '/']).find(|s| !s.is_empty()).unwrap_or_default().to_owned();
        if tag.starts_with('!') || tag.starts_with('?') || tag.ends_with('/') {
            continue;
        }
        match tag.strip_prefix('/') {
            Some(closed) => match open.pop() {
                Some(opened) if opened == closed => {}
                other => return Err(format!("</{closed}> closes {other:?}")),
            },
            None if VOID.contains(&name(tag).as_str()) => {}
            None => open.push(name(tag)),
        }
    }
    if open.is_empty() { Ok(()) } else { Err(format!("{open:?} stay open")) }
}

fn every_run_of_every_method_and_change_is_a_record_whose_parts_fit_together(chart: &Chart) {
    let records = records(&csv::runs(chart));
    let number = |record: &BTreeMap<String, String>, name: &str| -> f64 {
        record[name].parse().unwrap_or_else(|_| panic!("{name}: {:?}", record[name]))
    };
    for scene in ["builtin:engine:18", "builtin:fruit:16"] {
        for change in Change::ALL.map(Change::name) {
            for method in METHODS {
                let own: Vec<_> = records
                    .iter()
                    .filter(|r| r["scene"] == scene && r["change"] == change && r["method"] == method)
                    .collect();
                assert!(
                    !own.is_empty() && own.len().is_multiple_of(RUNS as usize),
                    "{scene} {change} {method}"
                );
                for record in own {
                    let stages: f64 = record
                        .iter()
                        .filter(|(name, value)| {
                            name.ends_with("_ms") && *name != "total_ms" && !value.is_empty()
                        })
                        .map(|(_, value)| value.parse::<f64>().unwrap())
                        .sum();
                    assert!(
                        (stages - number(record, "total_ms")).abs() < 1e-9 * stages.max(1.0),
                        "{record:?}"
                    );
                    assert_eq!(stages > 0.0, method != "solid colour", "{record:?}");
                    assert!(!record["total_ms"].starts_with('-'), "{record:?}");
                    let (rmse, max) = (number(record, "rmse"), number(record, "max"));
                    assert!(rmse > 0.0 && rmse <= max && max <= 1.0, "{record:?}");
                    assert!(number(record, "bias").abs() <= rmse && number(record, "rmse_shape") <= rmse);
                    if method == BASELINE && record["setting"] == "26 left" {
                        assert_eq!(record["ratio"], "1");
                    }
                    // Image space has values on the surface only.
                    assert_eq!(record["ssim3d"].is_empty(), method == "image space");
                    assert_eq!(record["errors_at"] == "surface", method == "image space");
                }
            }
        }
    }
}

fn errors_are_in_the_order_that_the_methods_promise(chart: &Chart) {
    for point in chart.scenes.iter().flat_map(|scene| &scene.points) {
        let scene = chart.scenes.iter().find(|s| s.points.iter().any(|p| std::ptr::eq(p, point))).unwrap();
        let other = |method: &str, name: &str| {
            let same = |p: &&cao_measure::chart::Point| {
                p.change == point.change && p.method == method && p.setting.name() == name
            };
            scene.points.iter().find(same).unwrap_or_else(|| panic!("{method} {name}"))
        };
        let context = format!("{} {:?} {} {}", scene.name, point.change, point.method, point.setting.name());
        // Any method beats none at all.
        let solid = other("solid colour", "-");
        assert!(point.method == "solid colour" || point.errors.rmse < solid.errors.rmse, "{context}");
        match point.method {
            // Bit for bit what a full recomputation gives.
            "CAO" => assert_eq!(point.errors, other("LAO", &point.setting.name()).errors, "{context}"),
            "LAO" if point.setting.quadrature == Some(Quadrature::Left) && point.setting.label == "26" => {
                assert_eq!(point.errors, other(BASELINE, "26 left").errors, "{context}");
            }
            // Voxels that its maps leave stale are never nearer to the truth by much.
            "CAO literal" => {
                let fresh = other(BASELINE, &point.setting.name()).errors.rmse;
                assert!(point.errors.rmse > 0.9 * fresh && point.errors.rmse < 2.0 * fresh, "{context}");
            }
            _ => {}
        }
        if ["50w segment", "spiral:50 hybrid"].contains(&point.setting.name().as_str()) {
            assert!(point.errors.rmse < 0.7 * other(BASELINE, "26 left").errors.rmse, "{context}");
        }
    }
    for scene in &chart.scenes {
        for (change, truth) in &scene.references {
            assert!(truth.computed > 50 && truth.computed <= truth.counting, "{} {change:?}", scene.name);
            assert!(truth.surface > 50 && truth.convergence < 0.01, "{} {change:?} {truth:?}", scene.name);
        }
        let affected = scene.categories.affected as f64 / 18.0_f64.powi(3);
        assert!((0.05..0.8).contains(&affected), "{}: {affected}", scene.name);
        assert!(scene.recomputed > 0.0 && scene.recomputed < 1.0, "{}: {}", scene.name, scene.recomputed);
    }
}

fn the_front_of_each_panel_is_beaten_by_nothing_and_beats_all_else(chart: &Chart) {
    let scenes: Vec<_> = chart.scenes.iter().collect();
    for change in Change::ALL {
        let marks = draw::marks(&scenes, change, true);
        let front = draw::front_of(&marks);
        assert!(!front.is_empty());
        for (i, mark) in marks.iter().enumerate() {
            if mark.of.on_surface || mark.time[1] <= 0.0 {
                assert!(!front.contains(&i), "{} does not compete", mark.of.method);
                continue;
            }
            let beaten = front.iter().any(|&f| {
                let f = &marks[f];
                f.time[1] <= mark.time[1]
                    && f.error <= mark.error
                    && (f.time[1], f.error) != (mark.time[1], mark.error)
            });
            assert_eq!(
                beaten,
                !front.contains(&i),
                "{change:?} {} {}",
                mark.of.method,
                mark.of.setting.name()
            );
        }
    }
}

fn drawings_are_well_formed_and_show_every_method_and_change(chart: &Chart) {
    let scenes: Vec<_> = chart.scenes.iter().collect();
    let drawing = draw::draw(chart, &scenes, &chart.caption());
    let svg = drawing.svg();
    well_formed(&svg).unwrap();
    for text in
        METHODS.into_iter().chain(Change::ALL.map(Change::name)).chain(["builtin:fruit:16", "26 rays"])
    {
        assert!(svg.contains(text), "{text}");
    }
    let png = image::load_from_memory(&drawing.png().unwrap()).unwrap();
    assert!(png.width() > 1500 && png.height() > 1200);

    assert!(well_formed(&svg.replacen("</text>", "", 1)).is_err());
    assert!(well_formed(&svg.replacen("</svg>", "</svg></g>", 1)).is_err());
    assert!(well_formed(&svg.replacen("x=\"", "x=", 1)).is_err());
}

pub const PEERS: &str = r#"{"machine": "a <machine>", "volume": "v", "dims": [1, 2, 3], "image_size": [4, 5], "radius_mm": 6, "rounds": 7,
    "rows": [{"system": "VTK", "what": "plain & simple", "median_ms": 8, "low": 7, "high": 9, "ratio_to_cao": 1.25}],
    "stereo": {"rows": [{"what": "SSAO", "points": 10, "mean": 0.02, "p99": 0.1}]},
    "clip_shadow": {"rows": [{"what": "floor", "mean_brightness": 130.2, "too_dark": 11, "floor_pixels": 12}]}, "notes": ["a note"]}"#;

/// What a page would fetch.
fn references(html: &str) -> Vec<&str> {
    let quoted = ["src=\"", "href=\"", "url("].into_iter().flat_map(|how| html.split(how).skip(1));
    let external = quoted.filter(|rest| !rest.starts_with("data:")).map(|rest| &rest[..rest.len().min(40)]);
    external.chain(html.match_indices("http").map(|(at, _)| &html[at..(at + 20).min(html.len())])).collect()
}

fn the_report_stands_alone_and_has_every_part(chart: &Chart) {
    let peers = Peers::parse(PEERS).unwrap();
    let with = report::html(chart, "a machine", "cao chart -o <x>", Some(&peers)).unwrap();
    well_formed(&with).unwrap();
    assert_eq!(references(&with), [""; 0]);
    assert_eq!(references("<img src=\"a.png\"> http://x <img src=\"data:,\">").len(), 2);
    // Two pictures of each method, and the one of light that has no ambient values.
    assert_eq!(with.matches("data:image/png;base64,").count(), 2 * METHODS.len() + 1);
    assert!(with.contains("<b>Phong</b>, -: no ambient values; drawn in "));
    // As printed: a row of each of the paper's three tables.
    for printed in [
        "(default)",
        "Error of the picture",
        "Clustered histograms",
        "16.13",
        "272.846",
        "332.14",
        "a machine",
        "cao chart -o &lt;x&gt;",
    ] {
        assert!(with.contains(printed), "{printed}");
    }
    assert!(with.contains("plain &amp; simple") && with.contains("a &lt;machine&gt;"));
    let without = report::html(chart, "a machine", "cao chart", None).unwrap();
    assert!(!without.contains("Peers") && with.contains("Peers"));
}

#[test]
fn a_scene_that_shows_nothing_or_a_plan_that_measures_nothing_is_refused_by_name() {
    let gpu = open();
    let mut nothing = scene("engine", 18);
    nothing.state.transfer.opacity.iter_mut().for_each(|point| point[1] = 0.0);
    let refused = |scene: &Scene, plan: &Plan| {
        measure(&gpu, std::slice::from_ref(scene), plan, &mut |_, _| ()).unwrap_err().to_string()
    };
    let said = refused(&nothing, &plan());
    assert!(said.contains("builtin:engine:18") && said.contains("no voxel has opacity"), "{said}");
    let said = refused(&scene("engine", 18), &Plan { runs: 0, ..plan() });
    assert!(said.contains("0 runs"), "{said}");
    close(gpu);
    let said = Peers::parse("{\"machine\": 3}").unwrap_err().to_string();
    assert!(said.contains("peers.json"), "{said}");
}

const SCENE: &str = r#"
volume = "builtin:engine:16x14x12"
clip = [{ shape = "plane", rotate_deg = [0, 90, 0], translate_mm = [2, 0, 0] }]
occlusion = { radius_mm = 3 }
"#;

#[test]
fn the_program_writes_all_files_and_says_which() {
    let folder = Folder::with_device();
    folder.put("peers.json", PEERS).put("scene.toml", SCENE);
    // A name that is not UTF-8 is a name, and part of the command that the report cites.
    let script = r#"name=$(printf 'caf\351.json'); mv peers.json "$name"; exec "$@" --peers "$name""#;
    let run = folder.under(script, "chart scene.toml --quick --runs 1 -o chart --json");
    assert_eq!(run.code, Some(0), "{}", run.err);
    let answer: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!(answer["files"].as_array().unwrap().len(), 7);
    let mut names: Vec<_> = std::fs::read_dir(folder.path("chart"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        ["chart.png", "chart.svg", "pictures.csv", "pictures.png", "pictures.svg", "report.html", "runs.csv"]
    );
    let points = answer["points"].as_array().unwrap();
    for method in METHODS {
        assert!(points.iter().any(|p| p["method"] == method), "{method}");
    }
    assert!(
        answer["pictures"].as_array().unwrap().iter().any(|p| p["default"] == true && p["flip"].is_f64())
    );
    let report = std::fs::read_to_string(folder.path("chart/report.html")).unwrap();
    // What the scene says, and not what is done where it says nothing.
    assert!(report.contains("scene.toml: 16 x 14 x 12 voxels, radius 3 mm, clip plane"));
    assert!(report.contains("plain &amp; simple") && report.contains("--peers caf\u{fffd}.json"));
    assert_eq!(references(&report), [""; 0]);
}

#[test]
fn what_cannot_be_charted_is_refused_by_name_and_leaves_nothing() {
    let folder = Folder::without_device();
    folder.put("file", "").put("peers.json", "{}").put("noise.nrrd", "noise");
    let before = folder.list();
    for (arguments, code, part) in [
        ("chart", 2, "--output"),
        ("chart -o file", 2, "file: is a file, expected a folder"),
        ("chart -o no/such/place", 1, "no/such/place"),
        ("chart --runs 0 -o out", 2, "--runs"),
        ("chart --radius-mm 0 -o out", 2, "--radius-mm"),
        ("chart --fdao --paper -o out", 2, "--paper"),
        ("chart --dvao --fdao -o out", 2, "--fdao"),
        ("chart --network noise.nrrd -o out", 2, "noise.nrrd"),
        ("chart --dvao --network file -o out", 2, "file"),
        ("chart --meshes --dvao -o out", 2, "--dvao"),
        ("chart --rays 10 -o out", 2, "--meshes"),
        ("chart --meshes --rays 1 -o out", 2, "--rays"),
        ("chart --meshes --size 0x9 -o out", 2, "0x9"),
        ("chart builtin:pear:16 -o out", 1, "pear"),
        ("chart builtin:engine:16 builtin:engine:16 -o out", 2, "given twice"),
        ("chart noise.nrrd -o out", 1, "noise.nrrd"),
        ("chart absent.nrrd -o out", 1, "absent.nrrd"),
        ("chart --peers absent.json -o out", 1, "absent.json"),
        ("chart --peers peers.json -o out", 1, "peers.json"),
        ("chart builtin:engine:16 --transfer shiny -o out", 1, "shiny"),
        ("chart scene.toml --dims 4,4,4 --type uint8 -o out", 2, "--dims: the scene scene.toml"),
        // Everything is well but for the device.
        ("chart builtin:engine:16 -o out", 1, "Vulkan"),
    ] {
        let run = folder.run(arguments);
        assert_eq!(run.code, Some(code), "{}: {}", run.line, run.err);
        assert!(run.err.contains(part), "{}: {part:?} is not in {:?}", run.line, run.err);
        assert_eq!((run.out.as_str(), folder.list()), ("", before.clone()), "{}", run.line);
    }
}
