//! WGSL to SPIR-V by naga, and all that hosts need to know of it in Rust, so that an interface is said once, in WGSL.
//!
//! A kernel is a file `<room>/<stem>.wgsl`, or `<stem>.wgsl`, of one root folder; its `#include`s are relative to that folder and
//! usually lie in `shared/`, which is no room. [`emit`] says what comes out.

#![forbid(unsafe_code)]

mod diagnose;
pub mod emit;
mod include;
mod lint;
mod notes;
mod reflect;
pub mod structs;
pub mod types;
pub mod values;

pub use include::Source;

use cao_reflect::Shader;
use notes::{Note, Notes};

use naga::{
    Module, ResourceBinding, TypeInner,
    back::spv,
    proc::{BoundsCheckPolicies, BoundsCheckPolicy},
    valid::{Capabilities, ValidationFlags, Validator},
};
use std::{
    env,
    error::Error,
    path::{Path, PathBuf},
};

/// What happens at indices out of range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bounds {
    /// Undefined; for shaders that are tested never to do it.
    Unchecked,
    /// Array indices are clamped; buffer and image reads give 0, buffer writes are dropped. For tests: results must not change. In a
    /// shader with atomics, for which naga cannot drop, buffer indices are clamped too.
    Checked,
}

/// How to compile.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// What happens at indices out of range.
    pub bounds: Bounds,
    /// Keep names in the SPIR-V.
    pub debug: bool,
}

/// What the shaders may use beyond plain WGSL; each has its feature in the Vulkan layer's `feature.rs` or is core in Vulkan 1.3. Ray
/// queries are optional there: it refuses their kernels where a device has none.
const CAPABILITIES: Capabilities = Capabilities::IMMEDIATES
    .union(Capabilities::MULTIVIEW)
    // `pack2x16float` and `unpack2x16float`, which every device has; what naga asks of GL.
    .union(Capabilities::SHADER_FLOAT16_IN_FLOAT32)
    .union(Capabilities::STORAGE_TEXTURE_16BIT_NORM_FORMATS)
    .union(Capabilities::RAY_QUERY)
    .union(Capabilities::TEXTURE_ATOMIC);

/// The folder of files that kernels include.
const SHARED: &str = "shared";

/// A compiled file.
#[derive(Debug)]
pub struct Kernel {
    /// Code, entry points and bindings.
    pub shader: Shader,
    /// The comments of its bindings, in the same order.
    pub binding_docs: Vec<Vec<String>>,
    /// The file, then what it includes.
    pub files: Vec<PathBuf>,
    /// What these files declare and hosts have too, in the order of the source.
    pub items: Vec<Item>,
}

/// A declaration that hosts have too.
#[derive(Debug, PartialEq)]
pub struct Item {
    /// The file that it is in.
    pub file: PathBuf,
    /// Line in it.
    pub line: usize,
    /// Its comment.
    pub doc: Vec<String>,
    /// What it declares.
    pub what: What,
}

/// What an [`Item`] declares.
#[derive(Debug, PartialEq)]
pub enum What {
    /// A constant.
    Constant(values::Constant),
    /// A struct, and the comments of its fields.
    Struct(structs::Struct, Vec<Vec<String>>),
}

/// Every kernel below `root`, sorted by stem.
pub fn files(root: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut list = Vec::new();
    if root.is_dir() {
        for entry in std::fs::read_dir(root)? {
            let path = entry?.path();
            if path.is_dir() && path.file_name().is_some_and(|name| name != SHARED) {
                for entry in std::fs::read_dir(&path)? {
                    list.push(entry?.path());
                }
            } else {
                list.push(path);
            }
        }
    }
    list.retain(|path| path.is_file() && path.extension().is_some_and(|e| e == "wgsl"));
    list.sort_by(|a, b| a.file_stem().cmp(&b.file_stem()).then_with(|| a.cmp(b)));
    Ok(list)
}

/// Compiles one kernel; the error is a readable report that names file and line.
pub fn file(root: &Path, path: &Path, options: Options) -> Result<Kernel, String> {
    let stem = stem(path)?;
    if stem == SHARED {
        return Err(format!("error: {}: the name is taken, by what kernels include", path.display()));
    }
    source(stem, &Source::read(root, path)?, options)
}

/// The stem of a file, which becomes the name of a Rust module.
fn stem(path: &Path) -> Result<&str, String> {
    let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
    if stem.starts_with(|c: char| c.is_ascii_lowercase())
        && stem.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
    {
        Ok(stem)
    } else {
        Err(format!("error: {}: the name must be of a-z, 0-9 and _, beginning with a letter", path.display()))
    }
}

/// Compiles a source that has its includes in place.
pub fn source(name: &str, source: &Source, options: Options) -> Result<Kernel, String> {
    let module = naga::front::wgsl::parse_str(&source.text).map_err(|e| diagnose::parse(source, &e))?;
    let mut validator = Validator::new(ValidationFlags::all(), CAPABILITIES);
    let info = validator.validate(&module).map_err(|e| diagnose::validation(source, &e))?;
    let problems = lint::check(&module, &info);
    if !problems.is_empty() {
        let lines: Vec<_> = problems.iter().map(|(span, text)| diagnose::at(source, *span, text)).collect();
        return Err(lines.join("\n"));
    }
    let of_file = |problem: String| format!("error: {}: {problem}", source.name());
    let spirv = spv::write_vec(&module, &info, &spirv_options(&module, options), None)
        .map_err(|e| of_file(format!("cannot be written as SPIR-V: {e}")))?;
    let shader = reflect::reflect(name, &module, &info, spirv).map_err(of_file)?;
    let notes = Notes::read(source);
    let binding_docs = shader.bindings.iter().map(|b| notes.doc(None, b.name)).collect();
    let items = items(source, &notes, &module).map_err(of_file)?;
    Ok(Kernel { shader, binding_docs, files: source.files.clone(), items })
}

