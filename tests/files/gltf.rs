//! glTF files: known answers, and what is refused.

use std::fs;

use cao_formats::surface::load;
use cao_model::surface::{Instance, World};
use cao_testing::fuzz::{changed, changes, config};
use glam::{Vec2, Vec3};
use proptest::prelude::*;

use crate::surface::{assert_harmless, folder, refusal, rgba};

/// Cases of the test with files near valid ones: under a second.
const CASES: u32 = 200;

/// Metres are 1000 mm, and a turn in degrees of f32 has seven digits.
const ROUNDING: f32 = 1e-3;

/// Positions of a square in the xy plane, 4 × 12 bytes at 0; six indices of 16 bits at 48; texture coordinates as shares in 8 bits, four
/// bytes a corner, at 60; normals of 12 bytes at 76; sparse: an index at 124, a position at 128; in all 140.
fn bin() -> Vec<u8> {
    let mut bytes = Vec::new();
    let floats = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    bytes.extend(floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]));
    bytes.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    bytes.extend([0, 255, 9, 9, 255, 255, 9, 9, 255, 0, 9, 9, 0, 0, 9, 9]);
    bytes.extend(floats(&[0.0, 0.0, 1.0].repeat(4)));
    bytes.extend([2, 0, 0, 0]);
    bytes.extend(floats(&[3.0, 3.0, 0.5]));
    bytes
}

