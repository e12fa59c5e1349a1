//! Shaders that pipelines are made of: code that the driver runs unchecked, and what reflection says of it.

pub use cao_reflect::*;

/// A compiled shader that the driver may be given. There is no safe way to make one: a driver does not check code, and reflection that
/// says something else than the code would defeat every check of this crate. The build makes those of the kernels.
#[derive(Debug)]
pub struct Shader(cao_reflect::Shader);

impl Shader {
    /// Takes this code and reflection for true.
    ///
    /// # Safety
    /// `shader` must be what `cao_compile` made of one WGSL file: SPIR-V valid for Vulkan 1.3 and the features of [`feature`](crate::feature),
    /// and reflection of that code. Given the numbers that its host side gives it (sizes in immediates, indices in lists), each entry point
    /// must end, stay within what is bound to it, and count indirect arguments up to 65535 at most. The build checks none of these: bounds are
    /// checked in a build for tests only.
    pub const unsafe fn new(shader: cao_reflect::Shader) -> Self {
        Self(shader)
    }
}

impl std::ops::Deref for Shader {
    type Target = cao_reflect::Shader;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}
