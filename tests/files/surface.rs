//! Surfaces: what comes out of files of meshes with materials, and what is refused.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use cao_formats::surface::load;
use cao_model::surface::{Instance, Material, Surface, World};
use cao_testing::fuzz::{changed, changes, config};
use glam::{Vec2, Vec3};
use proptest::prelude::*;

/// Cases of the test with files near valid ones: under two seconds.
const CASES: u32 = 200;

/// A PNG of these pixels.
pub fn png(
    size: [u32; 2],
    colour: png::ColorType,
    depth: png::BitDepth,
    palette: &[u8],
    bytes: &[u8],
) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, size[0], size[1]);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    if !palette.is_empty() {
        encoder.set_palette(palette.to_vec());
        // The first of it is half there.
        encoder.set_trns(vec![128]);
    }
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
    file
}

pub fn rgba(size: [u32; 2], texels: &[[u8; 4]]) -> Vec<u8> {
    png(size, png::ColorType::Rgba, png::BitDepth::Eight, &[], texels.as_flattened())
}

/// A folder with these files.
pub fn folder(files: &[(&str, &[u8])]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    folder
}

/// The refusal of the first of these files.
pub fn refusal(files: &[(&str, &[u8])]) -> String {
    let folder = folder(files);
    match load(&folder.path().join(files[0].0)) {
        Ok(instances) => {
            World::new(&instances).map(|_| "is accepted".into()).unwrap_or_else(|e| e.to_string())
        }
        Err(error) => error.to_string(),
    }
}

/// The one surface of an OBJ file beside others.
fn surface(files: &[(&str, &[u8])]) -> Arc<Surface> {
    let folder = folder(files);
    let instances = load(&folder.path().join(files[0].0)).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(instances.len(), 1);
    World::new(&instances).unwrap();
    instances[0].surface.clone()
}

/// A tetrahedron, outward; a quad of which only the front is textured; a material of each kind.
const OBJ: &str = "mtllib of things.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1 # comment\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n\
                   v 10 0 0 2\nv 6 0 0\nv 6 1 0\nv 5 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1 0.5\nvn 0 0 3\nvn 0 0.6 0.8\n\
                   o sheet\nusemtl the leaf\nf -4/1/1 -3/2/1 -2/3/2 \\\n -1/4/-1\ng more\nusemtl red\nf 5 6 7\nl 1 2\np 3\n";
const MTL: &str = "# made by hand\nnewmtl the leaf\n\tKd 1 0.5 0.25\nmap_Kd leaf.png\nmap_d mask.png\nillum 2\n\nnewmtl red\nKd 1 0 0\nNs 250\n";

fn leaf() -> Vec<u8> {
    rgba([2, 1], &[[10, 20, 30, 255], [40, 50, 60, 255]])
}

fn mask() -> Vec<u8> {
    png([2, 1], png::ColorType::Grayscale, png::BitDepth::Eight, &[], &[255, 0])
}

fn things<'a>(leaf: &'a [u8], mask: &'a [u8]) -> [(&'static str, &'a [u8]); 4] {
    [("a.obj", OBJ.as_bytes()), ("of things.mtl", MTL.as_bytes()), ("leaf.png", leaf), ("mask.png", mask)]
}