/// A square at four nodes: as it is; turned, scaled and moved below another; mirrored; and as a strip with a sparse corner.
const GLTF: &str = r#"{
"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 3, 4]}],
"nodes": [
 {"mesh": 0},
 {"translation": [0, 0, 2], "rotation": [0, 0, 0.70710678, 0.70710678], "children": [2]},
 {"mesh": 0, "scale": [2, 3, 1], "translation": [1, 0, 0]},
 {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
 {"mesh": 1, "name": "strip"}
],
"meshes": [
 {"name": "square", "primitives": [{"attributes": {"POSITION": 0, "NORMAL": 3, "TEXCOORD_0": 2}, "indices": 1, "material": 0}]},
 {"primitives": [{"attributes": {"POSITION": 4}, "mode": 5, "material": 1}, {"attributes": {"POSITION": 0}, "mode": 6}]}
],
"materials": [
 {"name": "leaf", "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
  "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.25, 0.75], "baseColorTexture": {"index": 0}}},
 {"alphaMode": "BLEND"}
],
"textures": [{"source": 0}], "images": [{"uri": "le%61f.png"}],
"accessors": [
 {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
 {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
 {"bufferView": 2, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC2"},
 {"bufferView": 3, "componentType": 5126, "count": 4, "type": "VEC3"},
 {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [3, 3, 1],
  "sparse": {"count": 1, "indices": {"bufferView": 4, "componentType": 5121}, "values": {"bufferView": 4, "byteOffset": 4}}}
],
"bufferViews": [
 {"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12},
 {"buffer": 0, "byteOffset": 60, "byteLength": 16, "byteStride": 4}, {"buffer": 0, "byteOffset": 76, "byteLength": 48},
 {"buffer": 0, "byteOffset": 124, "byteLength": 16}
],
"buffers": [{"uri": "a.bin", "byteLength": 140}]
}"#;

fn leaf() -> Vec<u8> {
    rgba([1, 1], &[[10, 20, 30, 200]])
}

fn files<'a>(gltf: &'a str, bin: &'a [u8], leaf: &'a [u8]) -> [(&'static str, &'a [u8]); 3] {
    [("a.gltf", gltf.as_bytes()), ("a.bin", bin), ("leaf.png", leaf)]
}

/// The file with its buffer and image inside, as base64 or as a binary file.
fn base64(bytes: &[u8]) -> String {
    let letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group =
        |three: &[u8]| {
            let word = (0..3).fold(0_u32, |sum, i| sum << 8 | u32::from(*three.get(i).unwrap_or(&0)));
            (0..4)
                .map(|i| {
                    if i <= three.len() { letters[(word >> (18 - 6 * i) & 63) as usize] as char } else { '=' }
                })
                .collect::<String>()
        };
    bytes.chunks(3).map(group).collect()
}

fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
    let padded = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (json, bin) = (padded(json.as_bytes(), b' '), padded(bin, 0));
    let length = |bytes: &[u8]| (bytes.len() as u32).to_le_bytes();
    let chunks = [&length(&json)[..], b"JSON", &json, &length(&bin), b"BIN\0", &bin].concat();
    [&b"glTF"[..], &2_u32.to_le_bytes(), &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
}

fn assert_known(instances: &[Instance]) {
    let world = World::new(instances).unwrap();
    assert_eq!((instances.len(), world.triangles.len(), world.degenerate), (4, 2 + 2 + 2 + 2 + 2, 0));
    let near = |found: Vec3, expected: [f32; 3]| {
        assert!((found - Vec3::from_array(expected)).length() < ROUNDING, "{found}, not {expected:?}");
    };
    let corners = |t: usize| world.triangles[t].corners;
    // y up in metres became z up in mm: the square stands, and faces −y.
    near(corners(0)[1], [1000.0, 0.0, 0.0]);
    near(corners(0)[2], [1000.0, 0.0, 1000.0]);
    near(world.triangles[0].normals[0], [0.0, -1.0, 0.0]);
    assert_eq!(world.triangles[0].uvs, [Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(1.0, 0.0)]);
    // (1, 1, 0): twice and thrice as large, moved to (3, 3, 0); a quarter turn about their z (−3, 3, 0), moved by 2 along z.
    near(corners(2)[2], [-3000.0, -2000.0, 3000.0]);
    near(world.triangles[2].normals[0], [0.0, -1.0, 0.0]);
    // Mirrored, and yet with its front to −y.
    for triangle in &world.triangles[4..6] {
        let [a, b, c] = triangle.corners;
        near((b - a).cross(c - a).normalize(), [0.0, -1.0, 0.0]);
        near(triangle.normals[0], [0.0, -1.0, 0.0]);
    }
    assert!(corners(4).iter().any(|corner| (*corner - Vec3::new(-1000.0, 0.0, 1000.0)).length() < ROUNDING));
    // 0 1 2, then 2 1 3 or a turn of it, whose third corner is sparse.
    near(corners(6)[2], [3000.0, -500.0, 3000.0]);
    let second = corners(7).map(|corner| (corner * 1e-3).round().to_array().map(|v| v as i32));
    assert_eq!(
        second,
        [[1, 0, 0], [0, 0, 1], [3, -1, 3]].map(|[x, y, z]: [i32; 3]| [x, y, z]),
        "{:?}",
        corners(7)
    );
    // A fan begins at its first corner.
    near(corners(9)[2], [0.0; 3]);
    assert!(std::sync::Arc::ptr_eq(&instances[0].surface, &instances[1].surface), "instances of one mesh");
    let leaf = &instances[0].surface.materials[0];
    assert_eq!((leaf.name.as_str(), leaf.colour, leaf.alpha), ("leaf", [1.0, 0.5, 0.25], 0.75));
    assert_eq!((leaf.cutoff, leaf.two_sided), (Some(0.25), true));
    assert_eq!(leaf.texture.as_ref().unwrap().texels, [[10, 20, 30, 200]]);
    let [blend, none] = &instances[3].surface.materials[..] else { panic!("two primitives") };
    assert_eq!((blend.name.as_str(), blend.cutoff, blend.two_sided), ("material 1", Some(0.5), false));
    assert_eq!((none.colour, none.cutoff), ([1.0; 3], None));
}

#[test]
fn a_gltf_file_is_what_it_says_whatever_holds_its_bytes() {
    let (bin, leaf) = (bin(), leaf());
    let beside = folder(&files(GLTF, &bin, &leaf));
    let instances = load(&beside.path().join("a.gltf")).unwrap_or_else(|e| panic!("{e}"));
    assert_known(&instances);
    assert!(
        instances[0].surface.name.ends_with("a.gltf, mesh 0 \"square\""),
        "{}",
        instances[0].surface.name
    );
    let image = format!("data:image/png;base64,{}", base64(&leaf));
    let inside = GLTF.replace("le%61f.png", &image);
    let data = inside.replace("a.bin", &format!("data:application/octet-stream;base64,{}", base64(&bin)));
    let binary = glb(&inside.replace("\"uri\": \"a.bin\", ", ""), &bin);
    let folder = folder(&[("a.gltf", data.as_bytes()), ("a.GLB", &binary)]);
    for name in ["a.gltf", "a.GLB"] {
        assert_known(&load(&folder.path().join(name)).unwrap_or_else(|e| panic!("{e}")));
    }
}

#[test]
fn wrong_gltf_files_are_refused_with_file_and_part() {
    let (bin, leaf) = (bin(), leaf());
    for (from, to, expected) in [
        ("\"2.0\"},", "\"2.0\"}", "a.gltf: glTF: "),
        ("\"scene\": 0, \"scenes\": [{\"nodes\": [0, 1, 3, 4]}],", "", "a.gltf: scenes: has none"),
        ("[0, 1, 3, 4]", "[1]", "is accepted"),
        ("[0, 1, 3, 4]", "[]", "a.gltf: scene 0: has no meshes"),
        ("[0, 1, 3, 4]", "[7]", "Index out of bounds"),
        ("[0, 1, 3, 4]", "[0, 0]", "a.gltf: node 0: is a child twice, or of itself"),
        ("\"children\": [2]", "\"children\": [1]", "a.gltf: node 1: is a child twice, or of itself"),
        (
            "[0, 0, 0.70710678, 0.70710678]",
            "[0, 0, 0, 0]",
            "a.gltf: node 1: turns by a rotation that is none",
        ),
        ("[-1, 0, 0, 0,", "[1e39, 0, 0, 0,", "a.gltf: "),
        ("\"mode\": 5", "\"mode\": 1", "a.gltf: mesh 1, primitive 0: of mode Lines; expected triangles"),
        ("\"mode\": 5", "\"mode\": 9", "a.gltf: meshes[1].primitives[0].mode: "),
        ("\"attributes\": {\"POSITION\": 4}", "\"attributes\": {\"NORMAL\": 4}", "a.gltf: mesh"),
        ("{\"POSITION\": 4}", "{\"POSITION\": 5}", "a.gltf: mesh 1: names a POSITION that is not there"),
        (
            "\"NORMAL\": 3",
            "\"NORMAL\": 9",
            "a.gltf: meshes[0].primitives[0].attributes[\"NORMAL\"]: Index out of bounds",
        ),
        ("\"NORMAL\": 3", "\"NORMAL\": 2", "a.gltf: accessor 2: has 2 numbers at a place, expected 3"),
        (
            ", \"TEXCOORD_0\": 2",
            "",
            "mesh 0, primitive 0: without TEXCOORD_0, and material \"leaf\" has a texture",
        ),
        ("\"count\": 6", "\"count\": 7", "a.gltf: accessor 1: reaches beyond its bufferView"),
        ("\"count\": 6", "\"count\": 18446744073709551615", "primitive 0: more than 201326592 corners"),
        ("\"count\": 6", "\"count\": 2", "mesh 0, primitive 0: has no triangle"),
        (
            "\"componentType\": 5123, \"count\": 6",
            "\"componentType\": 5126, \"count\": 3",
            "accessor 1: expected indices",
        ),
        (
            "\"byteOffset\": 48, \"byteLength\": 12",
            "\"byteOffset\": 130, \"byteLength\": 12",
            "bufferView 1: reaches beyond its buffer",
        ),
        (
            "\"byteOffset\": 48,",
            "\"byteOffset\": 60,",
            "mesh 0, primitive 0: names vertex 65280, but there are only 4",
        ),
        ("\"byteLength\": 140", "\"byteLength\": 141", "a.gltf: buffer 0: of 141 bytes, but there are 140"),
        ("\"byteOffset\": 4}", "\"byteOffset\": 5}", "a.gltf: accessor 4: reaches beyond its bufferView"),
        (
            "{\"bufferView\": 4, \"componentType\": 5121}",
            "{\"bufferView\": 3, \"byteOffset\": 10, \"componentType\": 5121}",
            "accessor 4: puts a sparse value where there is no place",
        ),
        (
            "{\"bufferView\": 0, \"componentType\": 5126, \"count\": 4, \"type\": \"VEC3\", \"min\": [0, 0, 0], \"max\": [3, 3, 1],",
            "{\"componentType\": 5126, \"count\": 99999, \"type\": \"VEC3\", \"min\": [0, 0, 0], \"max\": [3, 3, 1],",
            "accessor 4: has no bufferView and too many places",
        ),
        ("a.bin", "gone.bin", "cannot access "),
        ("a.bin", "https://example.org/a.bin", "buffer 0: \"https://example.org/a.bin\": nothing is fetched"),
        ("a.bin", "data:text/plain,abc", "buffer 0: \"data:text/plain,abc\": data that is not base64"),
        ("a.bin", "data:;base64,a_b", "damaged base64"),
        ("a.bin", "a%2.bin", "\"a%2.bin\": expected %XX"),
        ("\"uri\": \"a.bin\", ", "", "buffer 0: has no uri, and the file no binary part"),
        ("le%61f.png", "gone.png", "a.gltf: material 0, image 0: there is no file "),
        ("le%61f.png", "a.bin", "a.gltf: material 0, image 0: "),
        (
            "[1, 0.5, 0.25, 0.75]",
            "[1, 0.5, 0.25, 2]",
            "material 0: baseColorFactor [1.0, 0.5, 0.25, 2.0], expected",
        ),
        ("\"alphaCutoff\": 0.25", "\"alphaCutoff\": -1", "material 0: alphaCutoff -1, expected"),
        (
            "\"scene\": 0",
            "\"extensionsRequired\": [\"KHR_draco_mesh_compression\"], \"scene\": 0",
            "\"KHR_draco_mesh_compression\", which is not read; export without it",
        ),
        ("\"scene\": 0", "\"extensionsRequired\": [\"KHR_materials_ior\"], \"scene\": 0", "is accepted"),
    ] {
        assert!(GLTF.contains(from), "{from}");
        let text = GLTF.replacen(from, to, 1);
        let said = refusal(&files(&text, &bin, &leaf));
        assert!(said.contains(expected), "{to}: {said}\n not {expected}");
    }
    let mut nan = bin.clone();
    nan[0..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let said = refusal(&files(GLTF, &nan, &leaf));
    assert!(said.contains("a.gltf, mesh 0 \"square\": triangle 0 has a vertex at (NaN,"), "{said}");
    let said = refusal(&files(GLTF, &bin, b"\xff\xd8\xff\xe0"));
    assert!(said.contains("leaf.png is JPEG, not PNG; convert it to PNG"), "{said}");
    let whole = glb(GLTF, &bin);
    for length in [4, 11, 12, 19, 200] {
        let said = refusal(&[("a.glb", &whole[..length])]);
        assert!(said.contains("a.glb: "), "{length}: {said}");
    }
    let mut short = whole;
    short[8..12].copy_from_slice(&3_u32.to_le_bytes());
    let said = refusal(&[("a.glb", &short)]);
    assert!(said.contains("a.glb: header: expected 12 bytes and a length of at least as many"), "{said}");
}

proptest! {
    #![proptest_config(config(CASES))]

    #[test]
    fn gltf_files_are_read_or_refused(which in 0..4_usize, changes in changes()) {
        let (bin, leaf) = (bin(), leaf());
        let folder = folder(&files(GLTF, &bin, &leaf));
        let binary = glb(&GLTF.replace("\"uri\": \"a.bin\", ", ""), &bin);
        let (name, whole) = [("a.gltf", GLTF.as_bytes()), ("a.bin", &bin), ("leaf.png", &leaf), ("a.glb", &binary)][which];
        fs::write(folder.path().join(name), changed(whole, &changes)).unwrap();
        assert_harmless(&folder.path().join(if which == 3 { "a.glb" } else { "a.gltf" }))?;
    }
}
