//! Features on the command line: what they show, write and print, and what is refused before a device is asked for.

use crate::support::{Folder, nrrd};
use cao_formats::read;

const VOXELS: usize = 12 * 10 * 8;

/// Everything opaque; the label of the upper half is 3, of the lower 1.
fn folder(folder: Folder) -> Folder {
    let labels: Vec<u8> = (0..VOXELS).map(|i| if i < VOXELS / 2 { 1 } else { 3 }).collect();
    folder.put("v.nrrd", nrrd("uchar", "12 10 8", "1 1 1", &[200; VOXELS]));
    folder.put("parts.nrrd", nrrd("uchar", "12 10 8", "1 1 1", &labels));
    folder.put("names.txt", "1 \"lower half\" 255 0 0\n3 upper 0 0 255\n");
    folder.put("t.toml", "opacity = [[100, 0.0], [150, 0.6]]\ncolour = \"#ffffff\"\n");
    folder.put("hide.toml", "label = { file = \"parts.nrrd\", table = \"names.txt\" }\n[[feature]]\nname = \"upper\"\nvisible = false\n");
    folder.put(
        "scene.toml",
        "volume = \"v.nrrd\"\ntransfer = \"t.toml\"\nlabel = \"parts.nrrd\"\n[[feature]]\nname = \"all\"\nlabels = [1, 3]\nspared = true\n\
         [image]\nwidth = 16\nheight = 16\n",
    );
    folder
}

#[test]
fn what_is_hidden_occludes_nothing_and_what_is_spared_is_not_clipped() {
    let folder = folder(Folder::with_device());
    let answer = folder.json("occlusion v.nrrd --transfer t.toml --features hide.toml --radius-mm 2 -o ao.nrrd --opacity-out vo.nrrd");
    let told: Vec<_> =
        answer["features"].as_array().unwrap().iter().map(|f| (&f["name"], &f["visible"])).collect();
    assert_eq!(
        format!("{told:?}"),
        r#"[(String("upper"), Bool(false)), (String("lower half"), Bool(true))]"#
    );
    let opacity = read(&folder.path("vo.nrrd")).unwrap();
    for i in 0..VOXELS {
        let expected = if i < VOXELS / 2 { 0.6 } else { 0.0 };
        assert!((opacity.value(i) - expected).abs() < 1e-6, "voxel {i}");
    }
    // A clip that hides everything leaves what is spared.
    let clip = "--clip sphere --clip-scale 99";
    let line = folder.ok(&format!("render scene.toml {clip} -o p.png"));
    assert!(line.contains("features  all spared"), "{line}");
    folder.ok(&format!(
        "occlusion v.nrrd --transfer t.toml --features scene.toml {clip} -o ao.nrrd --opacity-out vo.nrrd"
    ));
    let opacity = read(&folder.path("vo.nrrd")).unwrap();
    assert!((0..VOXELS).all(|i| (opacity.value(i) - 0.6).abs() < 1e-6));
    let line = folder
        .ok("verify v.nrrd --transfer t.toml --label parts.nrrd --shapes sphere --poses 1 --radius-mm 3");
    assert!(line.contains("exact: nothing differs"), "{line}");
}

#[test]
fn segments_are_told_and_what_does_not_fit_is_refused_without_a_device() {
    let folder = folder(Folder::without_device());
    let header = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 1 1 1\nencoding: ascii\nSegment0_Name:=rib\nSegment0_LabelValue:=4\n\n4\n";
    folder.put("a.seg.nrrd", header);
    let line = folder.ok("info a.seg.nrrd");
    assert!(line.contains("segment   4 rib"), "{line}");
    for (arguments, code, told) in [
        ("render v.nrrd --label none.nrrd -o p.png", 1, "none.nrrd"),
        (
            "render v.nrrd --label a.seg.nrrd -o p.png",
            1,
            "dims: 1 × 1 × 1 voxels; expected the volume's 12 × 10 × 8",
        ),
        ("render v.nrrd --label-table names.txt -o p.png", 2, "--label <FILE>"),
        (
            "render v.nrrd --features t.toml --label parts.nrrd --label-table t.toml -o p.png",
            1,
            "t.toml: line 1",
        ),
        ("occlusion v.nrrd --label parts.nrrd -o parts.nrrd", 2, "would replace an input"),
        (
            "occlusion v.nrrd --features hide.toml -o a.nrrd --mask-out parts.nrrd",
            2,
            "would replace an input",
        ),
        ("verify v.nrrd --features none.toml", 1, "none.toml"),
    ] {
        let before = folder.list();
        let run = folder.run(arguments);
        assert_eq!(run.code, Some(code), "{arguments}: {}", run.err);
        assert!(run.err.contains(told), "{arguments}: {}", run.err);
        assert_eq!(folder.list(), before);
    }
}
