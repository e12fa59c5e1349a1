//! Features of scene files: label maps in every format on the volume's grid, names and colours of headers and tables, and what is refused.

use cao_formats::Scene;
use cao_formats::feature::FeatureSettings;
use cao_formats::label::segments;
use cao_model::feature::Features;
use cao_model::frame::Frame;
use cao_model::transfer::from_hex;
use cao_model::values::Values;
use cao_model::volume::{Space, Volume};
use std::fs;
use std::path::Path;

/// Labels of 3 × 2 × 2 voxels, x fastest, in patient order.
const LABELS: [u8; 12] = [0, 1, 1, 0, 2, 2, 3, 3, 0, 3, 1, 2];

/// The volume that they are of, as a file in patient order would give it.
fn volume() -> Volume {
    let volume =
        Volume::new([3, 2, 2], [1.0, 2.0, 0.5], Values::U8(LABELS.map(|l| 10 * l).to_vec())).unwrap();
    Volume { space: Space::Ras, origin: [-7.0, 3.0, 1.0], ..volume }
}

/// In the order of a file whose first two axes run to the left and to the back.
fn turned() -> Vec<u8> {
    let at = |i: usize| LABELS[(2 - i % 3) + 3 * (1 - i / 3 % 2) + 6 * (i / 6)];
    (0..12).map(at).collect()
}

fn nrrd(extra: &str, kind: &str, labels: &[u8]) -> String {
    let labels: Vec<String> = labels.iter().map(u8::to_string).collect();
    format!(
        "NRRD0004\ntype: {kind}\ndimension: 3\nsizes: 3 2 2\nspace: left-posterior-superior\n\
         space directions: (1,0,0) (0,2,0) (0,0,0.5)\nspace origin: (5,-5,1)\nencoding: ascii\n{extra}\n{}\n",
        labels.join(" ")
    )
}

const SEGMENTS: &str = "Segment0_ID:=Segment_1\nSegment0_Name:=skin\nSegment0_LabelValue:=1\nSegment0_Color:=1 0 0\n\
                        Segment1_Name:=left lung\nSegment1_LabelValue:=3\nSegment1_Color:=0 0 1\n";

fn nifti(code: i16, data: &[u8], slope: f32) -> Vec<u8> {
    let mut header = vec![0; 352];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348i32.to_le_bytes());
    for (i, n) in [3i16, 3, 2, 2, 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * i, &n.to_le_bytes());
    }
    for (i, mm) in [1.0f32, 1.0, 2.0, 0.5].into_iter().enumerate() {
        put(76 + 4 * i, &mm.to_le_bytes());
    }
    put(70, &code.to_le_bytes());
    put(72, &(8 * data.len() as i16 / 12).to_le_bytes());
    put(108, &352f32.to_le_bytes());
    put(112, &slope.to_le_bytes());
    put(254, &1i16.to_le_bytes());
    for (row, [scale, offset]) in [[1.0f32, -7.0], [2.0, 3.0], [0.5, 1.0]].into_iter().enumerate() {
        put(280 + 16 * row + 4 * row, &scale.to_le_bytes());
        put(280 + 16 * row + 12, &offset.to_le_bytes());
    }
    put(344, b"n+1\0");
    [header, data.to_vec()].concat()
}

fn meta(kind: &str, data: &[u8]) -> Vec<u8> {
    let header = format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n\
         Offset = 5 -5 1\nElementSpacing = 1 2 0.5\nDimSize = 3 2 2\nElementType = {kind}\nElementDataFile = LOCAL\n"
    );
    [header.into_bytes(), data.to_vec()].concat()
}

/// The features of a scene with this text after its label map, or what they are refused with.
fn features(folder: &Path, map: &str, text: &str) -> Result<Features, String> {
    let text = format!("volume = \"builtin:engine:8\"\nlabel = {map}\n{text}");
    let scene = Scene::from_toml(&text, folder).map_err(|error| error.to_string())?;
    scene.features.features(&volume(), Frame::Patient).map(|(f, _)| f).map_err(|error| error.to_string())
}

fn numbers(features: &Features) -> Vec<u8> {
    (0..12).map(|i| features.of(i, 0.0)).collect()
}

