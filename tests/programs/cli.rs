//! The real program on the real device, under validation, in folders of its own: every command and what it writes and prints.
//! What it refuses is in `cli_refusals.rs`, how it writes in `cli_outputs.rs`.

use crate::support::{Folder, cube_obj, nrrd};
use cao_formats::read;
use cao_model::volume::Volume;
use serde_json::{Value, json};

/// A volume that the program wrote, which must be one of `dims` voxels of f32.
fn written(folder: &Folder, name: &str, dims: [usize; 3]) -> Volume {
    let volume = read(&folder.path(name)).unwrap();
    assert_eq!((volume.dims, volume.values.kind()), (dims, "float32"), "{name}");
    volume
}

fn values(volume: &Volume) -> Vec<f32> {
    (0..volume.len()).map(|i| volume.value(i) as f32).collect()
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// A sphere of values from 255 inside to 0 outside.
fn ball([nx, ny, nz]: [usize; 3]) -> Vec<u8> {
    let at = |i: usize, n: usize| (2 * i + 1) as f32 / n as f32 - 1.0;
    let mut values = Vec::new();
    for (z, y, x) in indices(nz, ny, nx) {
        let r = (at(x, nx).powi(2) + at(y, ny).powi(2) + at(z, nz).powi(2)).sqrt();
        values.push(((0.9 - r) * 600.0).clamp(0.0, 255.0) as u8);
    }
    values
}

fn indices(nz: usize, ny: usize, nx: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| (z, y, x))))
}

#[test]
fn occlusion_is_written_as_f32_nrrd_on_the_grid_of_the_input() {
    let folder = Folder::with_device();
    folder.put("ball.nrrd", nrrd("uchar", "11 9 6", "1 1.25 2", &ball([11, 9, 6])));
    let answer = folder.json(
        "occlusion ball.nrrd --radius-mm 4 -o ao.nrrd --opacity-out vo.nrrd --mask-out vm.nrrd --clip plane --clip-translate 0,0,-0.5",
    );
    assert_eq!(folder.list(), ["ao.nrrd", "ball.nrrd", "vm.nrrd", "vo.nrrd"]);

    for name in ["ao.nrrd", "vo.nrrd", "vm.nrrd"] {
        let volume = written(&folder, name, [11, 9, 6]);
        assert_eq!(volume.spacing, [1.0, 1.25, 2.0], "{name}");
        let values = values(&volume);
        assert!(values.iter().all(|v| (0.0..=1.0).contains(v)), "{name}");
        assert!(values.iter().any(|v| *v != values[0]), "{name} is the same everywhere");
        // What other programs read of it: the header in words, then the values to the end of the file.
        let bytes = std::fs::read(folder.path(name)).unwrap();
        let end = bytes.windows(2).position(|w| w == b"\n\n").unwrap() + 2;
        let header = std::str::from_utf8(&bytes[..end]).unwrap();
        for line in ["type: float", "sizes: 11 9 6", "spacings: 1 1.25 2", "encoding: raw", "endian: little"]
        {
            assert!(header.lines().any(|l| l == line), "{name}: {line} is not in\n{header}");
        }
        assert_eq!(bytes.len() - end, 4 * 11 * 9 * 6, "{name}");
        assert_eq!(bytes[end..end + 4], values[0].to_le_bytes(), "{name}");
    }
    let mask = values(&written(&folder, "vm.nrrd", [11, 9, 6]));
    assert!(mask.iter().all(|m| [0.0, 0.5, 1.0].contains(m)));
    let opacity = values(&written(&folder, "vo.nrrd", [11, 9, 6]));
    // The plane hides z > -0.5 mm: slices 3 to 5, which begin at z = 0.
    assert!(opacity[3 * 99..].iter().all(|o| *o == 0.0) && opacity[..3 * 99].iter().any(|o| *o > 0.0));

    assert!(answer["device"].is_string() && answer["driver"].is_string(), "{answer}");
    assert_eq!(answer["volume"], "ball.nrrd");
    assert_eq!(answer["dims"], json!([11, 9, 6]));
    assert_eq!(answer["spacing_mm"], json!([1.0, 1.25, 2.0]));
    assert_eq!(answer["files"], json!(["ao.nrrd", "vo.nrrd", "vm.nrrd"]));
    assert_eq!(
        (&answer["method"], &answer["rays"], &answer["samples"]),
        (&json!("lao"), &json!("26"), &json!(4))
    );
    for stage in ["opacity", "classify", "lao"] {
        assert!(answer["stages_ms"][stage].as_f64().is_some_and(|ms| ms > 0.0), "{stage}: {answer}");
    }
    let counted = |m: f32| mask.iter().filter(|v| **v == m).count();
    for (key, of_mask) in [("clipped", 0.0), ("affected", 0.5), ("untouched", 1.0)] {
        assert_eq!(answer[key], counted(of_mask), "{key}");
    }
}

