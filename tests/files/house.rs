//! The house holds: crates and modules use only what stands above them, every kernel has its host side, its twin and its test
//! under one name, unsafe code is where it belongs, libraries do not print, every test is run, every section of the
//! documentation that is cited is there. Every rule is data, and every check is shown to fail.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

// -------------------------------------------------------------------------------------------------------------- crates

/// A crate and what it may depend on.
struct Crate {
    folder: &'static str,
    name: &'static str,
    /// Crates of ours.
    ours: &'static [&'static str],
    /// Crates of others.
    others: &'static [&'static str],
    /// Crates that only its build script uses.
    build: &'static [&'static str],
}

const fn uses(
    folder: &'static str,
    name: &'static str,
    ours: &'static [&'static str],
    others: &'static [&'static str],
) -> Crate {
    Crate { folder, name, ours, others, build: &[] }
}

/// Every crate, in the order in which data pass through: each may use those above it that it names, and nothing else. What is only for
/// tests (`[dev-dependencies]`) is free.
const CRATES: &[Crate] = &[
    // Plain data.
    uses("src/model", "cao-model", &[], &["bytemuck", "glam", "thiserror"]),
    // The kernels' compiler, which no program contains.
    uses("spirv/reflect", "cao-reflect", &[], &[]),
    uses("spirv/compile", "cao-compile", &["cao-reflect"], &["naga"]),
    // Vulkan knows no volume and no method.
    uses("src/gpu", "cao-gpu", &["cao-reflect"], &["ash", "bytemuck", "gpu-allocator", "thiserror"]),
    Crate {
        build: &["cao-compile"],
        ..uses("spirv", "cao-kernels", &["cao-gpu", "cao-reflect"], &["bytemuck"])
    },
    // What an engine takes: no files, no charts, no command line.
    uses(".", "cao", &["cao-gpu", "cao-kernels", "cao-model"], &["bytemuck", "glam", "thiserror"]),
    // The same for hosts in C.
    uses("src/capi", "cao-capi", &["cao", "cao-gpu", "cao-model"], &["ash", "glam"]),
    // Files.
    uses(
        "src/formats",
        "cao-formats",
        &["cao-model"],
        &[
            "atomic-write-file",
            "earcut",
            "flate2",
            "glam",
            "gltf",
            "hayro-jpeg2000",
            "jpeg-decoder",
            "libc",
            "png",
            "pure_jpegls",
            "serde",
            "serde_json",
            "sha2",
            "thiserror",
            "tiff",
            "tobj",
            "toml",
        ],
    ),
    // The truth: it must not share code with what it judges, but sizes and codes are said once, in the kernels.
    uses("src/twin", "cao-twin", &["cao-kernels", "cao-model"], &["glam"]),
    uses(
        "src/measure",
        "cao-measure",
        &["cao", "cao-formats", "cao-gpu", "cao-kernels", "cao-model", "cao-twin"],
        &["bytemuck", "glam", "kuva", "serde", "serde_json", "thiserror"],
    ),
    uses(
        "src/cli",
        "cao-cli",
        &["cao", "cao-formats", "cao-gpu", "cao-measure", "cao-model", "cao-twin"],
        &["anyhow", "clap", "glam", "indicatif", "serde_json", "signal-hook", "thiserror"],
    ),
    // For hosts that use wgpu; a workspace of its own.
    uses("src/wgpu", "cao-wgpu", &["cao"], &["thiserror", "wgpu"]),
    uses(
        "src/xr",
        "cao-xr",
        &["cao", "cao-cli", "cao-formats"],
        &["anyhow", "ash", "clap", "glam", "openxr", "signal-hook"],
    ),
    // For tests and benches.
    uses(
        "tests/support",
        "cao-testing",
        &[
            "cao",
            "cao-compile",
            "cao-formats",
            "cao-gpu",
            "cao-measure",
            "cao-model",
            "cao-reflect",
            "cao-twin",
        ],
        &["bytemuck", "glam", "proptest", "sha2", "tempfile"],
    ),
    uses("benches", "cao-benches", &[], &["criterion"]),
];

/// Crates that hold unsafe code: where Vulkan is, and where others' handles and pointers come in. All others forbid it.
const UNSAFE_IN: [&str; 4] = ["src/gpu", "src/capi", "src/wgpu", "src/xr"];

/// Files of those crates that need none, and forbid it too.
const SAFE_THERE: [&str; 6] = [
    "src/capi/handle.rs",
    "src/xr/check.rs",
    "src/xr/controls.rs",
    "src/xr/input.rs",
    "src/xr/main.rs",
    "src/xr/placement.rs",
];

/// Crates that deny it but for one promise, `Shader::new`, and the files that make it: what the build emits for each kernel, and what
/// hands the device the kernels of tests.
const PROMISE_IN: [&str; 2] = ["spirv", "tests/support"];
const PROMISE: &str = "Shader::new(";
const PROMISED_BY: [&str; 3] =
    ["spirv/compile/emit/shader.rs", "spirv/compile/tests/kernels/emitted.rs", "tests/support/wgsl.rs"];

/// Crates whose libraries may print: the programs' own, and what cargo runs for us, at builds too.
const LOUD: [&str; 4] = ["src/cli", "src/xr", "benches", "spirv/compile"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn toml(path: &str) -> toml::Table {
    fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}")).parse().unwrap()
}

fn manifest(house: &Crate) -> toml::Table {
    toml(&format!("{}/Cargo.toml", house.folder))
}

/// What a crate's manifest asks for and may not.
fn forbidden_dependencies(house: &Crate, manifest: &toml::Table) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut check = |section: &str, allowed: &[&str]| {
        for name in manifest.get(section).and_then(|s| s.as_table()).into_iter().flat_map(|s| s.keys()) {
            if !allowed.contains(&name.as_str()) {
                wrong.push(format!("{}: {section}: {name}", house.name));
            }
        }
    };
    check("dependencies", &[house.ours, house.others].concat());
    check("build-dependencies", house.build);
    if manifest.contains_key("target") {
        wrong.push(format!("{}: dependencies of a platform escape this check", house.name));
    }
    if manifest["package"]["name"].as_str() != Some(house.name) {
        wrong.push(format!("{}: is called {:?}", house.name, manifest["package"]["name"]));
    }
    let lints = manifest.get("lints").and_then(|l| l.get("workspace")).and_then(|w| w.as_bool());
    if lints != Some(true) {
        wrong.push(format!("{}: without the workspace's lints", house.name));
    }
    wrong
}

