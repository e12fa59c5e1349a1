//! What the host needs to know about a shader, taken from naga's module. Mirrors `src/gpu/shader.rs`, which holds it at run time.

use naga::{
    AddressSpace, GlobalVariable, Handle, ImageClass, ImageDimension, Module, ScalarKind, ShaderStage,
    StorageFormat, TypeInner,
    proc::Layouter,
    valid::{GlobalUse, ModuleInfo},
};
use std::collections::BTreeMap;

/// One compiled file.
#[derive(Debug)]
pub struct Shader {
    /// File stem.
    pub name: String,
    /// SPIR-V words.
    pub spirv: Vec<u32>,
    /// In the order of the source.
    pub entry_points: Vec<EntryPoint>,
    /// Sorted by group and number.
    pub bindings: Vec<Binding>,
    /// Size of the immediate block in bytes.
    pub push_bytes: u32,
    /// Structs in uniform, storage and immediate variables, sorted by name.
    pub layouts: Vec<Layout>,
}

/// One entry point.
#[derive(Debug)]
pub struct EntryPoint {
    /// Name.
    pub name: String,
    /// "Compute", "Vertex" or "Fragment".
    pub stage: &'static str,
    /// Workgroup size, zeros except for compute.
    pub workgroup: [u32; 3],
    /// Bindings it touches.
    pub uses: Vec<Use>,
    /// Size of the immediate block if it touches it.
    pub push_bytes: u32,
}

/// How an entry point touches a binding.
#[derive(Debug, Clone, Copy)]
pub struct Use {
    /// Index into the bindings.
    pub binding: usize,
    /// Reads it.
    pub reads: bool,
    /// Writes it.
    pub writes: bool,
}

/// One binding.
#[derive(Debug)]
pub struct Binding {
    /// Variable name.
    pub name: String,
    /// `@group`
    pub group: u32,
    /// `@binding`
    pub binding: u32,
    /// Kind of resource.
    pub kind: BindingKind,
    /// For images.
    pub image: Option<ImageBinding>,
    /// Some entry point reads it.
    pub reads: bool,
    /// Some entry point writes it.
    pub writes: bool,
}

/// Kind of resource.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BindingKind {
    /// `var<uniform>`
    Uniform,
    /// `var<storage>`
    Storage,
    /// `texture_*`
    Sampled,
    /// `texture_storage_*`
    StorageImage,
    /// `sampler`
    Sampler,
}

/// What an image binding takes, in the names of `src/gpu/shader.rs` and `src/gpu/format.rs`.
#[derive(Debug, Clone, Copy)]
pub struct ImageBinding {
    /// `ViewDim`
    pub view: &'static str,
    /// `Texel`
    pub texel: &'static str,
    /// `Format` of a storage image.
    pub format: Option<&'static str>,
}

/// Memory layout of a struct.
#[derive(Debug)]
pub struct Layout {
    /// Name.
    pub name: String,
    /// Size in bytes.
    pub size: u32,
    /// Name, offset and size of each member.
    pub fields: Vec<(String, u32, u32)>,
}

/// Collects everything; the error says what our Vulkan layer cannot serve.
pub fn reflect(name: &str, module: &Module, info: &ModuleInfo, spirv: Vec<u32>) -> Result<Shader, String> {
    let mut layouter = Layouter::default();
    layouter.update(module.to_ctx()).map_err(|e| e.to_string())?;
    let mut bindings = Vec::new();
    let mut push = None;
    let mut layouts = BTreeMap::new();
    for (handle, variable) in module.global_variables.iter() {
        if variable.space == AddressSpace::Immediate {
            push = Some((handle, layouter[variable.ty].size));
        }
        if let Some(binding) = binding(module, variable)? {
            bindings.push((handle, binding));
        }
        if matches!(
            variable.space,
            AddressSpace::Uniform | AddressSpace::Storage { .. } | AddressSpace::Immediate
        ) {
            structs(module, &layouter, variable.ty, &mut layouts);
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
            ShaderStage::Compute => "Compute",
            ShaderStage::Vertex => "Vertex",
            ShaderStage::Fragment => "Fragment",
            other => return Err(format!("entry point `{}` has the unsupported stage {other:?}", entry.name)),
        };
        let push_bytes = push.filter(|(handle, _)| !used[*handle].is_empty()).map_or(0, |(_, size)| size);
        entry_points.push(EntryPoint {
            name: entry.name.clone(),
            stage,
            workgroup: entry.workgroup_size,
            uses,
            push_bytes,
        });
    }
    Ok(Shader {
        name: name.into(),
        spirv,
        entry_points,
        bindings: bindings.into_iter().map(|(_, b)| b).collect(),
        push_bytes: push.map_or(0, |(_, size)| size),
        layouts: layouts.into_values().collect(),
    })
}

