//! WGSL to SPIR-V with naga, and what reflection says about it. Included by `build.rs` and, by path, by the tests, so that both
//! compile in the same way.

#![forbid(unsafe_code)]

mod diagnose;
mod emit;
pub mod include;
mod lint;
pub mod reflect;

use include::Source;
use reflect::Shader;

use naga::{
    Module, ResourceBinding, TypeInner,
    back::spv,
    proc::{BoundsCheckPolicies, BoundsCheckPolicy},
    valid::{Capabilities, ValidationFlags, Validator},
};
use std::path::{Path, PathBuf};

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

/// What the shaders may use beyond plain WGSL; each has its feature in `src/gpu/feature.rs` or is core in Vulkan 1.3.
const CAPABILITIES: Capabilities = Capabilities::IMMEDIATES
    .union(Capabilities::MULTIVIEW)
    .union(Capabilities::STORAGE_TEXTURE_16BIT_NORM_FORMATS)
    .union(Capabilities::TEXTURE_ATOMIC);

/// Every `*.wgsl` directly in `folder`, sorted.
pub fn files(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut list = Vec::new();
    if folder.is_dir() {
        for entry in std::fs::read_dir(folder)? {
            let path = entry?.path();
            if path.is_dir() && !path.ends_with("shared") {
                for inner in std::fs::read_dir(path)? {
                    let path = inner?.path();
                    if path.extension().is_some_and(|e| e == "wgsl") {
                        list.push(path);
                    }
                }
            }
        }
    }
    list.sort();
    Ok(list)
}

/// Compiles one file; the error is a readable report that names file and line.
pub fn file(path: &Path, options: Options) -> Result<Shader, String> {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    // The stem becomes the name of a Rust module.
    if !stem.starts_with(|c: char| c.is_ascii_lowercase())
        || !stem.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
    {
        return Err(format!(
            "error: {}: the name must be of a-z, 0-9 and _, beginning with a letter",
            path.display()
        ));
    }
    source(&stem, &Source::read(path)?, options)
}

/// Compiles a source that has its includes in place.
pub fn source(name: &str, source: &Source, options: Options) -> Result<Shader, String> {
    let module = naga::front::wgsl::parse_str(&source.text).map_err(|e| diagnose::parse(source, &e))?;
    let mut validator = Validator::new(ValidationFlags::all(), CAPABILITIES);
    let info = validator.validate(&module).map_err(|e| diagnose::validation(source, &e))?;
    let problems = lint::check(&module, &info);
    if !problems.is_empty() {
        let lines: Vec<_> = problems.iter().map(|(span, text)| diagnose::at(source, *span, text)).collect();
        return Err(lines.join("\n"));
    }
    let spirv = spv::write_vec(&module, &info, &spirv_options(&module, options), None)
        .map_err(|e| format!("error: {}: cannot be written as SPIR-V: {e}", source.name()))?;
    reflect::reflect(name, &module, &info, spirv).map_err(|e| format!("error: {}: {e}", source.name()))
}

/// Compiles every file of `folder` and writes the Rust source with all of them to `out`. All errors of all files are returned together.
pub fn folder(folder: &Path, options: Options) -> Result<String, Vec<String>> {
    let list = files(folder).map_err(|e| vec![format!("error: {}: {e}", folder.display())])?;
    let (mut shaders, mut errors) = (Vec::new(), Vec::new());
    for path in list {
        match file(&path, options) {
            Ok(shader) => shaders.push(shader),
            Err(error) => errors.push(error),
        }
    }
    if errors.is_empty() { Ok(emit::rust(&shaders)) } else { Err(errors) }
}

/// naga's defaults suit untrusted shaders on the web; these suit our own on Vulkan 1.3. Where it matters:
/// * coordinates are Vulkan's: no flip of y;
/// * workgroup memory is not zeroed (250 times slower on lavapipe): shaders write before they read;
/// * no checks of divisors and no bounds on loops: the shaders are tested;
/// * no 16-bit input and output, which lavapipe lacks.
fn spirv_options(module: &Module, options: Options) -> spv::Options<'static> {
    // A binding keeps the number it has in the source; without faked bindings, naga wants that said.
    let bindings = module.global_variables.iter().filter_map(|(_, variable)| variable.binding);
    let identity = |b: ResourceBinding| {
        (b, spv::BindingInfo { descriptor_set: b.group, binding: b.binding, binding_array_size: None })
    };
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
        lang_version: (1, 3),
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
