//! Files near valid ones: whatever is in a file, its reader reads it or refuses it with the file's name, without a panic. A run is short and
//! always the same; CONTRIBUTING.md has the command for a long one.

use cao_formats::Reading;
use cao_formats::scene::{Scene, VolumeSource};
use cao_model::mesh::TriangleMesh;
use cao_model::network::{Label, Shape};
use cao_testing::fuzz::{changed, changes, config};
use cao_testing::networks::{hashed, network_file, network_header};
use cao_testing::{network, source};
use flate2::{Compression, write::GzEncoder};
use glam::Vec3;
use proptest::prelude::*;
use std::fs;
use std::io::Write;
use std::path::Path;

/// Cases of each test of a short run: together a few seconds.
const CASES: u32 = 1500;

/// Files of one input, the first being what is opened and changed.
type Seed = Vec<(&'static str, Vec<u8>)>;

fn corpus(name: &str) -> Vec<u8> {
    fs::read(source("tests/corpus").join(name)).unwrap()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// A NIfTI-1 file of 3×4×5 int16.
fn nifti() -> Vec<u8> {
    let mut bytes = vec![0; 352 + 120];
    let mut put = |at: usize, part: &[u8]| bytes[at..at + part.len()].copy_from_slice(part);
    put(0, &348_i32.to_le_bytes());
    for (i, n) in [3_i16, 3, 4, 5, 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * i, &n.to_le_bytes());
    }
    put(70, &4_i16.to_le_bytes());
    put(72, &16_i16.to_le_bytes());
    for (i, n) in [1_f32, 0.5, 0.5, 2.0].into_iter().enumerate() {
        put(76 + 4 * i, &n.to_le_bytes());
    }
    put(108, &352_f32.to_le_bytes());
    put(112, &1_f32.to_le_bytes());
    put(254, &1_i16.to_le_bytes());
    for (i, n) in [0.5_f32, 0.0, 0.0, 1.0, 0.0, 0.5, 0.0, 2.0, 0.0, 0.0, 2.0, 3.0].into_iter().enumerate() {
        put(280 + 4 * i, &n.to_le_bytes());
    }
    put(344, b"n+1\0");
    (0..60_u8).for_each(|i| put(352 + 2 * usize::from(i), &[i, 1]));
    bytes
}

/// Volumes of every format, attached and detached, plain and compressed.
fn volumes() -> Vec<Seed> {
    let nrrd = |rest: &str, data: &[u8]| {
        let header = format!(
            "NRRD0005\n# comment\ntype: int16\ndimension: 3\nsizes: 3 4 5\nspace: left-posterior-superior\nspace directions: (1,0,0) \
             (0,2,0) (0,0,3)\nspace origin: (1,2,3)\nendian: little\nkey:=value\n{rest}"
        );
        [header.as_bytes(), data].concat()
    };
    let meta = |rest: &str, data: &[u8]| {
        let header = format!(
            "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nTransformMatrix = 1 0 0 0 1 0 0 0 \
             1\nOffset = 1 2 3\nElementSpacing = 1 2 3\nDimSize = 3 4 5\nElementType = MET_SHORT\n{rest}"
        );
        [header.as_bytes(), data].concat()
    };
    let data: Vec<u8> = (0..120).collect();
    let text: Vec<u8> = (0..60).flat_map(|i| format!("{i} ").into_bytes()).collect();
    let nifti = nifti();
    let mut pair = nifti[..348].to_vec();
    pair[108..112].fill(0);
    pair[344..347].copy_from_slice(b"ni1");
    // A file a slice.
    let slices = |header: Vec<u8>, name: &'static str| -> Seed {
        let names = ["b0.raw", "b1.raw", "b2.raw", "b3.raw", "b4.raw"];
        let slices = names.into_iter().zip(data.chunks(24)).map(|(name, slice)| (name, slice.to_vec()));
        [(name, header)].into_iter().chain(slices).collect()
    };
    vec![
        vec![("a.nrrd", nrrd("encoding: raw\n\n", &data))],
        vec![("a.nrrd", nrrd("encoding: gzip\n\n", &gzip(&data)))],
        vec![("a.nrrd", nrrd("encoding: ascii\n\n", &text))],
        vec![
            ("a.nhdr", nrrd("encoding: raw\nbyte skip: 0\ndata file: b.raw\n", b"")),
            ("b.raw", data.clone()),
        ],
        slices(
            nrrd("encoding: raw\ndata file: LIST 2\nb0.raw\nb1.raw\nb2.raw\nb3.raw\nb4.raw\n", b""),
            "a.nhdr",
        ),
        slices(nrrd("encoding: raw\ndata file: b%d.raw 0 4 1 2\n", b""), "a.nhdr"),
        vec![("a.mha", meta("ElementDataFile = LOCAL\n", &data))],
        vec![("a.mhd", meta("HeaderSize = 0\nElementDataFile = b.raw\n", b"")), ("b.raw", data.clone())],
        slices(meta("ElementDataFile = b%d.raw 0 4 1\n", b""), "a.mhd"),
        vec![("a.nii", nifti.clone())],
        vec![("a.hdr", pair), ("a.img", data.clone())],
        vec![("a.nii.gz", corpus("F_ras.nii.gz"))],
        vec![("padgz.nii.gz", corpus("padgz.nii.gz"))],
        vec![("A.HDR", corpus("PAIR3.HDR")), ("A.IMG", corpus("PAIR3.IMG"))],
        vec![("a.nrrd", corpus("mask_u8.nrrd"))],
        vec![("a.nrrd", corpus("mask_f64.nrrd"))],
    ]
}

