//! The program `stereo-bench` on the real device, under validation, with frames small enough for seconds: what it prints, writes
//! and refuses. That one to four views show what they should is in `raycast.rs`.

use crate::support::{Folder, cube_obj, nrrd};
use serde_json::{Value, json};

const METHODS: [&str; 13] = [
    "solid",
    "sat",
    "shells",
    "vicinity",
    "histograms",
    "dvao",
    "fdao",
    "spao",
    "cones",
    "lao",
    "cao",
    "cao-literal",
    "rays",
];

/// The smallest run that has percentiles and runs to compare.
const TINY: &str = "builtin:engine:16 --radius-mm 3 --rays 6 --size 32x24 --frames 3 --runs 2 --warm-up 1";

fn bench() -> Folder {
    Folder::with_device().running(env!("CARGO_BIN_EXE_stereo-bench"))
}

/// Lines of a table of comma-separated values, by the names of its columns.
struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn read(text: &str) -> Self {
        let split = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
        let mut lines = text.lines().map(split);
        let table = Self { columns: lines.next().unwrap(), rows: lines.collect() };
        assert!(table.rows.iter().all(|row| row.len() == table.columns.len()), "ragged: {text}");
        table
    }

    fn at<'a>(&self, row: &'a [String], column: &str) -> &'a str {
        &row[self.columns.iter().position(|name| name == column).unwrap_or_else(|| panic!("no {column}"))]
    }

    fn number(&self, row: &[String], column: &str) -> f64 {
        self.at(row, column).parse().unwrap()
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// Percentiles are in order, of positive times, and lie among the frames in the table.
fn check_method(method: &Value, name: &str, table: &Table) {
    assert_eq!(method["method"], name);
    assert_eq!(method["frames"], 6, "{name}");
    let keys = ["least_ms", "median_ms", "p95_ms", "p99_ms", "most_ms"];
    let times = keys.map(|key| number(&method[key]));
    assert!(times[0] > 0.0 && times.is_sorted(), "{name}: {times:?}");
    let rows: Vec<_> = table.rows.iter().filter(|row| table.at(row, "method") == name).collect();
    let mut walls: Vec<f64> = rows.iter().map(|row| table.number(row, "frame_ms")).collect();
    walls.sort_by(f64::total_cmp);
    // Nearest rank: of six frames the third, and above 5/6 the last.
    for (time, wall) in times.iter().zip([0, 2, 5, 5, 5].map(|n| walls[n])) {
        assert!((time - wall).abs() < 1e-3, "{name}: {times:?} of {walls:?}");
    }
    let medians = method["run_medians_ms"].as_array().unwrap();
    assert_eq!(medians.len(), 2, "{name}");
    assert!(medians.iter().all(|ms| (times[0]..=times[4]).contains(&number(ms))), "{name}");

    for part in ["clipping", "spherical_ray_cast", "rendering", "overhead"] {
        assert!(number(&method["parts_ms"][part]) >= 0.0, "{name} {part}");
    }
    for row in rows {
        let parts = ["clipping_ms", "spherical_ray_cast_ms", "rendering_ms", "overhead_ms"];
        let sum: f64 = parts.map(|part| table.number(row, part)).iter().sum();
        // Four roundings to 1e-4, and device clocks that may run ahead of the host's by a little.
        let wall = table.number(row, "frame_ms");
        assert!(sum >= wall - 1e-3 && sum < 1.1 * wall + 0.1, "{name}: {sum} of {wall}");
    }
    let by_brick = !["solid", "lao", "cao", "cao-literal"].contains(&name);
    let rule = match name {
        "sat" => "box",
        "shells" => "mean",
        "vicinity" => "visible",
        "histograms" => "histogram",
        "dvao" => "network",
        "spao" => "product",
        "cones" => "cone",
        "rays" | "fdao" => "hybrid",
        _ => "left",
    };
    assert_eq!(method["quadrature"], rule);
    let stages = method["stages_ms"].as_object().unwrap();
    for (stage, there) in [
        ("classify", !by_brick),
        ("carve", by_brick),
        ("level 1", ["spao", "cones"].contains(&name)),
        ("cones", name == "cones"),
        ("product", name == "spao"),
        ("raycast", true),
        ("lao", name == "lao"),
        ("contextual", name != "lao" && !by_brick),
        ("rays", name == "rays"),
        ("opacity", false),
    ] {
        assert_eq!(stages.contains_key(stage), there, "{name}: {stage} in {stages:?}");
    }
}

#[test]
fn every_method_is_timed_for_one_two_and_four_views() {
    let folder = bench();
    for views in [1, 2, 4] {
        let answer = folder.json(&format!("{TINY} --views {views} --csv {views}.csv"));
        assert_eq!((&answer["views"], &answer["view_size"]), (&json!(views), &json!([32, 24])));
        assert_eq!(answer["rays"], "6");
        assert_eq!(
            (&answer["frames_a_run"], &answer["runs"], &answer["warm_up_frames"]),
            (&json!(3), &json!(2), &json!(1))
        );
        assert!(
            answer["device"].is_string() && answer["driver"].is_string() && answer["machine"].is_string()
        );
        assert_eq!(answer["files"], json!([format!("{views}.csv")]));

        let table = Table::read(&std::fs::read_to_string(folder.path(&format!("{views}.csv"))).unwrap());
        assert_eq!(table.rows.len(), METHODS.len() * 2 * 3);
        assert!(table.rows.iter().all(|row| table.at(row, "views") == views.to_string()));
        let methods = answer["methods"].as_array().unwrap();
        assert_eq!(methods.len(), METHODS.len());
        for (method, name) in methods.iter().zip(METHODS) {
            check_method(method, name, &table);
        }
        let lao = &methods[METHODS.iter().position(|name| *name == "lao").unwrap()];
        assert_eq!(number(&lao["lao_over_this"]), 1.0);
        assert!(number(&lao["affected_share"]) > 0.0, "the clip does nothing");
    }
}

/// The path depends on nothing but the frame's number: in every run and for both methods the clip does the same to the voxels, and
/// not the same in every frame.
#[test]
fn every_run_and_method_sees_the_same_frames() {
    let folder = bench();
    folder.ok(&format!("{TINY} --methods lao,cao --clip box --csv frames.csv"));
    let table = Table::read(&std::fs::read_to_string(folder.path("frames.csv")).unwrap());
    let voxels = ["voxels_clipped", "voxels_affected", "voxels_untouched"];
    let of = |row: &[String]| voxels.map(|column| table.number(row, column));
    let mut frames = Vec::new();
    for frame in ["0", "1", "2"] {
        let rows: Vec<_> = table.rows.iter().filter(|row| table.at(row, "frame") == frame).collect();
        assert_eq!(rows.len(), 4);
        assert!(rows.iter().all(|row| of(row) == of(rows[0])), "frame {frame}");
        assert_eq!(of(rows[0]).iter().sum::<f64>(), 16.0 * 16.0 * 16.0);
        frames.push(of(rows[0]));
    }
    assert!(frames[0] != frames[1] || frames[1] != frames[2], "nothing moves: {frames:?}");
}

/// Another program can draw the same frames: what they show is said, and is where the documentation of the path has it.
#[test]
fn the_answer_says_what_each_frame_shows() {
    let answer = bench().json(&format!("{TINY} --methods solid --clip plane"));
    let path = &answer["path"];
    assert_eq!(number(&path["step_mm"]), 0.25, "a quarter of the smallest spacing");
    assert!(path["light"].is_array() && number(&path["ambient"]) > 0.0 && number(&path["diffuse"]) > 0.0);
    let frames = path["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 3);
    // At the start of the path, in a volume of 16 mm.
    assert_eq!(frames[0]["clip"]["translate_mm"], json!([4.0, 0.0, 0.0]));
    assert_eq!(frames[0]["clip"]["rotate_deg"], json!([0.0, 0.0, 0.0]));
    assert_ne!(frames[0]["clip"], frames[1]["clip"]);
    for frame in frames {
        let views = frame["views"].as_array().unwrap();
        assert_eq!(views.len(), 2);
        assert_ne!(views[0]["position_mm"], views[1]["position_mm"]);
        let tan = |view: &Value, side: &str| number(&view["tan"][side]);
        // Each eye's field of view is shifted towards the other's side.
        assert!(tan(&views[0], "left") + tan(&views[0], "right") > 0.0);
        assert!(tan(&views[1], "left") + tan(&views[1], "right") < 0.0);
    }
    let still = bench().json(&format!("{TINY} --methods solid --clip none"));
    assert_eq!(still["path"]["frames"][0]["clip"], Value::Null);
}

#[test]
fn any_shape_can_move_also_a_mesh_and_nothing() {
    let folder = bench();
    folder.put("cube.obj", cube_obj(6));
    // The literal recipe takes a minute of preparation for a mesh whose maps its radius nearly fills.
    let tiny = "builtin:fruit:12 --radius-mm 2 --rays 6 --size 8x8 --frames 2 --runs 1 --warm-up 0 --methods solid,lao,cao";
    for (clip, cut) in [("plane", true), ("torus", true), ("cube.obj", true), ("none", false)] {
        let answer = folder.json(&format!("{tiny} --clip {clip} --all-voxels"));
        assert_eq!((&answer["clip"], &answer["all_voxels"]), (&json!(clip), &json!(true)));
        for method in answer["methods"].as_array().unwrap() {
            // Without rays no neighbourhood reaches a clip, but for the cells that samples stand for.
            let affected = number(&method["affected_share"]) > 0.0;
            assert!(affected == cut || method["method"] == "solid", "{clip}: {method}");
        }
    }
}

#[test]
fn tables_name_every_method_and_say_how_it_was_measured() {
    let text = bench().ok(TINY);
    for (start, words) in [
        ("device", ""),
        ("machine", "threads"),
        ("volume", "builtin:engine:16"),
        (
            "method",
            "solid sat shells vicinity histograms dvao fdao spao cones lao cao cao-literal rays, rays 6",
        ),
        ("views", "2 of 32 x 24 pixels"),
        ("clip", "sphere"),
        ("frames", "6 for each method: 2 runs of 3"),
        ("frame, ms", "95 %"),
        ("parts, ms", "spherical ray cast"),
    ] {
        let found = text.lines().any(|line| line.starts_with(start) && line.contains(words));
        assert!(found, "{start} … {words} is not in\n{text}");
    }
    for method in METHODS {
        let lines = text.lines().filter(|line| line.split_whitespace().next() == Some(method));
        assert_eq!(
            lines.count(),
            3,
            "{method}: a line of times, one of parts, one of what the host does\n{text}"
        );
    }
}

/// A budget that nothing meets: half of the pixels along each axis and samples a voxel apart, once a time is known.
#[test]
fn a_budget_for_drawing_chooses_scale_and_step() {
    let run = bench().run(&format!("{TINY} --methods solid --draw-budget-ms 0.000001"));
    assert_eq!(run.code, Some(0), "{}", run.err);
    let row = run.out.lines().skip_while(|line| !line.starts_with("drawing, ms")).nth(1).unwrap();
    assert!(row.starts_with("solid") && row.contains("0.50 (0.50 ... 0.50)"), "{row}");
    assert!(row.contains("1.00 (1.00 ... 1.00)"), "{row}");
    let whole = bench().json(&format!("{TINY} --methods solid"));
    let method = &whole["methods"][0];
    assert_eq!((number(&method["drawn_scale"]), number(&method["drawn_step_mm"])), (1.0, 0.25), "{whole}");
    assert_eq!(bench().run("--draw-budget-ms 0").code, Some(2));
}

/// Updates that fit no frame span several, whatever the method; with time for all none lags.
#[test]
fn a_budget_for_updates_says_what_frames_take_and_how_far_they_are_behind() {
    let folder = bench();
    let run = folder.run(&format!("{TINY} --methods rays --budget-ms 0.000001"));
    assert_eq!(run.code, Some(0), "{}", run.err);
    let row = run.out.lines().skip_while(|line| !line.starts_with("frames, ms")).nth(1).unwrap();
    assert!(row.starts_with("rays") && row.split_whitespace().count() == 10, "{row}");
    for (budget, lags) in [("0.000001", true), ("1000000", false)] {
        let answer = folder.json(&format!("{TINY} --methods rays,lao,cao --budget-ms {budget}"));
        for method in answer["methods"].as_array().unwrap() {
            let [behind, wall] = ["frames_behind", "wall_ms"].map(|key| &method[key]);
            assert_eq!(number(&behind["most"]) > 0.0, lags, "{method}");
            let times = ["p50", "p90", "p99", "most"].map(|key| number(&wall[key]));
            assert!(times[0] > 0.0 && times.is_sorted(), "{method}");
            assert!(number(&method["update_ms"]["most"]) <= times[3], "{method}");
        }
    }
    assert_eq!(folder.run("--budget-ms 0").code, Some(2));
}

/// Its layers are drawn in every frame, those of a mesh that only moves in none: in what the frame records, so that the host waits for neither.
#[test]
fn a_mesh_that_deforms_is_timed() {
    let folder = bench();
    let torus = cao_model::mesh::TriangleMesh::torus(16, 8);
    let vertices = torus.vertices.iter().map(|v| format!("v {} {} {}\n", v.x, v.y, v.z));
    let faces = torus.triangles.iter().map(|t| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1));
    folder.put("torus.obj", vertices.chain(faces).collect::<String>());
    let of = |flags: &str| {
        let answer = folder.json(&format!("{TINY} --methods rays --clip torus.obj {flags}"));
        let method = &answer["methods"][0];
        (
            answer["deforms"].as_bool().unwrap(),
            number(&method["commands"]),
            method["stages_ms"].get("peel").is_some(),
        )
    };
    let (moves, deforms) = (of(""), of("--deform"));
    assert!(!moves.0 && deforms.0 && deforms.1 > moves.1, "{moves:?} {deforms:?}");
    assert!(!moves.2 && deforms.2, "{moves:?} {deforms:?}");
    assert_eq!(folder.run("--deform").code, Some(2));
}

#[test]
fn series_vary_one_setting_at_a_time() {
    let folder = bench();
    let answer = folder.json(
        "builtin:engine:16 --radius-mm 4 --size 32x24 --frames 1 --runs 1 --warm-up 0 --methods solid,cao \
         --scale size,rays,radius,resolution,views --csv all.csv",
    );
    let scale = answer["scale"].as_object().unwrap();
    for (series, values, key, settings) in [
        (
            "size",
            json!(["4x4x4", "8x8x8", "12x12x12", "16x16x16"]),
            "dims",
            json!([[4, 4, 4], [8, 8, 8], [12, 12, 12], [16, 16, 16]]),
        ),
        ("rays", json!(["6", "14", "26", "54"]), "rays", json!(["6", "14", "26", "54"])),
        ("radius", json!(["1 mm", "2 mm", "4 mm", "8 mm"]), "radius_mm", json!([1.0, 2.0, 4.0, 8.0])),
        (
            "resolution",
            json!(["8x6", "16x12", "24x18", "32x24"]),
            "view_size",
            json!([[8, 6], [16, 12], [24, 18], [32, 24]]),
        ),
        ("views", json!(["1", "2", "4"]), "views", json!([1, 2, 4])),
    ] {
        let points = scale[series].as_array().unwrap();
        let of = |key: &str| Value::from(points.iter().map(|point| point[key].clone()).collect::<Vec<_>>());
        assert_eq!((of("value"), of(key)), (values, settings), "{series}");
        let methods = |point: &Value| point["methods"].as_array().unwrap().clone();
        for (method, name) in ["solid", "cao"].into_iter().enumerate() {
            assert!(points.iter().all(|point| methods(point)[method]["method"] == name), "{series}");
            // One frame each: the ratio of the two.
            let time = |point| number(&methods(point)[method]["median_ms"]);
            for point in points {
                let growth = number(&methods(point)[method]["over_first_of_series"]);
                assert!((growth / (time(point) / time(&points[0])) - 1.0).abs() < 1e-9, "{series} {name}");
            }
        }
        // All but what is varied is as in the base configuration.
        for other in ["dims", "rays", "radius_mm", "view_size", "views"].iter().filter(|other| **other != key)
        {
            assert!(points.iter().all(|point| point[other] == answer[other]), "{series} changes {other}");
        }
    }
    let table = Table::read(&std::fs::read_to_string(folder.path("all.csv")).unwrap());
    for (series, points) in
        [("base", 1), ("size", 4), ("rays", 4), ("radius", 4), ("resolution", 4), ("views", 3)]
    {
        let rows = table.rows.iter().filter(|row| table.at(row, "series") == series);
        assert_eq!(rows.count(), 2 * points, "{series}: two methods, one frame each");
    }
}

#[test]
fn a_run_is_kept_with_its_command_and_its_numbers() {
    let folder = bench();
    let line = "builtin:engine:8 --radius-mm 2 --size 8x8 --frames 1 --runs 1 --methods cao --save";
    let first = folder.json(line);
    let second = folder.ok(line);
    let mut kept: Vec<_> = std::fs::read_dir(folder.path("benches/runs"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    kept.sort();
    assert_eq!(kept.len(), 2, "{kept:?}");
    assert_eq!(kept[1], format!("{}-2", kept[0]), "the second of a day does not replace the first");
    let date = kept[0].get(..10).unwrap();
    assert!(date.chars().enumerate().all(|(i, c)| if [4, 7].contains(&i) {
        c == '-'
    } else {
        c.is_ascii_digit()
    }));

    let read = |name: &str| {
        std::fs::read_to_string(folder.path(&format!("benches/runs/{}/{name}", kept[1]))).unwrap()
    };
    assert_eq!(Table::read(&read("raw.csv")).rows.len(), 1);
    assert!(second.starts_with(&read("summary")), "the summary is what was printed:\n{second}");
    let readme = read("README.md");
    let command = format!("CAO_VALIDATION=1 stereo-bench {line}");
    for word in [command.as_str(), date, env!("CARGO_PKG_VERSION"), first["driver"].as_str().unwrap()] {
        assert!(readme.contains(word), "{word} is not in\n{readme}");
    }
    assert_eq!(first["files"].as_array().unwrap().len(), 3);
}

#[test]
fn what_cannot_be_measured_is_refused_before_a_device_is_asked_for() {
    let folder = Folder::without_device().running(env!("CARGO_BIN_EXE_stereo-bench"));
    folder.put("cube.nrrd", nrrd("uchar", "2 2 2", "1 1 1", &[0, 50, 100, 150, 200, 250, 20, 30]));
    for (arguments, code, words) in [
        ("--views 3", 2, "expected 1, 2 or 4"),
        (
            "--methods lao,vray",
            2,
            "expected one of solid, sat, shells, vicinity, histograms, dvao, fdao, spao, cones, lao, cao, cao-literal, rays",
        ),
        ("--methods lao,lao", 2, "lao is given twice"),
        ("--scale colour", 2, "expected one of size, rays, radius, resolution, views"),
        ("--scale rays,rays", 2, "rays is given twice"),
        ("cube.nrrd --scale size", 2, "built-in"),
        ("--size 0x64", 2, "WIDTHxHEIGHT"),
        ("--frames 0", 2, "--frames"),
        ("--clip dodecahedron", 2, "--clip dodecahedron"),
        ("--csv frames.txt", 2, ".csv"),
        ("--csv missing/frames.csv", 1, "there is no folder"),
        ("builtin:engine", 1, "builtin:engine"),
        ("absent.nrrd", 1, "absent.nrrd"),
        ("builtin:engine:16 --radius-mm 5000", 1, "radius"),
        // Nothing else is wrong: only now it needs one.
        ("builtin:engine:16", 1, "Vulkan"),
    ] {
        let run = folder.run(arguments);
        assert_eq!(run.code, Some(code), "{}: {}", run.line, run.err);
        assert!(run.err.contains(words), "{}: {words} is not in {}", run.line, run.err);
        assert_eq!(run.out, "", "{}", run.line);
    }
    assert_eq!(folder.list(), ["cube.nrrd"], "nothing half-written stays");
}
