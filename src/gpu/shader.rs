//! What is known about a compiled shader: its code, entry points, bindings and struct layouts.
//!
//! The constants come from `build.rs`, which reflects them out of `spirv/*.wgsl`; nothing here is written by hand.

use super::format::Format;

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

/// What a texel reads as in a shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Texel {
    /// `f32`
    Float,
    /// `u32`
    Uint,
    /// `i32`
    Sint,
    /// `texture_depth_*`
    Depth,
}

/// Memory layout of a WGSL struct that hosts fill, see [`layout_check!`](crate::layout_check).
#[derive(Debug)]
pub struct Layout {
    /// Name of the struct in the source.
    pub name: &'static str,
    /// Size in bytes with trailing padding.
    pub size: usize,
    /// Name, offset and size in bytes of each member; the size of a run-time sized array is 0.
    pub fields: &'static [(&'static str, usize, usize)],
}

impl Layout {
    /// Offset and size of a member. Fails to compile when evaluated at compile time for a name that is not there.
    pub const fn field(&self, name: &str) -> (usize, usize) {
        let mut i = 0;
        while i < self.fields.len() {
            if same(self.fields[i].0, name) {
                return (self.fields[i].1, self.fields[i].2);
            }
            i += 1;
        }
        panic!("the WGSL struct has no member of this name")
    }
}

/// String equality that a `const` can evaluate.
const fn same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
}

/// Size of the type of a struct member, for [`layout_check!`](crate::layout_check).
#[doc(hidden)]
pub const fn member_size<S, F>(_: fn(&S) -> &F) -> usize {
    size_of::<F>()
}

/// Holds a host struct to the WGSL struct of the same members, at compile time: total size, number of members, and each member's
/// offset and size.
///
/// ```ignore
/// cao_gpu::layout_check!(LaoParams => cao_kernels::lao::LAO_PARAMS { dims, rays, step });
/// ```
#[macro_export]
macro_rules! layout_check {
    ($host:ty => $layout:path { $($field:ident),+ $(,)? }) => {
        const _: () = {
            assert!(size_of::<$host>() == $layout.size, "host and WGSL struct differ in size");
            assert!(
                [$(stringify!($field)),+].len() == $layout.fields.len(),
                "host and WGSL struct differ in the number of members"
            );
            $(
                assert!(
                    ::core::mem::offset_of!($host, $field) == $layout.field(stringify!($field)).0,
                    concat!("offset of member `", stringify!($field), "` differs from the WGSL struct")
                );
                assert!(
                    $crate::shader::member_size(|s: &$host| &s.$field) == $layout.field(stringify!($field)).1,
                    concat!("size of member `", stringify!($field), "` differs from the WGSL struct")
                );
            )+
        };
    };
}

#[cfg(test)]
mod tests {
    use super::Layout;

    const LAYOUT: Layout = Layout {
        name: "Params",
        size: 32,
        fields: &[("dims", 0, 16), ("step", 16, 4), ("count", 20, 4), ("pad", 24, 8)],
    };

    #[repr(C)]
    struct Params {
        dims: [u32; 4],
        step: f32,
        count: u32,
        pad: [u32; 2],
    }

    crate::layout_check!(Params => LAYOUT { dims, step, count, pad });

    #[test]
    fn a_member_is_found_by_name_and_by_nothing_else() {
        assert_eq!(LAYOUT.field("count"), (20, 4));
        assert!(std::panic::catch_unwind(|| LAYOUT.field("coun")).is_err());
    }
}
