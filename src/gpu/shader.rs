//! What is known about a compiled shader, and the check of hosts' structs against the WGSL. The latter is for hosts that still write
//! their structs by hand; it goes with the last of them.

pub use cao_reflect::{Binding, BindingKind, EntryPoint, ImageBinding, Shader, Stage, Texel, Use, ViewDim};

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