const SCENE: &str = r##"volume = "a.nrrd"
transfer = "t.toml"
[[clip]]
mesh = "m.obj"
mode = "keep"
translate_mm = [1.0, 2, 3]
rotate_deg = [0, 90.5, 0]
scale = 2.5
[[clip]]
shape = "sphere"
scale = [1, 2, 3]
[[mesh]]
file = "m.obj"
translate_mm = [1.0, 2, 3]
scale = 2.5
colour = "#c8b090"
[mesh_occlusion]
method = "aov"
delta_mm = 12.5
sparse = 3
[occlusion]
method = "rays"
rays = "spiral:50"
quadrature = "hybrid"
radius_mm = 12.5
scope = "all"
[stereo]
position_mm = [0, -400, 100]
ipd_mm = 20
fov_deg = 35
[image]
width = 64
height = 48
step_mm = 0.5
background = "#17191d"
[shading]
mode = "phong+ao"
ambient = 0.6
shininess = 20
two_sided = true
light = [-0.4, -0.7, 0.6]
light_from = "world"
occlusion = "all"
"##;
const TRANSFER: &str = r##"reference_mm = 1.5
opacity = [[-1000, 0.0], [0.5, 0.25], [1e3, 1.0]]
colour = [[0, "#b5653b"], [100, [0.91, 0.84, 0.69]]]
"##;

/// Writes the files of an input and returns where the first is.
fn put(folder: &Path, seed: &Seed, first: &[u8]) -> std::path::PathBuf {
    for (name, bytes) in &seed[1..] {
        fs::write(folder.join(name), bytes).unwrap();
    }
    let path = folder.join(seed[0].0);
    fs::write(&path, first).unwrap();
    path
}

/// A refusal names its file and fits a screen.
fn assert_named(error: &cao_formats::Error, path: &Path) -> Result<(), TestCaseError> {
    let message = error.to_string();
    let folder = path.parent().unwrap().display().to_string();
    prop_assert!(
        !message.is_empty() && (message.contains(&folder) || matches!(error, cao_formats::Error::Model(_))),
        "{message}"
    );
    Ok(())
}

