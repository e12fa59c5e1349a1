//! The house holds: modules use only what stands above them, every kernel has its host side, its twin and its test under one
//! name, unsafe code is where it belongs, the library does not print. Every rule is data, and every check is shown to fail.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// What may use what, in the order in which data pass through: (path under `src/`, modules it may name by `crate::`). The longest path
/// that fits a file counts. `lib.rs` only declares and re-exports; programs (`bin/`) may use all of the library.
const MAY_USE: &[(&str, &[&str])] = &[
    // Plain data.
    ("error.rs", &[]),
    ("view.rs", &["error"]),
    ("transfer.rs", &["error"]),
    ("mesh.rs", &["error"]),
    ("occlusion.rs", &["error"]),
    ("lattice.rs", &["occlusion"]),
    ("clip.rs", &["error", "mesh"]),
    ("scene.rs", &["error", "view", "transfer", "mesh", "occlusion", "clip"]),
    // Files.
    ("volume/", &["error", "view", "transfer", "mesh", "occlusion", "clip", "scene"]),
    ("picture.rs", &["error", "volume"]),
    // The truth. Its tests may use everything it may.
    ("cpu/", &["error", "view", "transfer", "mesh", "occlusion", "lattice", "clip", "scene", "volume"]),
    // Vulkan knows no volume and no method.
    ("gpu/", &["error"]),
    // Kernels' host sides; the only one that knows a volume copies it to the device.
    ("stage/", &["error", "view", "transfer", "mesh", "occlusion", "lattice", "clip", "gpu"]),
    ("stage/field.rs", &["error", "volume", "gpu"]),
    ("method/", &["error", "occlusion", "gpu", "stage"]),
    (
        "renderer.rs",
        &[
            "error",
            "view",
            "transfer",
            "mesh",
            "occlusion",
            "clip",
            "scene",
            "volume",
            "gpu",
            "stage",
            "method",
        ],
    ),
    (
        "measure/",
        &[
            "error",
            "view",
            "transfer",
            "mesh",
            "occlusion",
            "clip",
            "scene",
            "volume",
            "picture",
            "cpu",
            "gpu",
            "stage",
            "method",
            "renderer",
        ],
    ),
];

/// Names at the crate's root that are not modules, and the module that they come from.
const ROOT_NAMES: [(&str, &str); 3] = [("Error", "error"), ("Result", "error"), ("layout_check", "gpu")];

/// Other crates that only some places may name.
const ONLY_IN: [(&str, &[&str]); 7] = [
    ("ash", &["gpu/", "error.rs"]),
    ("gpu_allocator", &["gpu/"]),
    ("tobj", &["mesh.rs"]),
    ("kuva", &["measure/plot.rs"]),
    ("clap", &["bin/"]),
    ("anyhow", &["bin/"]),
    ("indicatif", &["bin/"]),
];

/// Kernels of the measurements: they compute nothing that has an answer of its own, so there is no twin to hold them to.
const WITHOUT_TWIN: [(&str, &str); 3] = [
    ("compare", "counts differing bits of two volumes; tests plant differences and count them"),
    ("consistency", "reads what each eye reads; tests compare it with the volume itself"),
    ("past", "exchanges two opacities; tests compare both with what the other was"),
];