#[test]
fn full_and_contextual_are_equal_bit_for_bit_wherever_the_mask_is_not_0() {
    let folder = Folder::with_device();
    folder.put("cube.obj", cube_obj(6));
    let mut recomputed = 0;
    for (clip, dims) in [
        ("--clip plane --clip-rotate 20,30,0 --clip-translate 0,0,-2", [20, 20, 20]),
        ("--clip sphere --clip-scale 6 --clip-translate -5,-4,3", [20, 20, 20]),
        ("--clip torus --clip-mode keep --clip-scale 8,6,7 --clip-rotate -40,10,0", [20, 20, 20]),
        ("--clip cube.obj --clip-scale 5 --clip-rotate 15,25,35 --clip-translate 6,2,-3", [21, 13, 11]),
        ("--clip cube.obj --clip-mode keep --clip-scale 7 --clip box --clip-scale 3", [21, 13, 11]),
    ] {
        let volume = if dims[0] == 20 { "builtin:fruit:20" } else { "builtin:engine:21x13x11:1,1.5,2" };
        let run = |method: &str| {
            let outputs =
                format!("-o {method}.nrrd --opacity-out {method}-o.nrrd --mask-out {method}-m.nrrd");
            folder.ok(&format!("occlusion {volume} --radius-mm 3 --method {method} {clip} {outputs}"));
            ["", "-o", "-m"].map(|part| values(&written(&folder, &format!("{method}{part}.nrrd"), dims)))
        };
        let [full, full_opacity, full_mask] = run("lao");
        let [contextual, opacity, mask] = run("cao");
        assert_eq!(bits(&full_opacity), bits(&opacity), "{clip}");
        assert_eq!(bits(&full_mask), bits(&mask), "{clip}");
        let differ =
            (0..mask.len()).filter(|&i| mask[i] != 0.0 && full[i].to_bits() != contextual[i].to_bits());
        assert_eq!(differ.count(), 0, "{clip}");
        recomputed += (0..mask.len()).filter(|&i| mask[i] == 0.5 && full[i] < 1.0).count();
        // In what a thin shape keeps no voxel is far from the cut.
        for category in if clip.contains("keep") { &[0.0, 0.5][..] } else { &[0.0, 0.5, 1.0] } {
            assert!(mask.contains(category), "{clip}: no voxel of mask {category}");
        }
    }
    assert!(recomputed > 100, "there was hardly anything to compare");
}

#[test]
fn each_clip_flag_belongs_to_the_clip_before_it() {
    let folder = Folder::with_device();
    let opacity_with = |clips: &str| {
        folder.ok(&format!(
            "occlusion builtin:uniform:13 --radius-mm 1 --rays 6 -o ao.nrrd --opacity-out vo.nrrd {clips}"
        ));
        written(&folder, "vo.nrrd", [13; 3])
    };
    let (ball, cube) =
        ("--clip sphere --clip-scale 3 --clip-translate -3,0,0", "--clip box --clip-translate 3,0,0");
    let both = opacity_with(&format!("{ball} {cube}"));
    // Voxel (6, 6, 6) is at the origin.
    let at = |volume: &Volume, x: usize, y: usize| volume.at(x, y, 6) as f32;
    let whole = at(&both, 0, 0);
    assert!(whole > 0.0);
    assert_eq!((at(&both, 3, 6), at(&both, 9, 6)), (0.0, 0.0), "the centres of both");
    assert_eq!((at(&both, 3, 8), at(&both, 9, 8)), (0.0, whole), "2 mm beside them only the sphere reaches");
    let reordered = opacity_with(
        "--clip box --clip-translate 3,0,0 --clip sphere --clip-translate -3,0,0 --clip-scale 3",
    );
    assert_eq!(bits(&values(&both)), bits(&values(&reordered)), "clips are independent");
    let kept = opacity_with("--clip box --clip-translate -3,0,0 --clip-mode keep --clip-rotate 0,-90,0");
    assert_eq!((at(&kept, 3, 6), at(&kept, 9, 6), at(&kept, 3, 8)), (whole, 0.0, 0.0));
}