#[test]
fn an_obj_file_is_what_its_lines_say() {
    let found = surface(&things(&leaf(), &mask()));
    assert!(found.name.ends_with("a.obj"), "{}", found.name);
    assert_eq!(found.triangles.len(), 4 + 2 + 1);
    assert_eq!(found.material_of, [0, 0, 0, 0, 1, 1, 2]);
    let corners = |t: usize| found.triangles[t].map(|c| found.positions[c as usize]);
    assert_eq!(corners(1), [Vec3::ZERO, Vec3::X, Vec3::Z]);
    // The weight 2 halves the position.
    assert_eq!(corners(6), [5.0 * Vec3::X, 6.0 * Vec3::X, Vec3::new(6.0, 1.0, 0.0)]);
    // Both triangles of the quad, whichever diagonal cuts it: each corner with its own, (0, 0) at the upper left.
    let mut seen = Vec::new();
    for &corner in found.triangles[4..6].as_flattened() {
        let [at, uv, normal] = [
            found.positions[corner as usize],
            found.uvs[corner as usize].extend(0.0),
            found.normals[corner as usize],
        ];
        let lower = at.y == 0.0;
        assert_eq!(uv, Vec2::new(at.x - 5.0, if lower { 1.0 } else { 0.0 }).extend(0.0), "{at}");
        let expected = if lower { Vec3::Z } else { Vec3::new(0.0, 0.6, 0.8) };
        assert!((normal - expected).length() < 1e-6, "{at}: {normal}");
        seen.push(at);
    }
    assert_eq!(seen.len(), 6);
    // What has no normal has its triangle's own, in a world.
    assert_eq!(found.normals[found.triangles[0][0] as usize], Vec3::ZERO);
    let [default, leaf, red] = &found.materials[..] else { panic!("{:?}", found.materials) };
    assert_eq!((default.name.as_str(), default.colour, default.cutoff), ("default", [0.8; 3], None));
    assert_eq!((leaf.name.as_str(), leaf.colour, leaf.alpha), ("the leaf", [1.0, 0.5, 0.25], 1.0));
    assert_eq!((leaf.cutoff, leaf.two_sided), (Some(0.5), true));
    let texture = leaf.texture.as_ref().unwrap();
    assert_eq!((texture.size, &texture.texels[..]), ([2, 1], &[[10, 20, 30, 255], [40, 50, 60, 0]][..]));
    assert_eq!((red.colour, red.texture.is_none(), red.cutoff), ([1.0, 0.0, 0.0], true, None));
}

/// The solid keeps one side beside a sheet with a mask; a sheet without one leaves nothing closed.
#[test]
fn what_has_no_inside_has_two_sides() {
    let sides = |text: &str, mtl: &str| {
        let found = surface(&[("a.obj", text.as_bytes()), ("a.mtl", mtl.as_bytes()), ("m.png", &mask())]);
        found.materials.iter().map(|m| m.two_sided).collect::<Vec<_>>()
    };
    let tetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    assert_eq!(sides(tetrahedron, ""), [false]);
    assert_eq!(sides(&tetrahedron.replace("f 1 4 3\n", ""), ""), [true]);
    let sheet = format!("mtllib a.mtl\n{tetrahedron}vt 0 0\nvt 1 1\nusemtl m\nf 1/1 2/1 3/2\n");
    assert_eq!(sides(&sheet, "newmtl m\nmap_d m.png\n"), [false, true]);
    assert_eq!(sides(&sheet, "newmtl m\n"), [true, true]);
}

#[test]
fn opacities_are_read_from_every_key() {
    let text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";
    let material = |mtl: &str| {
        let masked = rgba([1, 1], &[[200, 100, 0, 90]]);
        let files = [("a.obj", text.as_bytes()), ("a.mtl", mtl.as_bytes()), ("m.png", &masked[..])];
        surface(&files).materials[0].clone()
    };
    let of = |m: &Material| (m.colour, m.alpha, m.cutoff, m.texture.as_ref().map(|t| t.texels[0]));
    assert_eq!(of(&material("newmtl m\n")), ([0.8; 3], 1.0, None, None));
    assert_eq!(of(&material("newmtl m\nd 0.25\nKd 0.5\n")), ([0.5; 3], 0.25, Some(0.5), None));
    assert_eq!(of(&material("newmtl m\nTr 0.25\n")), ([0.8; 3], 0.75, Some(0.5), None));
    // Colours alone are no mask; a mask alone is white, and its opacity is its alpha where it has any.
    assert_eq!(of(&material("newmtl m\nmap_Kd m.png\n")), ([1.0; 3], 1.0, None, Some([200, 100, 0, 90])));
    assert_eq!(
        of(&material("newmtl m\nmap_d m.png\n")),
        ([1.0; 3], 1.0, Some(0.5), Some([255, 255, 255, 90]))
    );
}