/// Rows that use what does not stand above them.
fn upward(crates: &[Crate]) -> Vec<String> {
    let mut wrong = Vec::new();
    for (i, house) in crates.iter().enumerate() {
        for used in house.ours.iter().chain(house.build) {
            if !crates[..i].iter().any(|above| above.name == *used) {
                wrong.push(format!("{} may use {used}, which does not stand above it", house.name));
            }
        }
    }
    wrong
}

#[test]
fn crates_use_only_what_stands_above_them() {
    assert_eq!(upward(CRATES), [""; 0]);
    let wrong: Vec<String> = CRATES.iter().flat_map(|c| forbidden_dependencies(c, &manifest(c))).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // The table is all there is.
    let workspace = toml("Cargo.toml");
    let list = |key| workspace["workspace"][key].as_array().unwrap().iter().map(|m| m.as_str().unwrap());
    let mut found: Vec<&str> = list("members").chain(list("exclude")).chain(["."]).collect();
    let mut listed: Vec<&str> = CRATES.iter().map(|c| c.folder).collect();
    found.sort_unstable();
    listed.sort_unstable();
    assert_eq!(found, listed);
}

#[test]
fn a_dependency_on_something_below_is_caught() {
    let house = uses("src/lower", "cao-lower", &["cao-upper"], &["glam"]);
    let manifest = |text: &str| -> toml::Table {
        let rest = "[package]\nname = \"cao-lower\"\n[lints]\nworkspace = true\n";
        format!("{rest}{text}").parse().unwrap()
    };
    for (planted, caught) in [
        ("[dependencies]\nserde.workspace = true", "cao-lower: dependencies: serde"),
        ("[dependencies]\ncao-gpu = { path = \"../gpu\" }", "cao-lower: dependencies: cao-gpu"),
        ("[build-dependencies]\nglam = \"1\"", "cao-lower: build-dependencies: glam"),
        ("[target.'cfg(unix)'.dependencies]\nlibc = \"1\"", "escape"),
    ] {
        let found = forbidden_dependencies(&house, &manifest(planted)).join("\n");
        assert!(found.contains(caught), "{planted}: {found:?}");
    }
    let fine = "[dependencies]\ncao-upper.workspace = true\nglam.workspace = true\n[dev-dependencies]\nserde = \"1\"";
    assert_eq!(forbidden_dependencies(&house, &manifest(fine)), [""; 0]);
    let bare = "[package]\nname = \"cao-other\"".parse().unwrap();
    let found = forbidden_dependencies(&house, &bare);
    assert!(found.len() == 2 && found[0].contains("cao-other") && found[1].contains("lints"), "{found:?}");

    let upper = || uses("src/upper", "cao-upper", &[], &[]);
    assert_eq!(upward(&[upper(), uses("src/lower", "cao-lower", &["cao-upper"], &[])]), [""; 0]);
    assert_eq!(upward(&[uses("src/lower", "cao-lower", &["cao-upper"], &[]), upper()]).len(), 1);
    assert_eq!(upward(&[Crate { build: &["cao-upper"], ..house }, upper()]).len(), 2);
}

// ------------------------------------------------------------------------------------------------------------- modules

