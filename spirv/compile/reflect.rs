//! What the Vulkan layer needs to know about a shader, taken from naga's module.

use cao_reflect::{
    Binding, BindingKind, EntryPoint, Format, ImageBinding, Shader, Stage, Texel, Use, ViewDim,
};
use naga::{
    AddressSpace, GlobalVariable, ImageClass, ImageDimension, Module, ScalarKind, ShaderStage, StorageFormat,
    TypeInner,
    proc::Layouter,
    valid::{GlobalUse, ModuleInfo},
};

/// Collects everything; the error says what our Vulkan layer cannot serve. The memory is never freed: a shader is `'static`, as those
/// that are built in.
pub fn reflect(name: &str, module: &Module, info: &ModuleInfo, spirv: Vec<u32>) -> Result<Shader, String> {
    let mut layouter = Layouter::default();
    layouter.update(module.to_ctx()).map_err(|e| e.to_string())?;
    let mut bindings = Vec::new();
    let mut push = None;
    for (handle, variable) in module.global_variables.iter() {
        if variable.space == AddressSpace::Immediate {
            push = Some((handle, layouter[variable.ty].size));
        }
        if let Some(binding) = binding(module, variable, layouter[variable.ty].size)? {
            bindings.push((handle, binding));
        }
    }
    bindings.sort_by_key(|(_, b)| (b.group, b.binding));
    let mut entry_points = Vec::new();
    for (i, entry) in module.entry_points.iter().enumerate() {
        let used = info.get_entry_point(i);
        let mut uses = Vec::new();
        for (index, (handle, binding)) in bindings.iter_mut().enumerate() {
            if used[*handle].is_empty() {
                continue;
            }
            let used = used[*handle];
            let atomic = used.contains(GlobalUse::ATOMIC);
            // Uses inside called functions are included. naga refuses stores through a function's image parameter.
            let reads = atomic || used.contains(GlobalUse::READ);
            let writes = atomic || used.contains(GlobalUse::WRITE);
            binding.reads |= reads;
            binding.writes |= writes;
            uses.push(Use { binding: index, reads, writes });
        }
        let stage = match entry.stage {
            ShaderStage::Compute => Stage::Compute,
            ShaderStage::Vertex => Stage::Vertex,
            ShaderStage::Fragment => Stage::Fragment,
            other => return Err(format!("entry point `{}` has the unsupported stage {other:?}", entry.name)),
        };
        let push_bytes = push.filter(|(handle, _)| !used[*handle].is_empty()).map_or(0, |(_, size)| size);
        entry_points.push(EntryPoint {
            name: entry.name.clone().leak(),
            stage,
            workgroup: entry.workgroup_size,
            uses: uses.leak(),
            push_bytes,
        });
    }
    Ok(Shader {
        name: name.to_owned().leak(),
        spirv: spirv.leak(),
        entry_points: entry_points.leak(),
        bindings: bindings.into_iter().map(|(_, b)| b).collect::<Vec<_>>().leak(),
        push_bytes: push.map_or(0, |(_, size)| size),
    })
}

fn binding(module: &Module, variable: &GlobalVariable, bytes: u32) -> Result<Option<Binding>, String> {
    let Some(at) = variable.binding else { return Ok(None) };
    let name = variable.name.clone().unwrap_or_default();
    let refuse = |problem: &str| Err(format!("binding `{name}`: {problem}"));
    if at.group != 0 {
        return refuse(&format!("is in group {}, only group 0 is bound", at.group));
    }
    let (kind, image) = match (variable.space, &module.types[variable.ty].inner) {
        (AddressSpace::Uniform, _) => (BindingKind::Uniform, None),
        (AddressSpace::Storage { .. }, _) => (BindingKind::Storage, None),
        (_, TypeInner::Sampler { .. }) => (BindingKind::Sampler, None),
        (_, TypeInner::AccelerationStructure { .. }) => (BindingKind::AccelerationStructure, None),
        (_, TypeInner::Image { dim, arrayed, class }) => {
            let view = match (dim, arrayed) {
                (ImageDimension::D2, false) => ViewDim::D2,
                (ImageDimension::D2, true) => ViewDim::D2Array,
                (ImageDimension::D3, _) => ViewDim::D3,
                _ => return refuse("is neither a 2D nor a 3D texture"),
            };
            let (kind, texel, format) = match class {
                ImageClass::Sampled { kind, multi: false } => (BindingKind::Sampled, texel(*kind), None),
                ImageClass::Depth { multi: false } => (BindingKind::Sampled, Texel::Depth, None),
                ImageClass::Storage { format, .. } => {
                    let Some(ours) = storage_format(*format) else {
                        return refuse(&format!(
                            "has format {format:?}, which cao_reflect::Format does not have"
                        ));
                    };
                    (BindingKind::StorageImage, texel(naga::Scalar::from(*format).kind), Some(ours))
                }
                _ => return refuse("is of an unsupported texture type"),
            };
            (kind, Some(ImageBinding { view, texel, format }))
        }
        _ => return refuse("is of an unsupported type"),
    };
    Ok(Some(Binding {
        name: name.leak(),
        group: at.group,
        binding: at.binding,
        kind,
        min_bytes: if matches!(kind, BindingKind::Uniform | BindingKind::Storage) { bytes } else { 0 },
        image,
        reads: false,
        writes: false,
    }))
}

fn texel(kind: ScalarKind) -> Texel {
    match kind {
        ScalarKind::Uint => Texel::Uint,
        ScalarKind::Sint => Texel::Sint,
        _ => Texel::Float,
    }
}

/// Our formats that storage images can have.
fn storage_format(format: StorageFormat) -> Option<Format> {
    Some(match format {
        StorageFormat::R8Unorm => Format::R8Unorm,
        StorageFormat::R8Uint => Format::R8Uint,
        StorageFormat::R16Unorm => Format::R16Unorm,
        StorageFormat::Rgba16Unorm => Format::Rgba16Unorm,
        StorageFormat::R16Uint => Format::R16Uint,
        StorageFormat::R16Float => Format::R16Float,
        StorageFormat::R32Float => Format::R32Float,
        StorageFormat::R32Uint => Format::R32Uint,
        StorageFormat::Rg32Float => Format::Rg32Float,
        StorageFormat::Rgba8Unorm => Format::Rgba8Unorm,
        StorageFormat::Rgba16Float => Format::Rgba16Float,
        StorageFormat::Rgba32Float => Format::Rgba32Float,
        _ => return None,
    })
}