#[test]
fn textures_of_every_kind_are_read() {
    use png::{BitDepth, ColorType};
    for (what, image, expected) in [
        (
            "grey 1",
            png([2, 1], ColorType::Grayscale, BitDepth::One, &[], &[0b0100_0000]),
            [[0, 0, 0, 255], [255; 4]],
        ),
        (
            "grey 16",
            png([2, 1], ColorType::Grayscale, BitDepth::Sixteen, &[], &[9, 99, 7, 0]),
            [[9, 9, 9, 255], [7, 7, 7, 255]],
        ),
        (
            "grey alpha",
            png([2, 1], ColorType::GrayscaleAlpha, BitDepth::Eight, &[], &[1, 2, 3, 4]),
            [[1, 1, 1, 2], [3, 3, 3, 4]],
        ),
        (
            "rgb",
            png([2, 1], ColorType::Rgb, BitDepth::Eight, &[], &[1, 2, 3, 4, 5, 6]),
            [[1, 2, 3, 255], [4, 5, 6, 255]],
        ),
        (
            "palette",
            png([2, 1], ColorType::Indexed, BitDepth::Eight, &[1, 2, 3, 4, 5, 6], &[1, 0]),
            [[4, 5, 6, 255], [1, 2, 3, 128]],
        ),
        ("rgba", rgba([2, 1], &[[1, 2, 3, 4], [5, 6, 7, 8]]), [[1, 2, 3, 4], [5, 6, 7, 8]]),
    ] {
        let found = surface(&things(&image, &mask()));
        let texels: Vec<_> = found.materials[1].texture.as_ref().unwrap().texels.clone();
        // The mask puts its own opacities.
        let expected =
            [255, 0].iter().zip(expected).map(|(a, [r, g, b, _])| [r, g, b, *a]).collect::<Vec<_>>();
        assert_eq!(texels, expected, "{what}");
    }
}

#[test]
fn a_library_that_is_not_there_leaves_the_default_and_one_without_the_material_is_refused() {
    let found = surface(&[("a.obj", OBJ.as_bytes())]);
    let names: Vec<_> = found.materials.iter().map(|m| (m.name.as_str(), m.colour)).collect();
    assert_eq!(names, [("default", [0.8; 3]), ("the leaf", [0.8; 3]), ("red", [0.8; 3])]);
    let said = refusal(&[("a.obj", OBJ.as_bytes()), ("of things.mtl", b"newmtl blue\n")]);
    assert!(
        said.ends_with(
            "a.obj: line 21: usemtl: \"the leaf\": no library of materials has it; expected one of its newmtl"
        ),
        "{said}"
    );
}