fn binding(module: &Module, variable: &GlobalVariable) -> Result<Option<Binding>, String> {
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
        (_, TypeInner::Image { dim, arrayed, class }) => {
            let view = match (dim, arrayed) {
                (ImageDimension::D2, false) => "D2",
                (ImageDimension::D2, true) => "D2Array",
                (ImageDimension::D3, _) => "D3",
                _ => return refuse("is neither a 2D nor a 3D texture"),
            };
            let (kind, texel, format) = match class {
                ImageClass::Sampled { kind, multi: false } => (BindingKind::Sampled, texel(*kind), None),
                ImageClass::Depth { multi: false } => (BindingKind::Sampled, "Depth", None),
                ImageClass::Storage { format, .. } => {
                    let Some(name) = format_name(*format) else {
                        return refuse(&format!(
                            "has format {format:?}, which src/gpu/format.rs does not have"
                        ));
                    };
                    (BindingKind::StorageImage, texel(naga::Scalar::from(*format).kind), Some(name))
                }
                _ => return refuse("is of an unsupported texture type"),
            };
            (kind, Some(ImageBinding { view, texel, format }))
        }
        _ => return refuse("is of an unsupported type"),
    };
    Ok(Some(Binding { name, group: at.group, binding: at.binding, kind, image, reads: false, writes: false }))
}

fn texel(kind: ScalarKind) -> &'static str {
    match kind {
        ScalarKind::Uint => "Uint",
        ScalarKind::Sint => "Sint",
        _ => "Float",
    }
}

/// The formats of `src/gpu/format.rs` that storage images can have.
fn format_name(format: StorageFormat) -> Option<&'static str> {
    Some(match format {
        StorageFormat::R8Unorm => "R8Unorm",
        StorageFormat::R8Uint => "R8Uint",
        StorageFormat::R16Unorm => "R16Unorm",
        StorageFormat::R16Float => "R16Float",
        StorageFormat::R32Float => "R32Float",
        StorageFormat::R32Uint => "R32Uint",
        StorageFormat::Rg32Float => "Rg32Float",
        StorageFormat::Rgba8Unorm => "Rgba8Unorm",
        StorageFormat::Rgba16Float => "Rgba16Float",
        StorageFormat::Rgba32Float => "Rgba32Float",
        _ => return None,
    })
}

/// Layouts of a struct and of the structs inside it.
fn structs(
    module: &Module,
    layouter: &Layouter,
    ty: Handle<naga::Type>,
    found: &mut BTreeMap<String, Layout>,
) {
    match &module.types[ty].inner {
        TypeInner::Array { base, .. } => structs(module, layouter, *base, found),
        TypeInner::Struct { members, span } => {
            let name = module.types[ty].name.clone().unwrap_or_default();
            let fields = members.iter().map(|m| {
                let run_time_sized = matches!(
                    module.types[m.ty].inner,
                    TypeInner::Array { size: naga::ArraySize::Dynamic, .. }
                );
                let size = if run_time_sized { 0 } else { layouter[m.ty].size };
                (m.name.clone().unwrap_or_default(), m.offset, size)
            });
            found.insert(name.clone(), Layout { name, size: *span, fields: fields.collect() });
            members.iter().for_each(|m| structs(module, layouter, m.ty, found));
        }
        _ => {}
    }
}