#[test]
fn every_ray_set_and_rule_meets_its_closed_form_in_a_uniform_volume() {
    let folder = Folder::with_device();
    folder.put("tenth.toml", "opacity = [[0, 0.1], [255, 0.1]]\ncolour = \"#ffffff\"\n");
    // Three samples of transmittance q = 0.9 a mm; at the centre of 9³ voxels no ray leaves the volume.
    let (q, m) = (0.9_f64, 3.0_f64);
    let left = (1.0 + q + q * q) / m;
    let extinction = -q.ln();
    let length = m - 0.5;
    let segment = (1.0 - (-extinction * length).exp()) / (extinction * length);
    for (rays, rule, expected) in [
        ("6", "left", left),
        ("14", "cell", left * (1.0 + q) / 2.0),
        ("26", "segment", segment),
        ("54", "left", left),
        ("14w", "cell", left * (1.0 + q) / 2.0),
        ("26w", "segment", segment),
        ("50w", "left", left),
        ("spiral:50", "segment", segment),
    ] {
        let answer = folder.json(&format!(
            "occlusion builtin:uniform:9 --transfer tenth.toml --radius-mm 3 --rays {rays} --quadrature {rule} -o ao.nrrd"
        ));
        assert_eq!((&answer["rays"], &answer["quadrature"]), (&json!(rays), &json!(rule)));
        let centre = written(&folder, "ao.nrrd", [9; 3]).at(4, 4, 4);
        // Products and sums of a few f32 numbers near 1.
        assert!((centre - expected).abs() < 2e-6, "{rays} {rule}: {centre}, expected {expected}");
    }
}

#[test]
fn nothing_is_occluded_where_nothing_is_or_no_ray_goes() {
    let folder = Folder::with_device();
    for (arguments, dims) in [
        ("builtin:empty:7", [7; 3]),
        ("builtin:uniform:5 --radius-mm 0", [5; 3]),
        ("builtin:voxel:1 --radius-mm 1", [1; 3]),
        ("builtin:voxel:1 --method cao --clip sphere --clip-scale 9", [1; 3]),
        ("builtin:empty:17x2x1:0.5,1,2 --quadrature segment --needed-only", [17, 2, 1]),
    ] {
        folder.ok(&format!("occlusion {arguments} -o ao.nrrd"));
        let ambient = values(&written(&folder, "ao.nrrd", dims));
        assert!(ambient.iter().all(|a| *a == 1.0), "{arguments}: {ambient:?}");
    }
}

#[test]
fn raw_values_of_either_byte_order_mean_the_same_as_a_file_with_a_header() {
    let folder = Folder::with_device();
    let numbers: Vec<i16> = (0..6 * 5 * 4).map(|i| (i * 37 % 256 - 100) * 10).collect();
    let little: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
    let big: Vec<u8> = numbers.iter().flat_map(|n| n.to_be_bytes()).collect();
    folder
        .put("little.raw", &little)
        .put("big.raw", &big)
        .put("head.nrrd", nrrd("short", "6 5 4", "1 1 2.5", &little));
    let raw = "--dims 6,5,4 --type int16 --spacing 1,1,2.5";

    let mut of_header = folder.json("info head.nrrd");
    of_header["volume"] = Value::Null;
    for input in [format!("little.raw {raw}"), format!("big.raw {raw} --endian big")] {
        let mut of_raw = folder.json(&format!("info {input}"));
        of_raw["volume"] = Value::Null;
        assert_eq!(of_raw, of_header, "{input}");
    }
    assert_eq!(of_header["smallest"], *numbers.iter().min().unwrap() as f64);

    folder.ok("occlusion head.nrrd --radius-mm 2 -o header.nrrd");
    folder.ok(&format!("occlusion big.raw {raw} --endian big --radius-mm 2 -o raw.nrrd"));
    let [of_header, of_raw] =
        ["header.nrrd", "raw.nrrd"].map(|name| std::fs::read(folder.path(name)).unwrap());
    assert!(of_header == of_raw, "the same values from raw and NRRD give different files");
}

