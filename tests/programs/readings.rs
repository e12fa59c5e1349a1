//! What files leave open and what is wrong with them, as the program's user meets it: warnings on standard error beside a whole answer,
//! `--frame-index`, `--nan`, and names that command a terminal.

use crate::support::{Folder, nrrd};
use cao_formats::read;

fn floats(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

#[test]
fn a_warning_is_a_line_of_its_own_and_the_answer_whole() {
    let folder = Folder::without_device();
    folder.put("long.nrrd", nrrd("uchar", "4 4 4", "1 1 1", &[7; 65]));
    for flags in ["", " --json"] {
        let run = folder.run(&format!("info long.nrrd{flags}"));
        assert_eq!(run.code, Some(0), "{}", run.err);
        assert_eq!(run.err, "warning: long.nrrd: data: 1 bytes after the 64 bytes of values, ignored\n");
        assert!(!run.out.contains("warning") && run.out.contains("long.nrrd"), "{}", run.out);
    }
    // A raw file has nothing else that tells whether its dimensions are right.
    folder.put("long.raw", [7; 65]);
    let run = folder.run("info long.raw --dims 4,4,4 --type uint8");
    assert!(run.code == Some(1) && run.err.contains("65 bytes, expected exactly 64 bytes"), "{}", run.err);
}

#[test]
fn a_volume_of_a_series_is_chosen_by_flag_or_scene() {
    let folder = Folder::without_device();
    let four = "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2 2 2 3\nkinds: domain domain domain time\nencoding: raw\n\n";
    let data: Vec<u8> = (0..24).collect();
    folder.put("series.nrrd", [four.as_bytes(), &data].concat());
    let run = folder.run("info series.nrrd");
    assert!(run.code == Some(1) && run.err.contains("a series of 3 volumes"), "{}", run.err);
    assert!(run.err.contains("--frame-index 0 … 2"), "{}", run.err);
    for frame in 0..3 {
        let answer = folder.json(&format!("info series.nrrd --frame-index {frame}"));
        assert_eq!(
            (&answer["smallest"], &answer["largest"]),
            (&(8.0 * frame as f64).into(), &(8.0 * frame as f64 + 7.0).into())
        );
    }
    let run = folder.run("info series.nrrd --frame-index 3");
    assert!(run.code == Some(1) && run.err.contains("3 volumes, 0 … 2"), "{}", run.err);
    let run = folder.run("info builtin:engine:8 --frame-index 1");
    assert!(run.code == Some(1) && run.err.contains("frame-index"), "{}", run.err);
    // The flag wins over the scene.
    folder.put("s.toml", "volume = { file = \"series.nrrd\", frame_index = 5 }");
    let run = folder.run("render s.toml -o s.png");
    assert!(run.code == Some(1) && run.err.contains("--frame-index 5 is not there"), "{}", run.err);
    let run = folder.run("render s.toml -o s.png --frame-index 7");
    assert!(run.code == Some(1) && run.err.contains("--frame-index 7 is not there"), "{}", run.err);
    folder.put("n.toml", "volume = { file = \"series.nrrd\", nan = \"opaque\" }");
    let run = folder.run("render n.toml -o s.png");
    assert!(
        run.code == Some(1) && run.err.contains("volume.nan") && run.err.contains("opaque"),
        "{}",
        run.err
    );
}

/// 6 × 5 × 4 values, some of them none.
fn with_nan() -> (Vec<f32>, Vec<usize>) {
    let mut values: Vec<f32> = (0..120).map(|i| 1000.0 + (i * 37 % 100) as f32).collect();
    let holes = vec![0, 31, 32, 33, 60, 119];
    for (at, none) in
        holes.iter().zip([f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, f32::MAX, f32::NAN])
    {
        values[*at] = none;
    }
    (values, holes)
}

#[test]
fn voxels_without_a_number_are_transparent_in_opacity_and_picture() {
    let folder = Folder::with_device();
    let (values, holes) = with_nan();
    folder.put("nan.nrrd", nrrd("float", "6 5 4", "1 1 1", &floats(values.iter().copied())));
    let run = folder.run("render nan.nrrd -o s.png --size 64x64");
    assert!(run.code == Some(1) && run.err.contains("--nan VALUE|transparent"), "{}", run.err);

    let answer = folder.json("info nan.nrrd --nan transparent");
    let counted: u64 = answer["histogram"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!((&answer["no_number"], counted), (&6.into(), 114));
    assert!(folder.ok("info nan.nrrd --nan transparent").contains("no number 6 voxels"));
    // The largest number for no data: the message speaks of the data and of what to do.
    let no_data = values.iter().map(|v| if v.is_nan() { f32::MAX } else { v.clamp(1000.0, f32::MAX) });
    folder.put("max.nrrd", nrrd("float", "6 5 4", "1 1 1", &floats(no_data)));
    let run = folder.run("render max.nrrd -o s.png");
    for part in ["max.nrrd", "preset \"auto\"", "the data run from 1000", "--nan VALUE|transparent"] {
        assert!(run.code == Some(1) && run.err.contains(part), "{part}: {}", run.err);
    }
    folder.ok("render max.nrrd --nan transparent -o s.png --size 16x16");

    // Opaque below, so that what is transparent is found above.
    folder.put("low.toml", "opacity = [[1000, 0.9], [1090, 0.3], [1095, 0.0]]\ncolour = \"#ffffff\"");
    folder.put("all.toml", "opacity = [[1000, 0.9], [1090, 0.3]]\ncolour = \"#ffffff\"");
    for transfer in ["auto", "mr", "ct-bone", "low.toml"] {
        folder.ok(&format!(
            "occlusion nan.nrrd --nan transparent --transfer {transfer} -o ao.nrrd --opacity-out vo.nrrd"
        ));
        let opacity = read(&folder.path("vo.nrrd")).unwrap();
        for &at in &holes {
            assert_eq!(opacity.value(at), 0.0, "{transfer}: voxel {at}");
        }
        assert!((0..120).any(|i| opacity.value(i) > 0.2), "{transfer}: nothing is seen");
    }
    for command in ["occlusion nan.nrrd -o ao2.nrrd", "render nan.nrrd -o s.png", "verify nan.nrrd --poses 1"]
    {
        let run = folder.run(&format!("{command} --nan transparent --transfer all.toml"));
        assert_eq!(run.code, Some(1), "{}", run.err);
        assert!(run.err.contains("nan.nrrd") && run.err.contains("no value of opacity 0"), "{}", run.err);
    }

    // The picture is that of the value that stands for them, however it is asked for.
    let lowest = values.iter().filter(|v| v.is_finite()).fold(f32::MAX, |a, b| a.min(*b));
    let filled = values.iter().enumerate().map(|(i, v)| if holes.contains(&i) { lowest } else { *v });
    folder.put("filled.nrrd", nrrd("float", "6 5 4", "1 1 1", &floats(filled)));
    folder.put("s.toml", "volume = { file = \"nan.nrrd\", nan = \"transparent\" }");
    let picture = |input: &str| {
        folder.ok(&format!("render {input} -o p.png --size 64x64"));
        std::fs::read(folder.path("p.png")).unwrap()
    };
    let expected = picture("filled.nrrd");
    for input in [
        "nan.nrrd --nan transparent".to_owned(),
        format!("nan.nrrd --nan {lowest}"),
        "s.toml".into(),
        format!("s.toml --nan {lowest}"),
    ] {
        assert_eq!(picture(&input), expected, "{input}");
    }
    assert_ne!(picture("nan.nrrd --nan 1090"), expected);
}

#[test]
fn no_name_or_word_of_a_file_commands_the_terminal() {
    let folder = Folder::without_device();
    let evil = "\u{1b}]0;pwned\u{7}\u{202e}";
    let name = format!("a{evil}.nrrd");
    folder.put(&name, nrrd("uchar", "4 4 4", "1 1 1", &[7; 65]));
    folder.put("word.nrrd", format!("NRRD0004\n{evil}: 3\n\n"));
    folder.put("scene.toml", format!("volume = {{ file = \"{}\" }}\n", "\\u001b[2J".repeat(9)));
    let evil_transfer = format!("--transfer={evil}");
    for arguments in [
        vec!["info", &name],
        vec!["info", &format!("{name}.gone")],
        vec!["info", "word.nrrd"],
        vec!["render", "scene.toml", "-o", "s.png"],
        vec!["render", "builtin:engine:8", "-o", "s.png", "--clip", &format!("{evil}.obj")],
        vec!["occlusion", "builtin:engine:8", "-o", "s.nrrd", &evil_transfer],
    ] {
        let output = folder.command(&arguments).output().unwrap();
        for stream in [output.stdout, output.stderr] {
            let text = String::from_utf8(stream).unwrap();
            let commands = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
            assert!(!text.contains(commands), "{arguments:?}: {text:?}");
        }
    }
}

#[test]
fn a_pipe_is_refused_without_waiting_wherever_a_file_is_named() {
    let folder = Folder::without_device();
    for name in ["p.nrrd", "p.toml", "p.obj", "p.json"] {
        assert!(std::process::Command::new("mkfifo").arg(folder.path(name)).status().unwrap().success());
    }
    for arguments in [
        "info p.nrrd",
        "info p.nrrd --dims 4,4,4 --type uint8",
        "info /dev/zero --dims 4,4,4 --type uint8",
        "render p.toml -o s.png",
        "occlusion builtin:engine:8 --transfer p.toml -o s.nrrd",
        "verify builtin:engine:8 --shapes p.obj",
        "render builtin:engine:8 --clip p.obj -o s.png",
        "chart builtin:engine:8 --peers p.json -o out",
    ] {
        let run = folder.run(arguments);
        assert!(
            run.code == Some(1) && run.err.contains("not a regular file but a"),
            "{arguments}: {}",
            run.err
        );
    }
}