/// The declarations that hosts have too.
fn items(source: &Source, notes: &Notes, module: &Module) -> Result<Vec<Item>, String> {
    let item =
        |note: &Note, what| Item { file: note.file.clone(), line: note.line, doc: note.doc.clone(), what };
    let mut items = Vec::new();
    for (note, constant) in values::constants(source, notes, module)? {
        items.push(item(note, What::Constant(constant)));
    }
    for made in structs::structs(module)? {
        let note = notes
            .find(None, &made.name)
            .ok_or_else(|| format!("struct `{}`: its line must begin with `struct `", made.name))?;
        let doc = |field: &structs::Field| match field.padding {
            true => vec!["Padding.".into()],
            false => notes.doc(Some(&made.name), &field.name),
        };
        let docs = made.fields.iter().map(doc).collect();
        items.push(item(note, What::Struct(made, docs)));
    }
    items.sort_by(|a, b| (&a.file, a.line).cmp(&(&b.file, b.line)));
    Ok(items)
}

/// Compiles every kernel below `root` and returns the Rust source with all of them. All errors of all files are returned together.
pub fn folder(root: &Path, options: Options) -> Result<String, Vec<String>> {
    let list = files(root).map_err(|e| vec![format!("error: {}: {e}", root.display())])?;
    let (mut kernels, mut errors) = (Vec::new(), Vec::new());
    for pair in list.windows(2).filter(|pair| pair[0].file_stem() == pair[1].file_stem()) {
        errors.push(format!(
            "error: {} and {}: two kernels of one name; it names their module and their host side",
            pair[0].display(),
            pair[1].display()
        ));
    }
    for path in list {
        match file(root, &path, options) {
            Ok(kernel) => kernels.push(kernel),
            Err(error) => errors.push(error),
        }
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    emit::rust(&kernels).map_err(|error| vec![error])
}

/// What a build script does: compiles every kernel below `root` into `$OUT_DIR/shaders.rs`. `CAO_SHADER_DEBUG=1` keeps names in the
/// SPIR-V, for graphics debuggers.
pub fn build(root: &str) -> Result<(), Box<dyn Error>> {
    // The whole folder: a new kernel or room is a change too.
    println!("cargo::rerun-if-changed={root}");
    println!("cargo::rerun-if-env-changed=CAO_SHADER_DEBUG");
    let debug = env::var("CAO_SHADER_DEBUG").is_ok_and(|value| value != "0");
    match folder(Path::new(root), Options { bounds: Bounds::Unchecked, debug }) {
        Ok(rust) => Ok(std::fs::write(Path::new(&env::var("OUT_DIR")?).join("shaders.rs"), rust)?),
        Err(errors) => {
            for line in errors.iter().flat_map(|error| error.lines()) {
                println!("cargo::error={line}");
            }
            Err(format!("{} errors in the kernels", errors.len()).into())
        }
    }
}

/// naga's defaults suit untrusted shaders on the web; these suit our own on Vulkan 1.3. Where it matters:
/// * coordinates are Vulkan's: no flip of y;
/// * workgroup memory is not zeroed (250 times slower on lavapipe): shaders write before they read;
/// * no checks of divisors and no bounds on loops: the shaders are tested;
/// * no 16-bit input and output, which lavapipe lacks;
/// * SPIR-V 1.3, and 1.4, which `VK_KHR_ray_query` asks for, where rays are queried.
fn spirv_options(module: &Module, options: Options) -> spv::Options<'static> {
    // A binding keeps the number it has in the source; without faked bindings, naga wants that said.
    let bindings = module.global_variables.iter().filter_map(|(_, variable)| variable.binding);
    let identity = |b: ResourceBinding| {
        (b, spv::BindingInfo { descriptor_set: b.group, binding: b.binding, binding_array_size: None })
    };
    let queries =
        module.types.iter().any(|(_, ty)| matches!(ty.inner, TypeInner::AccelerationStructure { .. }));
    let atomics = module.types.iter().any(|(_, ty)| matches!(ty.inner, TypeInner::Atomic(_)));
    let bounds = match options.bounds {
        Bounds::Unchecked => BoundsCheckPolicies {
            index: BoundsCheckPolicy::Unchecked,
            buffer: BoundsCheckPolicy::Unchecked,
            image_load: BoundsCheckPolicy::Unchecked,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        Bounds::Checked => BoundsCheckPolicies {
            index: BoundsCheckPolicy::Restrict,
            buffer: if atomics { BoundsCheckPolicy::Restrict } else { BoundsCheckPolicy::ReadZeroSkipWrite },
            image_load: BoundsCheckPolicy::ReadZeroSkipWrite,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
    };
    spv::Options {
        lang_version: if queries { (1, 4) } else { (1, 3) },
        flags: if options.debug { spv::WriterFlags::DEBUG } else { spv::WriterFlags::empty() },
        fake_missing_bindings: false,
        binding_map: bindings.map(identity).collect(),
        bounds_check_policies: bounds,
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        force_loop_bounding: false,
        ray_query_initialization_tracking: false,
        use_storage_input_output_16: false,
        emit_int_div_checks: false,
        ..spv::Options::default()
    }
}