#[test]
fn verify_finds_no_difference_and_says_what_it_compared() {
    let folder = Folder::with_device();
    let text = folder.ok("verify builtin:fruit:24 --poses 1 --seed 3");
    let figure = |name: &str| -> f64 {
        let line =
            text.lines().find(|line| line.contains(name)).unwrap_or_else(|| panic!("no {name}: {text}"));
        let words = line.replace(name, "");
        words.split_whitespace().find_map(|word| word.parse().ok()).unwrap_or_else(|| panic!("{line}"))
    };
    assert!(figure("voxels compared") > 10_000.0, "{text}");
    assert_eq!(figure("voxels that differ"), 0.0, "{text}");
    assert_eq!(figure("largest difference"), 0.0, "{text}");
    let affected = figure("share affected");
    assert!(affected > 0.0 && affected <= 100.0, "{text}");
    let share = figure("share recomputed");
    assert!(share > 0.0 && share <= 100.0, "{text}");
    assert!(figure("points both eyes see") > 100.0, "{text}");
    assert_eq!(figure("points that differ"), 0.0, "{text}");

    folder.put("cube.obj", cube_obj(6));
    let flags = "--poses 2 --seed 8 --shapes cone,cube.obj --radius-mm 2 --rays 14w --quadrature cell";
    let answer = folder.json(&format!("verify builtin:engine:20x14x9:1,1,2 {flags}"));
    assert_eq!((&answer["exact"], &answer["seed"]), (&json!(true), &json!(8)));
    let report = &answer["volumes"][0];
    assert_eq!((report["clips"].as_array().map(Vec::len), &report["voxels_different"]), (Some(4), &json!(0)));
    assert!(report["voxels_compared"].as_u64() > Some(0), "{answer}");
    // Times are the only thing that a seed does not fix.
    let again = folder.json(&format!("verify builtin:engine:20x14x9:1,1,2 {flags}"));
    assert_eq!(without_times(again), without_times(answer));
}

#[test]
fn verify_of_nothing_is_no_success() {
    let folder = Folder::with_device();
    let run = folder.run("verify builtin:empty:12 --poses 1 --shapes box");
    assert_eq!(run.code, Some(1), "{}", run.err);
    assert!(run.out.contains("nothing to compare: no voxel of builtin:empty:12 has opacity"), "{}", run.out);
    assert!(!run.out.contains("exact: nothing differs"), "{}", run.out);
    let run = folder.run("verify builtin:empty:12 --poses 1 --shapes box --json");
    let answer: Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!((run.code, &answer["exact"], &answer["vacuous"]), (Some(1), &json!(false), &json!(true)));
}

/// The same answer without the fields that name milliseconds or times.
fn without_times(answer: Value) -> Value {
    match answer {
        Value::Array(list) => list.into_iter().map(without_times).collect(),
        Value::Object(fields) => {
            let timed = |key: &str| key.ends_with("_ms") || key.ends_with("_time");
            let kept = fields.into_iter().filter(|(key, _)| !timed(key));
            kept.map(|(key, value)| (key, without_times(value))).collect()
        }
        other => other,
    }
}

fn picture(folder: &Folder, name: &str) -> image::RgbImage {
    image::open(folder.path(name)).unwrap().into_rgb8()
}

#[test]
fn a_scene_is_drawn_for_both_eyes_side_by_side_and_one_by_one() {
    let folder = Folder::with_device();
    folder.put("cube.obj", cube_obj(6)).put(
        "scene.toml",
        "volume = \"builtin:engine:24\"\n\
         [[clip]]\nmesh = \"cube.obj\"\nscale = 5\ntranslate_mm = [5, -5, 5]\n\
         [occlusion]\nradius_mm = 3\n\
         [image]\nwidth = 40\nheight = 30\nbackground = \"#ff0000\"\n",
    );
    let answer = folder.json("render scene.toml -o stereo.png --eyes left.png,right.png");
    let [left, right, stereo] = ["left.png", "right.png", "stereo.png"].map(|name| picture(&folder, name));
    assert_eq!((left.dimensions(), right.dimensions(), stereo.dimensions()), ((40, 30), (40, 30), (80, 30)));
    for (x, y, pixel) in stereo.enumerate_pixels() {
        let of_eye = if x < 40 { left.get_pixel(x, y) } else { right.get_pixel(x - 40, y) };
        assert_eq!(pixel, of_eye, "{x} {y}");
    }
    assert_ne!(left, right, "the eyes see the same");
    assert_eq!(left.get_pixel(0, 0).0, [255, 0, 0], "the background");
    let drawn = left.pixels().filter(|p| p.0 != [255, 0, 0]).count();
    assert!(drawn > 200, "{drawn} pixels show the volume");

    assert_eq!(answer["files"], json!(["stereo.png", "left.png", "right.png"]));
    assert_eq!((&answer["image_size"], &answer["dims"]), (&json!([40, 30]), &json!([24, 24, 24])));
    assert!(answer["device"].is_string());
    let has_stages = |answer: &Value, stages: &[&str]| {
        for stage in stages {
            assert!(answer["stages_ms"][stage].as_f64().is_some_and(|ms| ms > 0.0), "{stage}: {answer}");
        }
    };
    has_stages(&answer, &["carve", "choose", "rays", "raycast"]);
    // A rule of the paper asks for the paper's method.
    for flags in ["--method cao", "--quadrature left"] {
        let answer = folder.json(&format!("render scene.toml {flags} -o cao.png"));
        has_stages(&answer, &["opacity", "classify", "contextual", "raycast"]);
        assert_eq!((&answer["method"], &answer["rays"]), (&json!("cao"), &json!("26")), "{flags}");
    }

    // Flags win over the scene; their clips join its clips.
    folder.ok("render scene.toml --size 20x10 --eyes l.png,r.png");
    assert_eq!(picture(&folder, "l.png").dimensions(), (20, 10));
    folder.ok("render scene.toml --clip plane --clip-mode keep --clip-translate 0,0,500 --eyes l.png,r.png");
    assert!(
        picture(&folder, "l.png").pixels().all(|p| p.0 == [255, 0, 0]),
        "the flag's clip hides everything"
    );
}