/// What may use what within a crate: (path, modules it may name by `crate::`). The longest path that fits a file counts. `lib.rs` only
/// declares and re-exports.
const MAY_USE: &[(&str, &[&str])] = &[
    ("src/model/error.rs", &[]),
    ("src/model/values.rs", &[]),
    ("src/model/feature.rs", &["error"]),
    ("src/model/view.rs", &["error"]),
    ("src/model/fit.rs", &["error", "view"]),
    ("src/model/transfer.rs", &["error", "values"]),
    ("src/model/mesh.rs", &["error"]),
    ("src/model/light.rs", &["error"]),
    ("src/model/occlusion.rs", &["error", "light"]),
    ("src/model/lit.rs", &["error", "light", "occlusion"]),
    ("src/model/samples.rs", &["error"]),
    ("src/model/look.rs", &["error", "samples"]),
    ("src/model/memory.rs", &[]),
    ("src/model/options.rs", &["error"]),
    ("src/model/methods.rs", &["error", "light", "occlusion", "options"]),
    ("src/model/settings.rs", &["error", "light", "methods", "occlusion", "options"]),
    ("src/model/clip.rs", &["error", "mesh"]),
    ("src/model/surface.rs", &["clip", "error", "mesh"]),
    ("src/model/bvh.rs", &[]),
    ("src/model/pixel_occlusion.rs", &["error"]),
    ("src/model/scenes/", &["bvh", "clip", "error", "mesh", "surface", "view"]),
    ("src/model/order.rs", &[]),
    ("src/model/network.rs", &["error"]),
    ("src/model/volume.rs", &["error", "order", "transfer", "values"]),
    ("src/model/frame.rs", &["clip", "error", "light", "look", "values", "view", "volume"]),
    ("src/model/builtin.rs", &["error", "values", "volume"]),
    ("src/model/image_space.rs", &["error"]),
    ("src/formats/error.rs", &[]),
    ("src/formats/grid.rs", &[]),
    ("src/formats/input.rs", &[]),
    ("src/formats/outputs.rs", &["error"]),
    ("src/formats/toml_value.rs", &["error"]),
    ("src/formats/write.rs", &["error", "outputs"]),
    ("src/formats/picture.rs", &["error", "outputs"]),
    ("src/formats/file.rs", &["error", "input"]),
    ("src/formats/polygon.rs", &[]),
    ("src/formats/network.rs", &["error", "file"]),
    ("src/formats/obj.rs", &["error", "file", "polygon"]),
    ("src/formats/surface/", &["error", "file", "obj", "polygon"]),
    ("src/formats/keys.rs", &["error", "toml_value"]),
    ("src/formats/mesh_keys.rs", &["error", "keys", "surface", "toml_value"]),
    ("src/formats/transfer.rs", &["error", "file", "toml_value"]),
    ("src/formats/light.rs", &["error", "toml_value"]),
    ("src/formats/feature.rs", &["error", "file", "toml_value"]),
    (
        "src/formats/scene.rs",
        &[
            "error",
            "feature",
            "file",
            "keys",
            "light",
            "mesh_keys",
            "obj",
            "reading",
            "toml_value",
            "transfer",
        ],
    ),
    // The readers of volumes, and what refuses and assembles for all of them.
    ("src/formats/binary.rs", &[]),
    ("src/formats/gzip.rs", &[]),
    ("src/formats/parts.rs", &[]),
    ("src/formats/reading.rs", &[]),
    ("src/formats/payload.rs", &["error", "file", "gzip", "parts", "reading", "volume"]),
    ("src/formats/text.rs", &["error", "file", "parts", "volume"]),
    ("src/formats/raw.rs", &["error", "grid", "parts", "payload", "reading", "volume"]),
    ("src/formats/nrrd.rs", &["error", "grid", "parts", "payload", "reading", "text", "volume"]),
    ("src/formats/nifti.rs", &["binary", "error", "file", "grid", "parts", "payload", "reading", "volume"]),
    ("src/formats/metaimage.rs", &["error", "grid", "parts", "payload", "reading", "text", "volume"]),
    (
        "src/formats/analyze.rs",
        &["binary", "error", "grid", "nifti", "parts", "payload", "reading", "volume"],
    ),
    ("src/formats/listing.rs", &["error", "file", "volume"]),
    ("src/formats/foreign.rs", &[]),
    ("src/formats/label.rs", &["error", "feature", "file", "listing", "nrrd", "reading", "volume"]),
    ("src/formats/tiff_stack.rs", &["error", "file", "grid", "reading", "volume"]),
    ("src/formats/dicom/", &["binary", "error", "file", "grid", "listing", "reading", "volume"]),
    (
        "src/formats/volume.rs",
        &[
            "analyze",
            "dicom",
            "error",
            "foreign",
            "grid",
            "listing",
            "metaimage",
            "nifti",
            "nrrd",
            "raw",
            "reading",
            "scene",
            "tiff_stack",
        ],
    ),
    // Kernels' host sides, room by room, and the renderer above them.
    ("src/cao/error.rs", &[]),
    ("src/cao/stages.rs", &[]),
    ("src/cao/host.rs", &[]),
    ("src/cao/drive.rs", &["error", "host", "stages"]),
    ("src/cao/field/", &["error", "host", "drive"]),
    ("src/cao/clip/", &["error", "host", "stages", "field"]),
    ("src/cao/draw/", &["error", "host", "field", "clip"]),
    ("src/cao/mesh/", &["error", "host", "stages", "drive", "draw", "clip"]),
    (
        "src/cao/mesh_renderer.rs",
        &["draw", "drive", "error", "host", "image_space", "mesh", "renderer", "stages"],
    ),
    ("src/cao/image_space/", &["error", "draw", "mesh", "stages"]),
    ("src/cao/picture_occlusion.rs", &["draw", "error", "host", "image_space", "mesh", "renderer", "stages"]),
    ("src/cao/subject.rs", &["error", "stages", "drive", "field", "clip"]),
    ("src/cao/ambient.rs", &["error", "drive", "field", "subject"]),
    ("src/cao/build.rs", &["error", "stages", "ambient"]),
    // The methods.
    ("src/cao/cast/", &["error", "host", "stages", "drive", "field", "clip", "subject", "ambient"]),
    ("src/cao/by_brick.rs", &["error", "host", "stages", "drive", "field", "clip", "subject", "ambient"]),
    ("src/cao/rays/", &["error", "host", "stages", "drive", "field", "subject", "by_brick"]),
    (
        "src/cao/features/",
        &["error", "host", "stages", "drive", "field", "subject", "ambient", "by_brick", "rays"],
    ),
    ("src/cao/pyramid/", &["error", "host", "stages", "drive", "field"]),
    ("src/cao/spao/", &["error", "stages", "drive", "field", "subject", "ambient", "by_brick", "pyramid"]),
    ("src/cao/cones/", &["error", "stages", "drive", "field", "subject", "ambient", "by_brick", "pyramid"]),
    ("src/cao/tables/", &["error", "host", "stages", "drive", "field", "subject", "ambient", "by_brick"]),
    ("src/cao/histograms/", &["error", "host", "stages", "drive", "field", "subject", "ambient", "by_brick"]),
    ("src/cao/network/", &["error", "host", "stages", "drive", "field", "subject", "ambient", "by_brick"]),
    ("src/cao/vicinity/", &["error", "stages", "drive", "field", "subject", "by_brick"]),
    (
        "src/cao/method.rs",
        &[
            "error",
            "subject",
            "ambient",
            "by_brick",
            "cast",
            "cones",
            "features",
            "histograms",
            "network",
            "rays",
            "spao",
            "tables",
            "vicinity",
        ],
    ),
    ("src/cao/renderer.rs", &["error", "host", "drive", "field", "draw", "subject", "ambient", "method"]),
    ("src/cao/renderer/", &["ambient", "build", "clip", "draw", "drive", "error", "field", "mesh", "stages"]),
    // Instruments take the renderer.
    ("src/cao/verify/", &["error", "host", "drive", "field", "cast", "draw", "ambient", "renderer"]),
    ("src/measure/failure.rs", &[]),
    ("src/measure/error.rs", &[]),
    ("src/measure/random.rs", &[]),
    ("src/measure/ssim.rs", &["random"]),
    ("src/measure/flip.rs", &[]),
    ("src/measure/plot.rs", &["failure"]),
    ("src/measure/split.rs", &[]),
    ("src/measure/kernels/", &["failure"]),
    ("src/measure/exactness.rs", &["failure"]),
    ("src/measure/planner.rs", &["failure", "random"]),
    ("src/measure/reference.rs", &["failure", "kernels", "random"]),
    ("src/measure/contender/", &["failure", "kernels"]),
    ("src/measure/examples/", &["failure", "error", "random", "reference"]),
    ("src/measure/shown.rs", &["failure"]),
    (
        "src/measure/stability/",
        &["failure", "error", "exactness", "flip", "kernels", "plot", "random", "reference", "shown"],
    ),
    (
        "src/measure/chart/",
        &[
            "failure",
            "contender",
            "error",
            "exactness",
            "flip",
            "kernels",
            "plot",
            "random",
            "reference",
            "shown",
            "split",
            "ssim",
        ],
    ),
];

/// Crates of one floor: their modules may name each other.
const ONE_FLOOR: [&str; 9] = [
    "src/gpu/",
    "src/twin/",
    "src/capi/",
    "src/cli/",
    "src/wgpu/",
    "src/xr/",
    "spirv/",
    "benches/",
    "tests/support/",
];

