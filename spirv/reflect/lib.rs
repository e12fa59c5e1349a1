//! What is known about a compiled kernel: its code, entry points and bindings. `cao-compile` fills these types from the WGSL, the
//! Vulkan layer builds pipelines from them; nothing in them is written by hand. What is written by hand the Vulkan layer does not take:
//! its own `Shader` around these is made by a promise.

#![forbid(unsafe_code)]

mod format;

pub use format::{Format, Texel};

/// One compiled WGSL file.
#[derive(Debug)]
pub struct Shader {
    /// File stem: `lao` for `spirv/lao.wgsl`.
    pub name: &'static str,
    /// SPIR-V words; all entry points of the file are in this one module.
    pub spirv: &'static [u32],
    /// Entry points in the order of the source.
    pub entry_points: &'static [EntryPoint],
    /// Bindings sorted by group and number; `reads`/`writes` are the union over all entry points.
    pub bindings: &'static [Binding],
    /// Size of the immediate (push constant) block in bytes, 0 when there is none.
    pub push_bytes: u32,
}

impl Shader {
    /// The entry point of this name.
    pub fn entry_point(&self, name: &str) -> Option<&EntryPoint> {
        self.entry_points.iter().find(|e| e.name == name)
    }
}

/// One entry point of a [`Shader`].
#[derive(Debug)]
pub struct EntryPoint {
    /// Name as in the source.
    pub name: &'static str,
    /// Pipeline stage.
    pub stage: Stage,
    /// Workgroup size `[x, y, z]`; zeros unless the stage is [`Stage::Compute`].
    pub workgroup: [u32; 3],
    /// The bindings that this entry point really touches, sorted by their index in [`Shader::bindings`].
    pub uses: &'static [Use],
    /// Size of the immediate block if this entry point touches it, else 0.
    pub push_bytes: u32,
}

/// Pipeline stage of an entry point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// `@compute`
    Compute,
    /// `@vertex`
    Vertex,
    /// `@fragment`
    Fragment,
}

/// How one entry point touches one binding.
#[derive(Debug, Clone, Copy)]
pub struct Use {
    /// Index into [`Shader::bindings`].
    pub binding: usize,
    /// The entry point reads it.
    pub reads: bool,
    /// The entry point writes it.
    pub writes: bool,
}

/// One `@group @binding` variable.
#[derive(Debug, Clone, Copy)]
pub struct Binding {
    /// Variable name in the source: what hosts bind by.
    pub name: &'static str,
    /// `@group`; always 0.
    pub group: u32,
    /// `@binding`
    pub binding: u32,
    /// What kind of resource it takes.
    pub kind: BindingKind,
    /// Least bytes of a buffer: the whole struct, with one element of an array of run-time size; 0 for images and samplers.
    pub min_bytes: u32,
    /// What kind of image it takes; `None` for buffers and samplers.
    pub image: Option<ImageBinding>,
    /// Some entry point reads it.
    pub reads: bool,
    /// Some entry point writes it.
    pub writes: bool,
}

/// What a [`Binding`] takes.
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
    /// `acceleration_structure`
    AccelerationStructure,
}

/// What an image binding expects of the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageBinding {
    /// Dimensionality of the view.
    pub view: ViewDim,
    /// What a texel reads as.
    pub texel: Texel,
    /// Texel format of a storage image, which must be the image's own; `None` for sampled images.
    pub format: Option<Format>,
}

/// Dimensionality of an image view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewDim {
    /// `texture_2d`
    D2,
    /// `texture_2d_array`
    D2Array,
    /// `texture_3d`
    D3,
}