#[test]
fn volumes_are_drawn_with_flags_alone_also_negative_ones_and_the_smallest() {
    let folder = Folder::with_device();
    let small = "--size 24x24 --radius-mm 2";
    let look = "--azimuth -30 --elevation -10 --distance 60 --ipd 0";
    let clip = "--clip box --clip-translate -3,0,0 --clip-rotate -5,0,-90 --clip-scale 2";
    let text = folder.ok(&format!("render --eyes l.png,r.png builtin:fruit:12 {small} {look} {clip}"));
    for word in
        ["device", "volume", "method", "image", "raycast", "memory", "wrote     l.png", "wrote     r.png"]
    {
        assert!(text.contains(word), "{word} is not in\n{text}");
    }
    assert_eq!(picture(&folder, "l.png"), picture(&folder, "r.png"), "eyes in the same place");
    folder.ok(&format!(
        "render builtin:fruit:12 {small} --azimuth 150 --elevation -10 --distance 60 --ipd 0 {clip} -o b.png"
    ));
    folder.ok(&format!("render builtin:fruit:12 {small} {look} {clip} --shading phong -o s.png"));
    assert_eq!(folder.list(), ["b.png", "l.png", "r.png", "s.png"]);
    let solid = picture(&folder, "s.png");
    let light = |p: &image::RgbImage| p.pixels().map(|p| u32::from(p.0[1])).sum::<u32>();
    assert!(light(&solid) > light(&picture(&folder, "l.png")), "occlusion darkens");

    for (volume, clip) in [("builtin:voxel:1", ""), ("builtin:uniform:1x3x1", "--clip plane")] {
        folder.ok(&format!("render {volume} --size 8x8 {clip} -o tiny.png"));
        assert_eq!(picture(&folder, "tiny.png").dimensions(), (16, 8));
    }
}

/// What is visible fills the picture, also of what clips leave; the volume's box only for whom asks for it, or where nothing is.
#[test]
fn what_is_visible_is_framed_and_the_box_for_whom_asks() {
    let folder = Folder::with_device();
    let volume = "render builtin:fruit:32 --size 64x64 --shading phong";
    let rest = "--clip box --clip-mode keep --clip-scale 5 --clip-translate 8,0,0";
    // Columns of the left eye that show something.
    let width = |flags: &str| {
        folder.ok(&format!("{volume} {flags} --eyes l.png,r.png"));
        let picture = picture(&folder, "l.png");
        let ground = *picture.get_pixel(0, 0);
        (0..64).filter(|x| (0..64).any(|y| *picture.get_pixel(*x, y) != ground)).count()
    };
    let all = width("--azimuth 0 --elevation 0");
    let (left, in_box) =
        (width(&format!("{rest} --azimuth 0")), width(&format!("{rest} --azimuth 0 --fit box")));
    // 80 to 90 % of 64 pixels, and two that show less than one sees.
    assert!((51..=60).contains(&all) && (48..=60).contains(&left), "{all} {left}");
    // 10 of 32 mm.
    assert!((12..=26).contains(&in_box), "{in_box}");

    folder.put("box.toml", "volume = \"builtin:fruit:32\"\n[stereo]\nfit = \"box\"");
    folder.ok("render box.toml --size 64x64 --shading phong --eyes a.png,r.png");
    folder.ok(&format!("{volume} --fit box --eyes b.png,r.png"));
    folder.ok("render box.toml --size 64x64 --shading phong --fit visible --eyes c.png,r.png");
    folder.ok(&format!("{volume} --eyes d.png,r.png"));
    let [a, b, c, d] = ["a.png", "b.png", "c.png", "d.png"].map(|name| picture(&folder, name));
    assert!(a == b && c == d && a != c);

    let nothing = folder.run(&format!("{volume} --clip sphere --clip-scale 100 -o n.png"));
    assert_eq!(nothing.code, Some(0), "{}", nothing.err);
    assert!(
        nothing.err.contains("warning: nothing is visible") && nothing.err.contains("box"),
        "{}",
        nothing.err
    );
}