/// Names at a crate's root that are not modules, and the module that they come from. The longest path that fits counts.
const ROOT_NAMES: [(&str, &str, &str); 7] = [
    ("src/", "Error", "error"),
    ("src/", "Result", "error"),
    ("src/measure/", "Error", "failure"),
    ("src/measure/", "Result", "failure"),
    ("src/formats/", "read_raw", "raw"),
    ("src/formats/", "write_atomic", "outputs"),
    ("src/formats/", "write_nrrd", "write"),
];

/// Other crates, and modules of ours, that only some places of the libraries and programs may name.
const ONLY_IN: [(&str, &[&str]); 18] = [
    ("ash", &["src/gpu/", "src/capi/", "src/wgpu/", "src/xr/"]),
    ("wgpu", &["src/wgpu/"]),
    ("openxr", &["src/xr/"]),
    ("gpu_allocator", &["src/gpu/"]),
    ("tobj", &["src/formats/obj.rs", "src/formats/surface/obj.rs"]),
    ("gltf", &["src/formats/surface/"]),
    ("earcut", &["src/formats/polygon.rs"]),
    ("tiff", &["src/formats/tiff_stack.rs"]),
    ("sha2", &["src/formats/network.rs"]),
    ("jpeg_decoder", &["src/formats/dicom/pixels.rs"]),
    ("jpegls", &["src/formats/dicom/pixels.rs"]),
    ("hayro_jpeg2000", &["src/formats/dicom/pixels.rs"]),
    ("kuva", &["src/measure/plot.rs"]),
    ("clap", &["src/cli/", "src/xr/"]),
    ("anyhow", &["src/cli/", "src/xr/"]),
    ("indicatif", &["src/cli/"]),
    // On the device there is one place that knows a volume: it copies it there.
    ("cao_model::volume", VOLUME_IN),
    ("cao_model::values", VOLUME_IN),
];
const VOLUME_IN: &[&str] = &[
    "src/cao/field/mod.rs",
    "src/cao/subject.rs",
    "src/cao/renderer.rs",
    "src/cao/lib.rs",
    "src/formats/",
    "src/capi/volume.rs",
    "src/capi/tests.rs",
    "src/twin/",
    "src/measure/",
    "src/cli/",
];

/// Rust and WGSL files of the workspace under these folders: path, content.
fn sources(folders: &[&str]) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    let mut open: Vec<_> = folders.iter().map(|folder| root().join(folder)).collect();
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(&next).unwrap_or_else(|e| panic!("{}: {e}", next.display())) {
            let path = entry.unwrap().path();
            if path.is_dir() {
                // Where cargo builds a crate that is called from elsewhere.
                if !path.ends_with("target") {
                    open.push(path);
                }
            } else if path.extension().is_some_and(|e| e == "rs" || e == "wgsl") {
                let name = path.strip_prefix(root()).unwrap().to_str().unwrap().replace('\\', "/");
                found.insert(name, fs::read_to_string(&path).unwrap());
            }
        }
    }
    found
}

/// Everything that is built into a library or a program.
fn built() -> BTreeMap<String, String> {
    sources(&["src", "spirv"])
}

/// Source without comments: documentation may point anywhere.
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// First names after every `crate::` or other path root in the code; `crate::{a::b, c}` gives `a` and `c`.
fn names_after(root: &str, code: &str) -> Vec<String> {
    let identifier = |c: char| c.is_alphanumeric() || c == '_';
    let mut names = Vec::new();
    for (at, _) in code.match_indices(root) {
        // A longer word that ends like the root, or a macro's own crate, which is written where the macro is.
        if code[..at].ends_with(|c: char| identifier(c) || c == '$') {
            continue;
        }
        let rest = code[at + root.len()..].trim_start();
        let mut take = |text: &str| {
            let name: String = text.trim_start().chars().take_while(|&c| identifier(c)).collect();
            if !name.is_empty() {
                names.push(name);
            }
        };
        let Some(group) = rest.strip_prefix('{') else {
            take(rest);
            continue;
        };
        let (mut depth, mut start) = (1, 0);
        for (i, c) in group.char_indices() {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                _ => {}
            }
            if depth == 0 || (depth == 1 && c == ',') {
                take(&group[start..i]);
                start = i + 1;
            }
            if depth == 0 {
                break;
            }
        }
    }
    names
}

/// Whether code names a crate, or a module of one as `crate::module`.
fn names(what: &str, code: &str) -> bool {
    match what.split_once("::") {
        Some((root, module)) => names_after(&format!("{root}::"), code).iter().any(|name| name == module),
        None => !names_after(&format!("{what}::"), code).is_empty(),
    }
}

/// What a file names that stands below it.
fn forbidden(file: &str, text: &str) -> Vec<String> {
    let code = code(text);
    let mut wrong = Vec::new();
    if !ONE_FLOOR.iter().any(|path| file.starts_with(path)) && !file.ends_with("/lib.rs") {
        let row =
            MAY_USE.iter().filter(|(path, _)| file.starts_with(path)).max_by_key(|(path, _)| path.len());
        let Some((path, allowed)) = row else { return vec![format!("{file} is not in the table")] };
        let own = path.split('/').nth(2).unwrap_or_default().split('.').next().unwrap_or_default();
        for name in names_after("crate::", &code) {
            let root = ROOT_NAMES.iter().filter(|(path, root, _)| *root == name && file.starts_with(path));
            let module = root.max_by_key(|(path, ..)| path.len()).map_or(name.as_str(), |(.., of)| *of);
            if module != own && !allowed.contains(&module) {
                wrong.push(format!("{file} uses {name}"));
            }
        }
    }
    for (other, places) in ONLY_IN {
        if names(other, &code) && !places.iter().any(|place| file.starts_with(place)) {
            wrong.push(format!("{file} uses {other}"));
        }
    }
    // `super` twice leaves a folder, past this check.
    if code.contains("super::super") {
        wrong.push(format!("{file} uses super::super, expected crate::"));
    }
    wrong
}