#[test]
fn a_label_map_of_every_format_and_order_is_that_of_its_volume() {
    let folder = tempfile::tempdir().unwrap();
    let words: Vec<u8> = LABELS.iter().flat_map(|l| i32::from(*l).to_le_bytes()).collect();
    let shorts: Vec<u8> = turned().iter().flat_map(|l| u16::from(*l).to_le_bytes()).collect();
    let files: [(&str, Vec<u8>); 4] = [
        ("a.nrrd", nrrd("", "int16", &turned()).replace("encoding", "endian: little\nencoding").into_bytes()),
        ("a.seg.nrrd", nrrd(SEGMENTS, "uint8", &turned()).into_bytes()),
        ("a.nii", nifti(8, &words, 0.0)),
        ("a.mha", meta("MET_USHORT", &shorts)),
    ];
    for (name, content) in files {
        fs::write(folder.path().join(name), content).unwrap();
        let found = features(folder.path(), &format!("\"{name}\""), "").unwrap();
        assert_eq!(numbers(&found), LABELS, "{name}");
        let names: Vec<&str> = found.list.iter().map(|f| f.name.as_str()).collect();
        let expected = if name == "a.seg.nrrd" {
            ["skin", "label 2", "left lung"]
        } else {
            ["label 1", "label 2", "label 3"]
        };
        assert_eq!(names, expected, "{name}");
    }
    // As they are stored, the orders of the two differ.
    let scene = "volume = \"builtin:engine:8\"\nlabel = \"a.nii\"";
    let settings = Scene::from_toml(scene, folder.path()).unwrap().features;
    assert!(settings.features(&volume(), Frame::Index).is_ok());
}

#[test]
fn names_and_colours_come_from_the_header_a_table_and_the_scene_in_this_order() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    put("a.seg.nrrd", &nrrd(SEGMENTS, "uint8", &turned()));
    put("names.txt", "# label name r g b a\n2 liver 0 255 0 51\n3 lung 255 255 0\n9 nobody 0 0 0\n");
    let header = segments(&folder.path().join("a.seg.nrrd")).unwrap();
    assert_eq!((header[&3].name.as_str(), header[&3].colour), ("left lung", Some([0.0, 0.0, 1.0])));
    let map = "{ file = \"a.seg.nrrd\", table = \"names.txt\" }";
    let found = features(folder.path(), map, "").unwrap();
    let told: Vec<_> = found.list.iter().map(|f| (f.name.as_str(), f.colour, f.scale)).collect();
    assert_eq!(
        told,
        [
            ("skin", Some([1.0, 0.0, 0.0]), 1.0),
            ("liver", Some([0.0, 1.0, 0.0]), 0.2),
            ("lung", Some([1.0, 1.0, 0.0]), 1.0)
        ]
    );
    // A feature by the name of its segment, one of several labels, and what they leave.
    let text = "[[feature]]\nname = \"skin\"\nvisible = false\ncolour = \"#102030\"\n\
                [[feature]]\nname = \"others\"\nlabels = \"rest\"\nspared = true\nopacity = 0.5\n";
    let found = features(folder.path(), map, text).unwrap();
    assert_eq!(numbers(&found), LABELS.map(|l| [0, 1, 2, 2][usize::from(l)]));
    assert_eq!((found.list[0].visible, found.list[0].colour), (false, Some(from_hex(0x10_20_30))));
    assert_eq!((found.list[1].spared, found.list[1].scale, found.list[1].colour), (true, 0.5, None));
    let text = "[[feature]]\nname = \"organs\"\nlabels = [3, 2]\n";
    let found = features(folder.path(), map, text).unwrap();
    assert_eq!(numbers(&found), LABELS.map(|l| [0, 2, 1, 1][usize::from(l)]));
    // The same keys in a file of their own.
    put("features.toml", &format!("label = {map}\n{text}"));
    let own = FeatureSettings::load(&folder.path().join("features.toml")).unwrap();
    assert_eq!(own.features(&volume(), Frame::Patient).unwrap().0, found);
}

#[test]
fn features_by_values_need_no_file() {
    let text = "volume = \"builtin:engine:8\"\n[[feature]]\nname = \"low\"\nvalues = [5, 20]\n[[feature]]\nname = \"high\"\nvalues = [20.0, inf]\n";
    let settings = Scene::from_toml(text, Path::new(".")).unwrap().features;
    let (found, _) = settings.features(&volume(), Frame::Patient).unwrap();
    assert_eq!([0.0, 5.0, 19.9, 20.0, 1e9].map(|value| found.of(0, value)), [0, 1, 1, 2, 2]);
}