/// From a hundredth of an atom to the moon: the same numbers on another grid are the same picture, and verified alike.
#[test]
fn volumes_of_any_size_are_drawn_and_verified_alike() {
    let folder = Folder::with_device();
    let drawn = |unit: &str| {
        let lengths = format!(
            "--radius-mm 5{unit} --clip sphere --clip-scale 8{unit} --clip-translate 6{unit},-6{unit},6{unit}"
        );
        let volume = format!("builtin:engine:24:1{unit},1{unit},1.5{unit}");
        folder.ok(&format!("render {volume} {lengths} --size 40x40 -o near.png"));
        folder.ok(&format!("render {volume} {lengths} --size 40x40 --distance 70{unit} -o far.png"));
        ["near.png", "far.png"].map(|name| picture(&folder, name))
    };
    let ordinary = drawn("");
    // More of them: renderer::lengths.
    for unit in ["e-9", "e-3", "e8"] {
        for (found, expected) in drawn(unit).iter().zip(&ordinary) {
            let apart = found.as_raw().iter().zip(expected.as_raw()).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(apart <= Some(1), "{unit}: {apart:?} levels");
        }
    }
    assert!(ordinary[0].pixels().filter(|p| p.0[1] > 80).count() > 300, "much is seen");
    for unit in ["1e-9", "1e6"] {
        let answer =
            folder.json(&format!("verify builtin:fruit:24:{unit},{unit},{unit} --poses 2 --method all"));
        assert_eq!(answer["exact"], true, "{answer}");
    }
    // What f32 cannot place is refused, in shares of the volume.
    let run = folder.run("render builtin:engine:24:1e-6,1e-6,1e-6 --clip sphere --clip-scale 1000 -o s.png");
    assert_eq!(run.code, Some(1));
    assert!(run.err.contains("clip scale") && run.err.contains("in this volume"), "{}", run.err);
}

/// What is chosen is what is computed, within what the flags leave open, and both budgets refuse the impossible.
#[test]
fn a_budget_chooses_among_what_the_flags_leave_open_and_says_what_it_measured() {
    let folder = Folder::with_device();
    let scene = "occlusion builtin:engine:24 --radius-mm 5 --needed-only --clip sphere --clip-scale 8";
    for (limits, budget, tried) in [
        ("--method lao --rays 26w", "--budget-error 0.5", 3),
        ("--rays 14w --quadrature segment", "--budget-ms 1e5", 1),
        ("--method rays --quadrature hybrid", "--budget-error 0.5", 5),
    ] {
        let answer = folder.json(&format!("{scene} {limits} {budget} -o chosen.nrrd"));
        let planned = &answer["planned"];
        // More rays than keep the budget need not be tried.
        let found = planned["settings_tried"].as_u64().unwrap();
        assert!((1..=tried).contains(&found), "{limits}: {answer}");
        let number = |key: &str| planned[key].as_f64().unwrap();
        assert!(number("error") <= number("error_bound") && number("error_bound") < 0.5, "{answer}");
        assert!(
            number("foreseen_ms") > 0.0 && number("sample_bricks") <= number("needed_bricks"),
            "{answer}"
        );
        let [method, rays, rule] = ["method", "rays", "quadrature"].map(|key| answer[key].as_str().unwrap());
        for (flag, value) in limits.split_whitespace().zip(limits.split_whitespace().skip(1)).step_by(2) {
            assert_eq!(answer[flag.trim_start_matches('-')], value, "{answer}");
        }
        let chosen = format!("--method {method} --rays {rays} --quadrature {rule}");
        folder.json(&format!("{scene} {chosen} -o said.nrrd"));
        let [chosen, said] =
            ["chosen.nrrd", "said.nrrd"].map(|name| bits(&values(&written(&folder, name, [24; 3]))));
        assert!(chosen == said, "{limits}");
    }
    for (budget, parts) in [
        ("--budget-error 1e-9", ["error budget", "most accurate"]),
        ("--budget-ms 1e-9", ["time budget", "quickest"]),
    ] {
        let run = folder.run(&format!("render builtin:engine:16 --radius-mm 3 {budget} -o s.png"));
        assert_eq!(run.code, Some(1), "{}", run.err);
        assert!(
            parts.iter().all(|part| run.err.contains(part)) && run.err.contains("ask for"),
            "{}",
            run.err
        );
    }
    // People read the same.
    let text = folder.ok("render builtin:engine:16 --radius-mm 3 --budget-error 0.9 --size 8x8 -o s.png");
    assert!(text.contains("planned   method") && text.contains("settings tried on"), "{text}");
}