/// Rust files under a folder: path below it, content.
fn sources(folder: &Path) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "rs" || e == "wgsl") {
                let name = path.strip_prefix(folder).unwrap().to_str().unwrap().replace('\\', "/");
                found.insert(name, fs::read_to_string(&path).unwrap());
            }
        }
    }
    found
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn library() -> BTreeMap<String, String> {
    let mut files = sources(&root().join("src"));
    files.retain(|name, _| !name.starts_with("bin/") && name != "lib.rs");
    files
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

/// What a file names that stands below it.
fn forbidden(file: &str, text: &str) -> Vec<String> {
    let row = MAY_USE.iter().filter(|(path, _)| file.starts_with(path)).max_by_key(|(path, _)| path.len());
    let Some((path, allowed)) = row else { return vec![format!("{file} is not in the table")] };
    let own = path.split(['/', '.']).next().unwrap_or_default();
    let code = code(text);
    let mut wrong = Vec::new();
    for name in names_after("crate::", &code) {
        let module = ROOT_NAMES.iter().find(|(root, _)| *root == name).map_or(name.as_str(), |(_, of)| *of);
        if module != own && !allowed.contains(&module) {
            wrong.push(format!("{file} uses {name}"));
        }
    }
    for (other, places) in ONLY_IN {
        let named = code.contains(&format!("{other}::"))
            && (code.starts_with(&format!("{other}::"))
                || !names_after(&format!("{other}::"), &code).is_empty());
        if named && !places.iter().any(|place| file.starts_with(place)) {
            wrong.push(format!("{file} uses the crate {other}"));
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
    let wrong: Vec<String> = library().iter().flat_map(|(file, text)| forbidden(file, text)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for (path, _) in MAY_USE {
        assert!(root().join("src").join(path).exists(), "{path} is in the table and not in the house");
    }
}

#[test]
fn a_use_of_something_below_is_caught_however_it_is_written() {
    for (file, planted, caught) in [
        ("stage/lao.rs", "use crate::cpu::lao;", "uses cpu"),
        ("stage/lao.rs", "use crate::{Result, cpu::lao};", "uses cpu"),
        ("stage/lao.rs", "use crate::{\n    gpu::{Gpu, Image},\n    volume::Volume,\n};", "uses volume"),
        ("stage/lao.rs", "fn f() { crate::renderer::draw() }", "uses renderer"),
        ("stage/lao.rs", "use crate::volume::Volume;", "uses volume"),
        ("gpu/device.rs", "use crate::stage::lao::Lao;", "uses stage"),
        ("cpu/lao.rs", "use crate::gpu::Gpu;", "uses gpu"),
        ("view.rs", "use crate::scene::Scene;", "uses scene"),
        ("volume/nrrd.rs", "let _ = crate::measure::exactness::verify;", "uses measure"),
        ("stage/lao.rs", "use ash::vk;", "uses the crate ash"),
        ("renderer.rs", "use anyhow::Result;", "uses the crate anyhow"),
        ("stage/lao.rs", "use super::super::cpu;", "super::super"),
        ("attic.rs", "", "not in the table"),
    ] {
        let found = forbidden(file, planted).join("\n");
        assert!(found.contains(caught), "{file}: {planted}: {found:?}");
    }
    for (file, fine) in [
        ("stage/lao.rs", "use crate::{Error, Result};\nuse crate::gpu::Gpu;\nuse crate::layout_check;"),
        ("stage/field.rs", "use crate::volume::Volume;"),
        (
            "stage/lao.rs",
            "// The twin is crate::cpu::lao.\n/// See [`crate::cpu::lao`].\nuse super::field::Field;",
        ),
        ("cpu/lao.rs", "use crate::cpu::opacity;"),
        ("measure/exactness.rs", "use crate::cpu::lao;"),
        ("gpu/shader.rs", "($crate::gpu::shader::Layout)"),
    ] {
        assert_eq!(forbidden(file, fine), [""; 0], "{fine}");
    }
}

/// Stems of the kernels.
fn kernels() -> Vec<String> {
    let entries = fs::read_dir(root().join("spirv")).unwrap().map(|entry| entry.unwrap().path());
    let stems = entries.filter(|path| path.extension().is_some_and(|e| e == "wgsl"));
    stems.map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned()).collect()
}

/// What a kernel called `stem` lacks, among these files of `src/` and of `tests/`.
fn lacking(stem: &str, src: &BTreeMap<String, String>, tests: &BTreeMap<String, String>) -> Vec<String> {
    let mut lacking = Vec::new();
    let mut needs = |there: bool, what: String| {
        if !there {
            lacking.push(format!("{stem}: no {what}"));
        }
    };
    needs(src.contains_key(&format!("stage/{stem}.rs")), format!("src/stage/{stem}.rs"));
    let twin = src.contains_key(&format!("cpu/{stem}.rs"));
    let excused = WITHOUT_TWIN.iter().any(|(name, _)| *name == stem);
    needs(twin || excused, format!("src/cpu/{stem}.rs and no reason in the table"));
    needs(!(twin && excused), "need of its reason in the table: it has a twin".into());
    // A test of the kernel runs its host side, its file named after the stem or not.
    let host = |text: &String| {
        let code = code(text);
        code.contains(&format!("stage::{stem}::"))
            || names_after("stage::", &code).iter().any(|name| name == stem)
    };
    needs(
        tests.contains_key(&format!("{stem}.rs")) || tests.values().any(host),
        format!("test: neither tests/{stem}.rs nor a test that names stage::{stem}"),
    );
    lacking
}

#[test]
fn every_kernel_has_its_host_its_twin_and_its_test_under_one_name() {
    let (src, mut tests) = (library(), sources(&root().join("tests")));
    // Folders hold what tests share, which tests nothing by itself.
    tests.retain(|name, _| !name.contains('/'));
    let kernels = kernels();
    assert!(kernels.iter().any(|stem| stem == "lao"), "{kernels:?}");
    let wrong: Vec<String> = kernels.iter().flat_map(|stem| lacking(stem, &src, &tests)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for (stem, _) in WITHOUT_TWIN {
        assert!(kernels.iter().any(|kernel| kernel == stem), "{stem} is in the table and not in spirv/");
    }
}

#[test]
fn a_kernel_without_host_twin_or_test_is_caught() {
    let named =
        |names: &[&str]| names.iter().map(|n| (n.to_string(), String::new())).collect::<BTreeMap<_, _>>();
    let (src, tests) = (named(&["stage/blur.rs", "cpu/blur.rs"]), named(&["blur.rs"]));
    assert_eq!(lacking("blur", &src, &tests), [""; 0]);
    assert_eq!(lacking("blur", &named(&["cpu/blur.rs"]), &tests).len(), 1);
    assert_eq!(lacking("blur", &named(&["stage/blur.rs"]), &tests).len(), 1);
    assert_eq!(lacking("blur", &src, &named(&["sharp.rs"])).len(), 1);
    assert_eq!(
        lacking("compare", &named(&["stage/compare.rs", "cpu/compare.rs"]), &named(&["compare.rs"])).len(),
        1
    );
    let elsewhere = |text: &str| BTreeMap::from([("pictures.rs".to_owned(), text.to_owned())]);
    assert_eq!(lacking("blur", &src, &elsewhere("use cao::stage::blur::Blur;")), [""; 0]);
    assert_eq!(lacking("blur", &src, &elsewhere("// stage::blur:: is tested nowhere")).len(), 1);
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
        if !(file.starts_with("gpu/") || file == "capi.rs") {
            wrong.push(format!("{file}:{}: unsafe outside gpu", i + 1));
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
    let wrong: Vec<String> = library().iter().flat_map(|(file, text)| unsafe_lines(file, text)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(!sources(&root().join("src/bin")).values().any(|text| code(text).contains("unsafe ")));

    let good = "// SAFETY: alive.\nunsafe { destroy() };";
    assert_eq!(unsafe_lines("gpu/device.rs", good), [""; 0]);
    assert_eq!(unsafe_lines("stage/lao.rs", good).len(), 1);
    assert_eq!(unsafe_lines("gpu/device.rs", "unsafe { destroy() };").len(), 1);
    assert_eq!(unsafe_lines("gpu/device.rs", "// unsafe in words only"), [""; 0]);
}

/// Things that a library does not do: print, or stop the program because something is not written yet.
const NEVER: [&str; 7] =
    ["todo!", "unimplemented!", "dbg!", "println!", " print!", "eprint!", "std::process::exit"];

fn noises(file: &str, text: &str) -> Vec<String> {
    let code = code(text);
    NEVER.iter().filter(|word| code.contains(**word)).map(|word| format!("{file}: {word}")).collect()
}

#[test]
fn the_library_prints_nothing_and_leaves_nothing_to_do() {
    let wrong: Vec<String> = library().iter().flat_map(|(file, text)| noises(file, text)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let unfinished = sources(&root().join("src/bin")).into_iter().chain(sources(&root().join("spirv")));
    for (file, text) in unfinished {
        assert!(!code(&text).contains("todo!") && !code(&text).contains("dbg!"), "{file}");
    }
    assert_eq!(noises("lao.rs", "eprintln!(\"here\");"), ["lao.rs: println!"]);
    assert_eq!(noises("lao.rs", "else { todo!() }"), ["lao.rs: todo!"]);
    assert_eq!(noises("lao.rs", "// no println! here"), [""; 0]);
}