#[test]
fn what_fits_no_volume_or_no_feature_is_refused_by_name_with_what_is_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, content: &[u8]| fs::write(folder.path().join(name), content).unwrap();
    let good = nrrd(SEGMENTS, "uint8", &turned());
    put("good.nrrd", good.as_bytes());
    put("many.nrrd", nrrd("", "uint8", &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 0, 0]).as_bytes());
    let other = |from: &str, to: &str| good.replace(from, to).into_bytes();
    put("dims.nrrd", &other("sizes: 3 2 2", "sizes: 3 2 1").into_iter().collect::<Vec<u8>>());
    put("spacing.nrrd", &other("(1,0,0)", "(1.1,0,0)"));
    put("origin.nrrd", &other("(5,-5,1)", "(5,-5,1.5)"));
    put("space.nrrd", &other("space: left-posterior-superior", "space dimension: 3"));
    put("float.nrrd", &other("type: uint8", "type: float\nendian: little"));
    put("scaled.nii", &nifti(2, &LABELS, 2.0));
    put("colour.nrrd", &other("Color:=1 0 0", "Color:=1 0"));
    put("bad.txt", b"1 skin 0 0 0\n2 liver red\n");
    let feature = |text: &str| format!("[[feature]]\n{text}\n");
    let named = |labels: &str| feature(&format!("name = \"a\"\nlabels = {labels}"));
    for (map, text, told) in [
        ("\"none.nrrd\"", String::new(), ["label", "there is no file"]),
        ("7", String::new(), ["label", "expected a file"]),
        ("\"dims.nrrd\"", String::new(), ["dims.nrrd: dims: 3 × 2 × 1", "volume's 3 × 2 × 2"]),
        ("\"spacing.nrrd\"", String::new(), ["spacing: 1.1", "volume's 1, 2, 0.5 mm"]),
        ("\"origin.nrrd\"", String::new(), ["origin: ", "volume's -7, 3, 1 mm"]),
        ("\"space.nrrd\"", String::new(), ["space: it states no patient frame", "volume's a patient frame"]),
        ("\"float.nrrd\"", String::new(), ["type: float32", "expected whole numbers, of type uint8"]),
        ("\"scaled.nii\"", String::new(), ["rescaled by 2", "expected whole numbers"]),
        ("\"colour.nrrd\"", String::new(), ["Segment0_Color", "three numbers from 0 to 1"]),
        (
            "{ file = \"good.nrrd\", table = \"bad.txt\" }",
            String::new(),
            ["bad.txt: line 2", "label name r g b"],
        ),
        ("\"many.nrrd\"", String::new(), ["10 labels (1, 2, 3", "at most 8"]),
        ("\"many.nrrd\"", named("[1]"), ["9 labels (2, 3", "labels = \\\"rest\\\""]),
        ("\"good.nrrd\"", named("[4]"), ["feature \"a\"", "has label 4; there are 1, 2, 3"]),
        ("\"good.nrrd\"", named("[0]"), ["feature \"a\"", "label 0"]),
        ("\"good.nrrd\"", named("[]"), ["feature[0].labels", "at least one"]),
        ("\"good.nrrd\"", named("1.5"), ["feature[0].labels", "whole numbers"]),
        ("\"good.nrrd\"", named("[1]") + &named("[2]"), ["feature \"a\"", "twice"]),
        (
            "\"good.nrrd\"",
            named("[1]") + &feature("name = \"b\"\nlabels = [2, 1]"),
            ["feature \"b\"", "belongs to feature \"a\" already"],
        ),
        (
            "\"good.nrrd\"",
            named("[1, 2, 3]") + &feature("name = \"b\"\nlabels = \"rest\""),
            ["feature \"b\"", "others have all"],
        ),
        ("\"good.nrrd\"", feature("name = \"bone\""), ["feature \"bone\"", "\"skin\", \"left lung\""]),
        (
            "\"good.nrrd\"",
            feature("name = \"a\"\nvalues = [1, 2]"),
            ["feature \"a\"", "values beside a label map"],
        ),
        ("\"good.nrrd\"", feature("labels = 1"), ["feature[0]", "no name"]),
        ("\"good.nrrd\"", feature("name = \"a\"\nlabels = 1\nshown = true"), ["feature[0]", "shown"]),
        ("\"good.nrrd\"", feature("name = \"skin\"\nopacity = -1"), ["feature \"skin\".opacity", "0 to 16"]),
        ("\"good.nrrd\"", feature("name = \"skin\"\ncolour = \"red\""), ["feature[0].colour", "#rrggbb"]),
    ] {
        let refused = features(folder.path(), map, &text).unwrap_err();
        let told = told.map(|told| told.replace("\\\"", "\""));
        assert!(told.iter().all(|told| refused.contains(told)), "{map} {text}: {refused}");
    }
    let without = "volume = \"builtin:engine:8\"\n[[feature]]\nname = \"a\"\n";
    let settings = Scene::from_toml(without, folder.path()).unwrap().features;
    let refused = settings.features(&volume(), Frame::Patient).unwrap_err().to_string();
    assert!(refused.contains("feature \"a\"") && refused.contains("--label FILE"), "{refused}");
}