#[test]
fn wrong_obj_files_are_refused_with_file_and_line() {
    let v = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let huge = "v 3e38 0 0\nv -3e38 0 0\nv 0 3e38 0\nf 1 2 3\n";
    for (text, expected) in [
        ("", "has no triangles"),
        (v, "has no triangles"),
        ("\u{0}\u{1}binary\n\u{7f}", "has no triangles"),
        (&format!("{v}f 1 1 2\nf 3 3 3\n"), "all of its 2 triangles have no area"),
        (huge, "beyond what numbers hold"),
        ("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "vertex at (0, NaN, 0); coordinates must be finite"),
        ("v 0 0 0\nv 1 0 0\nv 0 1e39 0\nf 1 2 3\n", "coordinates must be finite"),
        (&format!("{v}f 1 2 4\n"), "a.obj: f: a face names a vertex that is not there"),
        (&format!("{v}f 1/7 2/7 3/7\n"), "a.obj: f: a face names a texture coordinate that is not there"),
        (&format!("{v}f 1//2 2//2 3//2\n"), "a.obj: f: a face names a normal that is not there"),
        (&format!("{v}f 1 2 0\n"), "line 4: f: \"0\": expected v, v/vt"),
        (&format!("{v}f 1 2 -4\n"), "line 4: f: \"-4\": expected"),
        (&format!("{v}f 1 2 3/-1\n"), "line 4: f: \"3/-1\": expected"),
        (&format!("{v}f 1 2 3/9223372036854775807\n"), "line 4: f: \"3/9223372036854775807\": expected"),
        (&format!("{v}f 1 2 3/1/1/1\n"), "line 4: f: \"3/1/1/1\": expected"),
        (&format!("{v}f /1 2 3\n"), "line 4: f: \"/1\": expected"),
        (&format!("{v}f\n"), "line 4: f: a face without corners"),
        ("# hi\n\nv 0 0\nv 1 0 0\n", "line 3: position parse error: \"v 0 0\""),
        (&format!("{v}vt x\n"), "line 4: texcoord parse error: \"vt x\""),
        (&format!("{v}vn 1 2\n"), "line 4: normal parse error: \"vn 1 2\""),
        ("v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 2 0\nf 1 2 3 4\n", "line 5: f: the face crosses itself"),
    ] {
        let said = refusal(&[("a.obj", text.as_bytes())]);
        assert!(said.contains("a.obj: ") && said.contains(expected), "{text:?}: {said}");
    }
    let said = refusal(&[("a.stl", b"solid")]);
    assert!(said.ends_with("a.stl: name: is no mesh that is read; expected .obj, .gltf or .glb, or another format converted to it"), "{said}");
    for name in ["a.obj", "a.gltf", "a.glb"] {
        let folder = folder(&[]);
        let long = folder.path().join(name);
        fs::File::create(&long).unwrap().set_len((256 << 20) + 1).unwrap();
        let said = load(&long).unwrap_err().to_string();
        assert!(
            said.ends_with(&format!("{name}: size: 268435457 bytes, expected at most 268435456")),
            "{said}"
        );
    }
    let missing = load(Path::new("nowhere.obj")).unwrap_err();
    assert!(matches!(missing, cao_formats::Error::Io { .. }), "{missing}");
}

#[test]
fn wrong_materials_and_textures_are_refused_with_file_line_and_name() {
    let (leaf, mask) = (leaf(), mask());
    let all = things(&leaf, &mask);
    let swap = |name: &str, bytes: &[u8]| {
        let files =
            all.map(|(file, old)| if file == name { (file, bytes.to_vec()) } else { (file, old.to_vec()) });
        refusal(&files.iter().map(|(file, bytes)| (*file, &bytes[..])).collect::<Vec<_>>())
    };
    for (mtl, expected) in [
        ("Kd 1 1 1\n", "line 1: Kd: stands before newmtl"),
        ("newmtl red\nKd 1 1\n", "line 2: Kd: \"1 1\": expected one or three numbers from 0 to 1"),
        ("newmtl red\nKd spectral a.rfl\n", "line 2: Kd: \"spectral a.rfl\": expected"),
        ("newmtl red\nKd 1 1 2\n", "line 2: Kd: "),
        ("newmtl red\nd nan\n", "line 2: d: \"nan\": expected a number from 0 to 1"),
        ("newmtl red\nTr -1\n", "line 2: Tr: \"-1\": expected"),
        ("newmtl red\nmap_Kd\n", "line 2: map_Kd: \"\": expected the name of a PNG file without options"),
        (
            "newmtl red\nmap_Kd -s 2 2 2 leaf.png\n",
            "line 2: map_Kd: \"-s 2 2 2 leaf.png\": expected the name",
        ),
        ("newmtl the leaf\n\nmap_Kd gone.png\n", "line 3: map_Kd: material \"the leaf\": there is no file "),
    ] {
        let said = swap("of things.mtl", mtl.as_bytes());
        assert!(said.contains("of things.mtl: ") && said.contains(expected), "{mtl:?}: {said}");
    }
    for (image, expected) in [
        (b"\xff\xd8\xff\xe0....".to_vec(), "leaf.png is JPEG, not PNG; convert it to PNG"),
        (b"DDS ....".to_vec(), "is DDS, not PNG"),
        (b"".to_vec(), "leaf.png is no PNG; convert it"),
        (leaf[..40].to_vec(), "leaf.png: "),
        (rgba([1, 1], &[[0; 4]]), "mask.png has 2×1 pixels and map_Kd 1×1; scale one to the other"),
        (huge_png([20_000, 1]), "leaf.png has 20000×1 pixels; expected at most 16384"),
        (huge_png([16_384, 16_385]), "expected at most 16384"),
    ] {
        let said = swap("leaf.png", &image);
        assert!(said.contains("of things.mtl: line ") && said.contains("material \"the leaf\": "), "{said}");
        assert!(said.contains(expected), "{said}, not {expected}");
    }
    let bare = OBJ.replace("/1/1", "//1").replace("usemtl red\n", "");
    let said = swap("a.obj", bare.as_bytes());
    assert!(
        said.contains(
            "a.obj: line 22: f: without texture coordinates, and material \"the leaf\" has a texture"
        ),
        "{said}"
    );
}

/// The head of a PNG that claims this size, and nothing behind it.
fn huge_png(size: [u32; 2]) -> Vec<u8> {
    let mut file = rgba([1, 1], &[[0; 4]]);
    file[16..20].copy_from_slice(&size[0].to_be_bytes());
    file[20..24].copy_from_slice(&size[1].to_be_bytes());
    let sum = crc(&file[12..29]);
    file[29..33].copy_from_slice(&sum.to_be_bytes());
    file
}

/// The check sum of a PNG's chunk.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

/// Any file is read or refused with its name, and what is read makes a world or says why not.
pub fn assert_harmless(path: &Path) -> Result<(), TestCaseError> {
    let folder = path.parent().unwrap().display().to_string();
    let said = match load(path) {
        Ok(instances) => match World::new(&instances) {
            Ok(world) => {
                prop_assert!(world.triangles.iter().flat_map(|t| t.corners).all(|corner| corner.is_finite()));
                return Ok(());
            }
            Err(error) => error.to_string(),
        },
        Err(error) => error.to_string(),
    };
    prop_assert!(said.contains(&folder) || said.starts_with("mesh "), "{said}");
    Ok(())
}

proptest! {
    #![proptest_config(config(CASES))]

    #[test]
    fn surfaces_are_read_or_refused(which in 0..4_usize, changes in changes()) {
        let (leaf, mask) = (leaf(), mask());
        let files = things(&leaf, &mask);
        let folder = folder(&files);
        fs::write(folder.path().join(files[which].0), changed(files[which].1, &changes)).unwrap();
        assert_harmless(&folder.path().join("a.obj"))?;
    }
}

/// Bunny and armadillo, as they are handed about.
#[test]
fn real_meshes_are_read() {
    let Some(data) = std::env::var_os("CAO_DATA").filter(|data| !data.is_empty()) else {
        eprintln!("skipped: set CAO_DATA=FOLDER, with FOLDER/meshes/stanford-bunny.obj in it");
        return;
    };
    for (name, triangles, two_sided) in [("stanford-bunny", 69_451, true), ("armadillo", 86_482, false)] {
        let path = Path::new(&data).join(format!("meshes/{name}.obj"));
        let instances: Vec<Instance> = load(&path).unwrap();
        let world = World::new(&instances).unwrap();
        assert_eq!(world.triangles.len() + world.degenerate, triangles, "{name}");
        assert_eq!(world.materials.iter().any(|m| m.two_sided), two_sided, "{name}");
    }
}