#[test]
fn devices_are_listed_with_their_number() {
    let folder = Folder::with_device();
    let text = folder.ok("devices");
    let answer = folder.json("devices");
    let devices = answer["devices"].as_array().unwrap();
    assert!(!devices.is_empty());
    for (i, device) in devices.iter().enumerate() {
        assert_eq!(device["index"], i);
        let line = format!("{i}  {}", device["name"].as_str().unwrap());
        assert!(text.lines().any(|l| l.starts_with(&line)), "{line} is not in\n{text}");
    }
    let run = folder.run("occlusion builtin:empty:4 -o ao.nrrd --device voodoo");
    assert!(run.code == Some(1) && run.err.contains("voodoo") && run.out.is_empty(), "{}", run.err);
    assert_eq!(folder.list(), [""; 0]);
}

#[test]
fn info_shows_header_range_and_histogram() {
    let folder = Folder::with_device();
    let data: Vec<u8> = (0..60).map(|i| if i < 45 { 10 } else { 250 }).collect();
    folder.put("two.nrrd", nrrd("uchar", "5 4 3", "0.5 1 2", &data));
    let text = folder.ok("info two.nrrd");
    for part in
        ["5 x 4 x 3 voxels of 0.5 x 1 x 2 mm, uint8", "2.5 x 4 x 6 mm", "10 ... 250", "75.000 %", "25.000 %"]
    {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
    let answer = folder.json("info two.nrrd");
    assert_eq!((&answer["dims"], &answer["type"]), (&json!([5, 4, 3]), &json!("uint8")));
    let bins: Vec<u64> =
        answer["histogram"].as_array().unwrap().iter().map(|b| b.as_u64().unwrap()).collect();
    assert_eq!((bins[0], bins[bins.len() - 1], bins.iter().sum::<u64>()), (45, 15, 60));
    // One value only: no range to divide by.
    assert!(folder.ok("info builtin:empty:3").contains("0 ... 0"));
}

#[test]
fn a_reader_that_leaves_is_no_failure() {
    let folder = Folder::with_device();
    for arguments in ["info builtin:engine:16", "--help"] {
        let arguments: Vec<_> = arguments.split_whitespace().collect();
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = folder.command(&arguments).stdout(writer).output().unwrap();
        assert_eq!(String::from_utf8_lossy(&output.stderr), "", "{arguments:?}");
        assert!(output.status.success(), "{arguments:?}: {}", output.status);
    }
}

#[test]
fn help_names_every_command_flag_and_default() {
    let folder = Folder::with_device();
    let help = folder.ok("--help");
    for word in ["render", "occlusion", "verify", "info", "devices", "builtin:", "Exit codes", "--json"] {
        assert!(help.contains(word), "{word} is not in\n{help}");
    }
    let shared = "--transfer --rays --quadrature --radius-mm --dims --type --spacing --json --device";
    let clips = "--method --clip --clip-mode --clip-translate --clip-rotate --clip-scale --output";
    let budgets = "--budget-error --budget-ms";
    for (command, flags) in [
        ("occlusion", format!("{shared} {clips} {budgets} --opacity-out --mask-out")),
        ("render", format!("{shared} {clips} {budgets} --eyes --size")),
        ("verify", format!("{shared} --poses --seed")),
    ] {
        let help = folder.ok(&format!("{command} --help"));
        for flag in flags.split_whitespace() {
            assert!(help.contains(&format!("{flag} ")), "{command}: {flag} is not in\n{help}");
        }
        assert!(help.contains("Examples:"), "{command}");
    }
}

#[test]
fn stability_writes_data_charts_and_one_page_with_all_of_them() {
    let folder = Folder::with_device();
    let answer = folder.json("stability --quick --only concave,anisotropy -o new/found");
    assert_eq!(answer["good"], true, "{answer}");
    let trials = answer["trials"].as_array().unwrap();
    assert_eq!(trials.len(), 2);
    let page = std::fs::read_to_string(folder.path("new/found/index.html")).unwrap();
    assert_eq!(page.matches("<svg").count(), 2);
    for trial in trials {
        let name = trial["name"].as_str().unwrap();
        assert_eq!((&trial["ours"], &trial["control_fails"]), (&"holds".into(), &true.into()), "{trial}");
        assert!(page.contains(trial["sentence"].as_str().unwrap()), "{name}");
        let file = |end: &str| std::fs::read(folder.path(&format!("new/found/{name}{end}"))).unwrap();
        assert!(file("-1.png").starts_with(b"\x89PNG"));
        assert!(String::from_utf8(file("-1.svg")).unwrap().contains("<svg"));
        assert!(String::from_utf8(file(".csv")).unwrap().lines().count() > 5);
    }
    let list = folder.ok("stability --list");
    assert_eq!(list.lines().count(), cao_measure::stability::TRIALS.len(), "{list}");
}

#[test]
fn examples_are_cubes_of_16_bits_and_an_index_that_says_what_they_are() {
    let folder = Folder::with_device();
    let made =
        "examples --builtin solids --volume builtin:engine:24 --edge 16 --count 3 --seed 5 --label mean";
    let answer = folder.json(&format!("{made} -o new/found"));
    assert_eq!((&answer["examples"], &answer["checked"]), (&3.into(), &1.into()), "{answer}");
    // As the generator's own test has it.
    assert!(answer["largest_rmse"]["mean"].as_f64().unwrap() < 0.05, "{answer}");
    let bytes = std::fs::read(folder.path("new/found/examples.u16")).unwrap();
    assert_eq!(bytes.len(), 3 * 3 * 16_usize.pow(3) * 2);
    let index = std::fs::read(folder.path("new/found/examples.json")).unwrap();
    let index: serde_json::Value = serde_json::from_slice(&index).unwrap();
    assert_eq!(index["cubes"], serde_json::json!(["opacity", "mean", "values"]));
    let sources: Vec<_> = index["examples"].as_array().unwrap().iter().map(|e| &e["source"]).collect();
    assert_eq!(sources, ["solids", "builtin:engine:24", "solids"]);
    // Where there is opacity it is darker than where there is none.
    let cube = |k: usize| {
        bytes[k * 8192..(k + 1) * 8192].chunks(2).map(|b| f64::from(u16::from_le_bytes([b[0], b[1]])))
    };
    let mean = |opaque: bool| {
        let chosen = cube(0).zip(cube(1)).filter(|(a, _)| (*a > 6000.0) == opaque).map(|(_, label)| label);
        let (sum, count) = chosen.fold((0.0, 0.0), |(sum, count), label| (sum + label, count + 1.0));
        sum / count
    };
    assert!(mean(true) < mean(false), "{} {}", mean(true), mean(false));
}

/// `verify` without a method proves the default and the paper's claim; `all` is the list.
#[test]
fn verify_reports_every_method_that_it_was_asked_for() {
    let folder = Folder::with_device();
    let methods = |flags: &str| -> Vec<String> {
        let answer = folder.json(&format!("verify builtin:fruit:16 --poses 1 --shapes sphere {flags}"));
        assert_eq!(answer["exact"], true, "{answer}");
        let reports = answer["volumes"].as_array().unwrap().iter();
        reports.map(|report| report["method"].as_str().unwrap().to_owned()).collect()
    };
    let listed: Vec<String> = cao_model::methods::Method::names().into_iter().map(str::to_owned).collect();
    assert_eq!(methods("--method all"), listed);
    for name in &listed {
        assert_eq!(methods(&format!("--method {name}")), [name.as_str()]);
    }
    let mut usual = methods("");
    usual.sort();
    let mut wanted = vec!["cao".to_owned(), cao_model::methods::Method::default().name().to_owned()];
    wanted.sort();
    assert_eq!(usual, wanted);
}

/// Most that a picture of 4096 x 4096 pixels an eye may take more than one of 64 x 64, bytes: a band's images and what reads them back,
/// which a software driver has in the processor's memory, its floats (32 MiB each) and its bytes, and room for allocators. In one piece
/// it took 2 GiB.
const BAND_BYTES: u64 = 160 << 20;

/// Most memory that the program ever had, bytes, as the system tells while it runs.
#[cfg(target_os = "linux")]
fn peak(folder: &Folder, line: &str) -> u64 {
    let arguments: Vec<_> = line.split_whitespace().collect();
    let mut program = folder.command(&arguments).stdout(std::process::Stdio::null()).spawn().unwrap();
    let mut most = 0;
    while program.try_wait().unwrap().is_none() {
        let status = std::fs::read_to_string(format!("/proc/{}/status", program.id())).unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<u64>().ok());
        most = most.max(kib.unwrap_or(0) * 1024);
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    assert!(program.wait().unwrap().success(), "{line}");
    most
}

#[test]
#[cfg(target_os = "linux")]
fn a_large_picture_takes_no_more_memory_than_a_band() {
    let folder = Folder::with_device();
    let [small, large] = ["64x64", "4096x4096"].map(|size| {
        peak(
            &folder,
            &format!("render builtin:empty:16 --radius-mm 2 --size {size} -o s.png --eyes l.png,r.png"),
        )
    });
    assert!(small > 0 && large < small + BAND_BYTES, "{small} and {large} bytes");
    let both = picture(&folder, "s.png");
    let eye = picture(&folder, "l.png");
    assert_eq!((both.dimensions(), eye.dimensions()), ((8192, 4096), (4096, 4096)));
}