proptest! {
    #![proptest_config(config(CASES))]

    #[test]
    fn volumes_are_read_or_refused(which in any::<prop::sample::Index>(), changes in changes(), inside in any::<bool>()) {
        let all = volumes();
        let seed = &all[which.index(all.len())];
        // What is compressed is changed before it, or else its check sum says it all.
        let first = match (inside, seed[0].0) {
            (true, "a.nii.gz" | "padgz.nii.gz") => gzip(&changed(&nifti(), &changes)),
            _ => changed(&seed[0].1, &changes),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = put(folder.path(), seed, &first);
        match cao_formats::read(&path) {
            Ok(volume) => {
                let voxels: usize = volume.dims.iter().product();
                prop_assert!(voxels > 0 && volume.values.len() == voxels);
                prop_assert!(volume.spacing.iter().all(|s| s.is_finite() && *s > 0.0), "{:?}", volume.spacing);
            }
            Err(error) => assert_named(&error, &path)?,
        }
    }

    #[test]
    fn raw_data_are_read_or_refused(
        dims in prop::array::uniform3(prop_oneof![0..6_usize, Just(usize::MAX), Just(1 << 32), Just(1 << 21)]),
        kind in prop_oneof![Just("uint8"), Just("int16"), Just("float64"), Just("uint64"), Just("float16"), Just("")],
        big in any::<bool>(),
        spacing in prop::array::uniform3(prop_oneof![0.1..9.0_f64, Just(0.0), Just(-1.0), Just(f64::NAN), Just(f64::INFINITY), Just(1e-300)]),
        bytes in prop::collection::vec(any::<u8>(), 0..300),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.raw");
        fs::write(&path, bytes).unwrap();
        let source = VolumeSource::Raw { path: path.clone(), dims, kind: kind.into(), spacing_mm: spacing, big_endian: big };
        if let Ok(opened) = source.open(&Reading::default()) {
            prop_assert_eq!(opened.volume.values.len(), dims.iter().product::<usize>());
        }
    }

    #[test]
    fn meshes_are_read_or_refused(which in any::<prop::sample::Index>(), changes in changes()) {
        let all = ["cross_prism.obj", "cubesedge.obj", "tool.obj"].map(corpus);
        let text = changed(&all[which.index(all.len())], &changes);
        match cao_formats::obj::parse("a.obj", &String::from_utf8_lossy(&text)) {
            Ok(mesh) => {
                prop_assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < mesh.vertices.len()));
                if let Err(error) = mesh.check_solid() {
                    prop_assert!(error.to_string().starts_with("mesh a.obj: "), "{error}");
                }
            }
            Err(error) => prop_assert!(error.to_string().starts_with("mesh a.obj: "), "{error}"),
        }
    }

    #[test]
    fn meshes_are_built_or_refused(
        positions in prop::collection::vec(prop::array::uniform3(prop_oneof![
            (-3..4_i8).prop_map(f32::from), any::<f32>(), Just(f32::MAX), Just(1e-40)
        ]), 0..12),
        faces in prop::collection::vec(prop::array::uniform3(0..13_u32), 0..24),
    ) {
        let positions: Vec<Vec3> = positions.into_iter().map(Vec3::from_array).collect();
        if let Ok(mesh) = TriangleMesh::new("made", &positions, &faces) {
            prop_assert!(mesh.vertices.iter().all(|v| v.is_finite()));
            let _ = (mesh.check_solid(), mesh.bounds(), mesh.signed_volume());
        }
    }

    #[test]
    fn weights_of_networks_are_read_or_refused(changes in changes(), header in any::<bool>(), hash in any::<bool>()) {
        let net = network(Shape { edge: 4, filters: 1, cap: 2, levels: 1, label: Label::Mean }, 1);
        let text = network_header(&net, "\"seed\":1,\"data\":[\"a\",\"b\"]");
        let whole = network_file(&text, net.weights());
        // Behind the hash of what is changed, and behind a header that is whole but for its text.
        let bytes = match (header, hash) {
            (true, _) => network_file(&String::from_utf8_lossy(&changed(text.as_bytes(), &changes)), net.weights()),
            (false, true) => hashed(changed(&whole[..whole.len() - 32], &changes)),
            (false, false) => changed(&whole, &changes),
        };
        match cao_formats::network::from_bytes(Path::new("a.net"), &bytes) {
            Ok(read) => prop_assert_eq!(read.network.weights().len(), read.network.shape().weights()),
            Err(error) => prop_assert!(error.to_string().starts_with("a.net: "), "{error}"),
        }
    }

    #[test]
    fn scenes_and_transfer_functions_are_read_or_refused(scene in any::<bool>(), changes in changes()) {
        let seed: Seed = vec![
            ("s.toml", SCENE.into()),
            ("a.nrrd", corpus("mask_u8.nrrd")),
            ("t.toml", TRANSFER.into()),
            ("m.obj", corpus("cubesedge.obj")),
        ];
        let folder = tempfile::tempdir().unwrap();
        let path = put(folder.path(), &seed, &changed(if scene { SCENE } else { TRANSFER }.as_bytes(), &changes));
        if scene {
            match Scene::load(&path) {
                // A built-in may be asked for in any size: making it is the user's wish.
                Ok(Scene { volume: Some(source @ VolumeSource::File(_)), .. }) => drop(source.open(&Reading::default())),
                Ok(_) => {}
                Err(error) => assert_named(&error, &path)?,
            }
        } else {
            match cao_formats::transfer::load(path.to_str().unwrap(), (-1000.0, 1000.0)) {
                Ok(transfer) => prop_assert!(transfer.check().is_ok()),
                Err(error) => assert_named(&error, &path)?,
            }
        }
    }
}

/// A seed that is refused as it stands tries nothing behind the refusal.
#[test]
fn seeds_are_read_before_they_are_changed() {
    for seed in volumes() {
        let folder = tempfile::tempdir().unwrap();
        let read = cao_formats::read(&put(folder.path(), &seed, &seed[0].1));
        read.unwrap_or_else(|e| panic!("{e}"));
    }
    let folder = tempfile::tempdir().unwrap();
    let seed: Seed = vec![
        ("s.toml", SCENE.into()),
        ("a.nrrd", corpus("mask_u8.nrrd")),
        ("t.toml", TRANSFER.into()),
        ("m.obj", corpus("cubesedge.obj")),
    ];
    let path = put(folder.path(), &seed, SCENE.as_bytes());
    let scene = Scene::load(&path).unwrap();
    scene.volume.unwrap().open(&Reading::default()).unwrap();
    cao_formats::transfer::load(folder.path().join("t.toml").to_str().unwrap(), (0.0, 1.0)).unwrap();
}