#[test]
fn modules_use_only_what_stands_above_them() {
    let wrong: Vec<String> = built().iter().flat_map(|(file, text)| forbidden(file, text)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for path in MAY_USE.iter().map(|(path, _)| *path).chain(ONE_FLOOR).chain(VOLUME_IN.iter().copied()) {
        assert!(root().join(path).exists(), "{path} is in the table and not in the house");
    }
}

#[test]
fn a_use_of_something_below_is_caught_however_it_is_written() {
    for (file, planted, caught) in [
        ("src/cao/cast/lao.rs", "use crate::renderer::Renderer;", "uses renderer"),
        ("src/cao/cast/lao.rs", "use crate::{Result, rays::rays};", "uses rays"),
        (
            "src/cao/clip/dilate.rs",
            "use crate::{\n    field::{Field, BRICK},\n    draw::eyes,\n};",
            "uses draw",
        ),
        ("src/cao/cast/lao.rs", "fn f() { crate::renderer::draw() }", "uses renderer"),
        ("src/cao/cast/lao.rs", "use cao_model::volume::Volume;", "uses cao_model::volume"),
        (
            "src/cao/field/opacity.rs",
            "use cao_model::{clip::Clip, values::Values};",
            "uses cao_model::values",
        ),
        ("src/model/view.rs", "use crate::volume::Volume;", "uses volume"),
        ("src/formats/nrrd.rs", "let _ = crate::scene::Scene::load;", "uses scene"),
        ("src/measure/kernels/ssao.rs", "use crate::chart;", "uses chart"),
        ("src/measure/exactness.rs", "use crate::error::errors;", "uses error"),
        ("src/cao/cast/lao.rs", "use ash::vk;", "uses ash"),
        ("src/measure/chart/draw.rs", "let x = kuva::Plot::new();", "uses kuva"),
        ("src/cao/renderer.rs", "use anyhow::Result;", "uses anyhow"),
        ("src/cao/cast/lao.rs", "use super::super::rays;", "super::super"),
        ("src/cao/attic.rs", "", "not in the table"),
        ("src/attic/lib.rs", "use tobj::Mesh;", "uses tobj"),
    ] {
        let found = forbidden(file, planted).join("\n");
        assert!(found.contains(caught), "{file}: {planted}: {found:?}");
    }
    for (file, fine) in [
        (
            "src/cao/cast/lao.rs",
            "use crate::{Error, Result};\nuse crate::field::Field;\nuse cao_model::clip::Clip;",
        ),
        ("src/cao/field/mod.rs", "use cao_model::volume::Volume;"),
        (
            "src/cao/cast/lao.rs",
            "// The twin is crate::renderer.\n/// See [`crate::renderer`].\nuse super::volumes::Volumes;",
        ),
        ("src/twin/cast/lao.rs", "use crate::field::opacity;"),
        ("src/measure/exactness.rs", "use crate::{Error, Result};"),
    ] {
        assert_eq!(forbidden(file, fine), [""; 0], "{fine}");
    }
}

// ------------------------------------------------------------------------------------------------------------- kernels

/// Kernels that compute nothing that has an answer of its own, so that there is no twin to hold them to.
const WITHOUT_TWIN: [(&str, &str); 11] = [
    ("labels", "copies features; the test has which bricks they change in"),
    ("mask", "copies opacities of a feature; the test has which, where"),
    ("filter", "asks a device what its filter does; the answer is in the comparison"),
    ("commit", "counts and copies bricks; the test has what whole updates make of them"),
    ("ones", "writes ones; the test has them"),
    ("present", "copies texels; the test has what each format makes of them"),
    ("scene_depth", "inverts a view's depth; the test has a sphere that it traces"),
    ("volumes", "draws what `gather` looks up, whose twin is its own; the test compares the two"),
    ("trace_queries", "finds the rays of `trace`, whose twin is its own; the test compares the two"),
    ("compare", "counts differing bits of two volumes; tests plant differences and count them"),
    ("consistency", "reads what each eye reads; tests compare it with the volume itself"),
];

/// Kernels that need a whole renderer for their test, and where it is.
const TESTED_IN: [(&str, &str); 4] = [
    ("commit", "tests/renderer/budget.rs"),
    ("scene_depth", "tests/renderer/external.rs"),
    ("compare", "tests/renderer/exactness.rs"),
    ("consistency", "tests/renderer/consistency.rs"),
];

/// Rooms whose host sides live elsewhere.
const HOSTS_OF: [(&str, &str); 1] = [("measure", "src/measure/kernels")];

/// The kernels: room and stem.
fn kernels() -> Vec<(String, String)> {
    let mut found = Vec::new();
    for file in sources(&["spirv"]).keys() {
        let Some(path) = file.strip_prefix("spirv/").and_then(|file| file.strip_suffix(".wgsl")) else {
            continue;
        };
        let (room, stem) = path.split_once('/').unwrap_or(("", path));
        if !["shared", "compile"].contains(&room) {
            found.push((room.to_owned(), stem.to_owned()));
        }
    }
    found
}

/// What the kernel `spirv/room/stem.wgsl` lacks among these files.
fn lacking<T>(room: &str, stem: &str, files: &BTreeMap<String, T>) -> Vec<String> {
    let mut lacking = Vec::new();
    let mut needs = |there: bool, what: String| {
        if !there {
            lacking.push(format!("{room}/{stem}: no {what}"));
        }
    };
    let hosts = HOSTS_OF.iter().find(|(of, _)| *of == room).map(|(_, folder)| (*folder).to_owned());
    let host = format!("{}/{stem}.rs", hosts.unwrap_or_else(|| format!("src/cao/{room}")));
    needs(files.contains_key(&host), host);
    let twin = format!("src/twin/{room}/{stem}.rs");
    let excused = WITHOUT_TWIN.iter().any(|(name, _)| *name == stem);
    needs(!(files.contains_key(&twin) && excused), "need of its reason in the table: it has a twin".into());
    needs(files.contains_key(&twin) || excused, format!("{twin} and no reason in the table"));
    let elsewhere = TESTED_IN.iter().find(|(name, _)| *name == stem).map(|(_, file)| (*file).to_owned());
    let test = elsewhere.unwrap_or_else(|| format!("tests/kernels/{stem}.rs"));
    needs(files.contains_key(&test), test);
    lacking
}

#[test]
fn every_kernel_has_its_host_its_twin_and_its_test_under_one_name() {
    let files = sources(&["src", "tests"]);
    let kernels = kernels();
    assert!(kernels.contains(&("cast".into(), "lao".into())), "{kernels:?}");
    let wrong: Vec<String> = kernels.iter().flat_map(|(room, stem)| lacking(room, stem, &files)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for stem in WITHOUT_TWIN.iter().chain(&TESTED_IN).map(|(stem, _)| stem) {
        assert!(kernels.iter().any(|(_, kernel)| kernel == stem), "{stem} is in the table and not in spirv/");
    }
    for (stem, _) in TESTED_IN {
        assert!(!files.contains_key(&format!("tests/kernels/{stem}.rs")), "{stem} has a test of its own");
    }
}

#[test]
fn a_kernel_without_host_twin_or_test_is_caught() {
    let named = |names: &[&str]| names.iter().map(|n| (n.to_string(), ())).collect::<BTreeMap<_, _>>();
    let all = ["src/cao/cast/blur.rs", "src/twin/cast/blur.rs", "tests/kernels/blur.rs"];
    assert_eq!(lacking("cast", "blur", &named(&all)), [""; 0]);
    for without in 0..all.len() {
        let rest: Vec<&str> = (0..all.len()).filter(|i| *i != without).map(|i| all[i]).collect();
        let found = lacking("cast", "blur", &named(&rest));
        assert!(found.len() == 1 && found[0].contains(all[without]), "{found:?}");
    }
    assert!(!lacking("", "blur", &named(&all)).is_empty(), "a kernel outside of all rooms");
    // The same names in other rooms are other things.
    assert_eq!(lacking("draw", "blur", &named(&all)).len(), 2);
    let measured = ["src/measure/kernels/blur.rs", "src/twin/measure/blur.rs", "tests/kernels/blur.rs"];
    assert_eq!(lacking("measure", "blur", &named(&measured)), [""; 0]);
    // An excuse for what is not lacking, and a test that is not where the table says.
    let compare = ["src/cao/verify/compare.rs", "tests/renderer/exactness.rs"];
    assert_eq!(lacking("verify", "compare", &named(&compare)), [""; 0]);
    assert_eq!(lacking("verify", "compare", &named(&compare[..1])).len(), 1);
    let twin = [compare[0], compare[1], "src/twin/verify/compare.rs"];
    assert_eq!(lacking("verify", "compare", &named(&twin)).len(), 1);
}

// --------------------------------------------------------------------------------------------------------------- tests

/// Files of tests that their executable does not declare, so that nobody runs them.
fn unheard(files: &BTreeMap<String, String>) -> Vec<String> {
    let mut wrong = Vec::new();
    for file in files.keys() {
        let Some((folder, name)) = file.strip_suffix(".rs").and_then(|path| path.rsplit_once('/')) else {
            continue;
        };
        let declared = |main: &str| {
            files.get(&format!("{folder}/{main}.rs")).is_some_and(|text| {
                code(text).lines().any(|line| {
                    let line = line.trim_start();
                    line == format!("mod {name};") || line == format!("pub mod {name};")
                })
            })
        };
        if !["main", "lib"].contains(&name) && !declared("main") && !declared("lib") {
            wrong.push(format!("{file} is declared nowhere"));
        }
    }
    wrong
}

#[test]
fn every_file_of_tests_belongs_to_an_executable() {
    let files = sources(&["tests"]);
    assert_eq!(unheard(&files), [""; 0]);
    // Cargo finds no test by itself here, and is told of each.
    let targets = |manifest: &str| toml(manifest)["test"].as_array().unwrap().len();
    let mains = files.keys().filter(|file| file.ends_with("/main.rs")).count();
    assert_eq!(
        ["Cargo.toml", "src/cli/Cargo.toml", "src/xr/Cargo.toml"].map(targets).iter().sum::<usize>(),
        mains
    );

    let planted = |main: &str| {
        BTreeMap::from([
            ("tests/gpu/main.rs".into(), main.into()),
            ("tests/gpu/draw.rs".into(), String::new()),
        ])
    };
    assert_eq!(unheard(&planted("//! Tests.\n\nmod draw;\n")), [""; 0]);
    assert_eq!(unheard(&planted("mod drawing;")), ["tests/gpu/draw.rs is declared nowhere"]);
    assert_eq!(unheard(&planted("// mod draw;")).len(), 1);
}

/// Whether code includes a file by its path, past its crate.
fn includes_by_path(text: &str) -> bool {
    code(text).split_whitespace().collect::<String>().contains(concat!("#[", "path="))
}

#[test]
fn no_file_is_included_by_its_path() {
    let files = sources(&["src", "spirv", "tests", "benches"]);
    let wrong: Vec<_> =
        files.iter().filter(|(_, text)| includes_by_path(text)).map(|(file, _)| file).collect();
    assert!(wrong.is_empty(), "{wrong:?}");
    assert!(includes_by_path(concat!("#[", "path = \"../common/mod.rs\"]\nmod common;")));
    assert!(includes_by_path(concat!("#[", "path=\"a.rs\"] mod a;")));
    assert!(!includes_by_path(concat!("// #[", "path = \"a.rs\"]")));
}

// -------------------------------------------------------------------------------------------------------------- unsafe

/// Root files of a crate's targets, tests excepted: those that can forbid unsafe code for all of it.
fn roots(house: &Crate, manifest: &toml::Table) -> Vec<String> {
    let mut found = Vec::new();
    let path = |target: &toml::Value| target.get("path").and_then(|p| p.as_str()).map(str::to_owned);
    found.push(manifest.get("lib").and_then(&path).unwrap_or_else(|| "src/lib.rs".into()));
    for kind in ["bin", "bench"] {
        let targets = manifest.get(kind).and_then(|t| t.as_array()).into_iter().flatten();
        found.extend(targets.map(|target| path(target).expect("a target says its path")));
    }
    found.extend(manifest["package"].get("build").and_then(|b| b.as_str()).map(str::to_owned));
    let folder = if house.folder == "." { String::new() } else { format!("{}/", house.folder) };
    found.into_iter().map(|file| format!("{folder}{file}")).collect()
}

fn forbids_unsafe(text: &str) -> bool {
    code(text).lines().any(|line| line.trim() == "#![forbid(unsafe_code)]")
}

fn denies_unsafe(text: &str) -> bool {
    code(text).lines().any(|line| line.trim() == "#![deny(unsafe_code)]")
}

/// Lines of unsafe code that stand where they may not, or whose promise nobody wrote down.
fn unsafe_lines(file: &str, text: &str) -> Vec<String> {
    let mut wrong = Vec::new();
    let lines: Vec<&str> = text.lines().collect();
    for (i, line) in lines.iter().enumerate() {
        let code = line.split("//").next().unwrap_or("");
        let words: Vec<&str> = code.split(|c: char| !(c.is_alphanumeric() || c == '_')).collect();
        if !words.contains(&"unsafe") {
            continue;
        }
        let promise = PROMISED_BY.contains(&file) && code.contains(PROMISE);
        if !promise && !UNSAFE_IN.iter().any(|folder| file.starts_with(&format!("{folder}/"))) {
            wrong.push(format!("{file}:{}: unsafe where there is none", i + 1));
        }
        // A private function promises nothing to anyone outside, and its body has blocks of its own.
        if words.contains(&"fn") && !words.contains(&"pub") {
            continue;
        }
        // The comment above the statement, at most a few lines up.
        let above = &lines[i.saturating_sub(REACH)..=i];
        if !above.iter().any(|line| line.contains("SAFETY:") || line.contains("# Safety")) {
            wrong.push(format!("{file}:{}: unsafe without a SAFETY comment", i + 1));
        }
    }
    wrong
}

/// Lines between a comment and the unsafe word it is for: a statement, attributes, or the rest of a function's documentation.
const REACH: usize = 10;

#[test]
fn unsafe_is_only_where_vulkan_is_and_says_why_it_is_sound() {
    let files = sources(&["src", "spirv", "benches", "tests/support"]);
    let wrong: Vec<String> = files.iter().flat_map(|(file, text)| unsafe_lines(file, text)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // Sound only where no other thread reads the environment, which a library cannot know.
    let sets: Vec<_> =
        files.iter().filter(|(_, text)| code(text).contains("set_var")).map(|(file, _)| file).collect();
    assert_eq!(sets, [""; 0]);
    // And the compiler sees to it.
    let mut seen = 0;
    for house in CRATES.iter().filter(|c| !UNSAFE_IN.contains(&c.folder)) {
        for file in roots(house, &manifest(house)) {
            let library = PROMISE_IN.iter().any(|folder| file == format!("{folder}/lib.rs"));
            let holds = if library { denies_unsafe } else { forbids_unsafe };
            assert!(holds(&files[&file]), "{file} does not forbid unsafe code");
            seen += 1;
        }
    }
    for file in SAFE_THERE {
        assert!(forbids_unsafe(&files[file]), "{file} does not forbid unsafe code");
    }
    assert!(seen > CRATES.len(), "programs, benches and build scripts have roots of their own");
    assert!(UNSAFE_IN.iter().all(|folder| CRATES.iter().any(|c| c.folder == *folder)));

    let good = "// SAFETY: alive.\nunsafe { destroy() };";
    assert_eq!(unsafe_lines("src/gpu/device.rs", good), [""; 0]);
    assert_eq!(unsafe_lines("src/cao/cast/lao.rs", good).len(), 1);
    assert_eq!(unsafe_lines("src/cli/cao/main.rs", good).len(), 1);
    assert_eq!(unsafe_lines("src/capi/edge.rs", good), [""; 0]);
    assert_eq!(unsafe_lines("src/gpu/device.rs", "unsafe { destroy() };").len(), 1);
    assert_eq!(unsafe_lines("tests/support/wgsl.rs", good).len(), 1);
    assert_eq!(
        unsafe_lines("tests/support/wgsl.rs", "// SAFETY: valid.\nunsafe { Shader::new(it) };"),
        [""; 0]
    );
    assert_eq!(unsafe_lines("src/gpu/device.rs", "// unsafe in words only"), [""; 0]);
    assert!(forbids_unsafe("//! A crate.\n\n#![forbid(unsafe_code)]\n"));
    assert!(!forbids_unsafe("// #![forbid(unsafe_code)]") && !forbids_unsafe("#![deny(unsafe_code)]"));
    let manifest: toml::Table =
        "package = { name = \"a\", build = \"b.rs\" }\nlib = { path = \"l.rs\" }\nbin = [{ name = \"c\", path = \"c/main.rs\" }]"
            .parse()
            .unwrap();
    assert_eq!(roots(&uses("a", "a", &[], &[]), &manifest), ["a/l.rs", "a/c/main.rs", "a/b.rs"]);
    assert_eq!(roots(&uses(".", "a", &[], &[]), &"package = {}".parse().unwrap()), ["src/lib.rs"]);
}

// ------------------------------------------------------------------------------------------------------------ printing

/// Things that a library does not do: print, or stop the program because something is not written yet.
const NEVER: [&str; 7] =
    ["todo!", "unimplemented!", "dbg!", "println!", " print!", "eprint!", "std::process::exit"];

/// Those of them that nobody does.
const UNFINISHED: [&str; 3] = ["todo!", "unimplemented!", "dbg!"];

fn noises(file: &str, text: &str) -> Vec<String> {
    let code = code(text);
    // How a build script speaks to cargo.
    let loud = LOUD.iter().any(|folder| file.starts_with(&format!("{folder}/")));
    let words = if loud || file.ends_with("/build.rs") { &UNFINISHED[..] } else { &NEVER[..] };
    words.iter().filter(|word| code.contains(**word)).map(|word| format!("{file}: {word}")).collect()
}

#[test]
fn libraries_print_nothing_and_leave_nothing_to_do() {
    let files = sources(&["src", "spirv", "benches", "tests/support"]);
    let wrong: Vec<String> = files.iter().flat_map(|(file, text)| noises(file, text)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(LOUD.iter().all(|folder| CRATES.iter().any(|c| c.folder == *folder)));
    for library in ["src/cao/cast/lao.rs", "src/formats/raw.rs", "spirv/reflect/lib.rs"] {
        assert_eq!(noises(library, "eprintln!(\"here\");"), [format!("{library}: println!")]);
    }
    assert_eq!(noises("src/cao/cast/lao.rs", "else { todo!() }"), ["src/cao/cast/lao.rs: todo!"]);
    assert_eq!(noises("src/cao/cast/lao.rs", "// no println! here"), [""; 0]);
    assert_eq!(noises("src/cli/cao/main.rs", "println!(\"ok\");"), [""; 0]);
    assert_eq!(noises("src/cli/cao/main.rs", "dbg!(x);"), ["src/cli/cao/main.rs: dbg!"]);
    assert_eq!(noises("spirv/build.rs", "println!(\"cargo::error=x\"); todo!()"), ["spirv/build.rs: todo!"]);
}

/// How a file is opened, and where in what has to do with files: what is read is remembered in one place and so never written over, what
/// is written is whole or not there. The system's own files are nobody's.
const FILES_IN: [(&str, &[&str]); 6] = [
    // An `AtomicWriteFile` too.
    ("File::open(", &["src/formats/outputs.rs"]),
    ("fs::read(", &[]),
    (
        "fs::read_to_string(",
        &["src/cli/cao/chart.rs", "src/cli/stereo-bench/machine.rs", "src/cli/targets.rs"],
    ),
    ("OpenOptions::new(", &["src/formats/file.rs", "src/formats/outputs.rs"]),
    ("File::create", &[]),
    ("fs::write(", &[]),
];

fn past_the_door(file: &str, text: &str) -> Vec<String> {
    let code = code(text);
    let found = FILES_IN.iter().filter(|(call, places)| code.contains(call) && !places.contains(&file));
    found.map(|(call, _)| format!("{file}: {call}")).collect()
}

#[test]
fn files_are_opened_in_one_place() {
    let files = sources(&["src/formats", "src/measure", "src/cli", "src/xr"]);
    let wrong: Vec<String> = files.iter().flat_map(|(file, text)| past_the_door(file, text)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for (call, places) in FILES_IN {
        assert!(places.iter().all(|place| files[*place].contains(call)), "{call}");
        let planted = format!("let file = std::{call}path)?;");
        assert_eq!(past_the_door("src/formats/raw.rs", &planted), [format!("src/formats/raw.rs: {call}")]);
    }
}

// ------------------------------------------------------------------------------------------------------- documentation

/// Pages whose sections are cited in code.
const PAGES: [&str; 2] = ["method.md", "measure.md"];

/// Text as one line, without the marks of comments.
fn flowing(text: &str) -> String {
    let bare = |line: &str| line.trim().trim_start_matches('/').trim_start_matches('!').trim().to_owned();
    text.lines().map(bare).collect::<Vec<_>>().join(" ")
}

/// Sections of a page that are cited: "page.md §5.2", "page.md section 4", "page.md §4, many rays; section 5", "page.md §2–§4".
fn cited(page: &str, text: &str) -> Vec<String> {
    let text = flowing(text);
    let mut found = Vec::new();
    for (at, _) in text.match_indices(page) {
        let mut rest = &text[at + page.len()..];
        // Up to the end of the sentence or of the bracket, or to what is another's.
        let end = [")", ". ", "\"", ".md", "CAO", "AOV"].iter().filter_map(|mark| rest.find(mark)).min();
        rest = &rest[..end.unwrap_or(rest.len())];
        let mut first = true;
        while let Some(i) = [rest.find('§'), rest.find("section ")].into_iter().flatten().min() {
            // Words between it and the page's name belong to something else.
            if first && rest[..i].chars().any(char::is_alphanumeric) {
                break;
            }
            first = false;
            rest = rest[i..].trim_start_matches('§').trim_start_matches("section ");
            let number: String = rest.chars().take_while(|c| c.is_ascii_digit() || *c == '.').collect();
            found.push(number.trim_end_matches('.').to_owned());
        }
    }
    found
}

/// Numbers of a page's headings.
fn sections(page: &str) -> Vec<String> {
    let headings = page.lines().filter_map(|line| line.strip_prefix("##"));
    let numbers = headings.filter_map(|line| line.trim_start_matches('#').split_whitespace().next());
    numbers.map(|number| number.trim_end_matches('.').to_owned()).collect()
}

/// Citations in this text of sections that the page does not have.
fn astray(page: &str, sections: &[String], file: &str, text: &str) -> Vec<String> {
    let missing = cited(page, text).into_iter().filter(|number| !sections.contains(number));
    missing.map(|number| format!("{file} cites {page} §{number}")).collect()
}

#[test]
fn every_section_that_is_cited_is_there() {
    let mut files = sources(&["src", "spirv", "tests", "benches"]);
    // Its own text is made of such citations.
    files.remove("tests/files/house.rs").unwrap();
    let (mut wrong, mut seen) = (Vec::new(), 0);
    for page in PAGES {
        let path = root().join("docs").join(page);
        let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let sections = sections(&text);
        for (file, text) in &files {
            seen += cited(page, text).len();
            wrong.extend(astray(page, &sections, file, text));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(seen > 50, "only {seen} citations are recognized");
}

#[test]
fn a_citation_of_a_section_that_is_not_there_is_caught() {
    for (text, expected) in [
        ("//! The reach (method.md §5.2): far.", vec!["5.2"]),
        ("// (method.md section 4, many rays; section 5)", vec!["4", "5"]),
        ("/// as of method.md\n/// §3. The first piece", vec!["3"]),
        ("//! Rules (method.md §2–§4), and §9 of another.", vec!["2", "4"]),
        ("(method.md §4, §5.2, see CAO §3.4)", vec!["4", "5.2"]),
        ("method.md asks for 5. It is §7", vec![]),
        ("as method.md says of §8", vec![]),
        ("(measure.md §1) and [method.md §6](method.md)", vec!["6"]),
    ] {
        assert_eq!(cited("method.md", text), expected, "{text}");
    }
    let page = "# A page\n\n## 1. Terms\n\n### 1.1 More\n\n## 2. Rest\n\n#hash 3\n";
    assert_eq!(sections(page), ["1", "1.1", "2"]);
    let file = "src/cao/cast/lao.rs";
    assert_eq!(astray("method.md", &sections(page), file, "// method.md §1.1, §2"), [""; 0]);
    let found = astray("method.md", &sections(page), file, "// method.md §1.2, section 3");
    assert_eq!(found, [format!("{file} cites method.md §1.2"), format!("{file} cites method.md §3")]);
}

// -------------------------------------------------------------------------------------------------------------- README

/// Rows of the table of methods.
fn method_rows(page: &str) -> Vec<[String; 3]> {
    let cells = |line: &str| -> Option<[String; 3]> {
        let cells: Vec<_> = line.strip_prefix('|')?.strip_suffix('|')?.split('|').map(str::trim).collect();
        let [name, title, source] = cells.try_into().ok()?;
        Some([name.strip_prefix('`')?.strip_suffix('`')?, title, source].map(str::to_owned))
    };
    page.lines().filter_map(cells).collect()
}

#[test]
fn the_readme_is_short_and_its_methods_are_those_of_the_list() {
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    assert!(readme.lines().count() <= 100, "{} lines", readme.lines().count());
    let listed: Vec<_> =
        cao_model::METHODS.iter().map(|m| [m.name, m.title, m.source].map(str::to_owned)).collect();
    assert_eq!(method_rows(&readme), listed);
    assert_eq!(method_rows("| `a` | An A | CAO |\n| name | title | source |"), [["a", "An A", "CAO"]]);
}
