//! Texel formats: one table from our names to Vulkan's, with size and what a shader reads.

use super::shader::Texel;
use ash::vk;

/// Texel format of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// One 8-bit channel, 0…255 read as 0…1.
    R8Unorm,
    /// One 8-bit unsigned integer.
    R8Uint,
    /// One 16-bit channel, 0…65535 read as 0…1.
    R16Unorm,
    /// One half float.
    R16Float,
    /// One float.
    R32Float,
    /// One 32-bit unsigned integer.
    R32Uint,
    /// Two floats.
    Rg32Float,
    /// Four 8-bit channels read as 0…1, linear.
    Rgba8Unorm,
    /// Four half floats.
    Rgba16Float,
    /// Four floats.
    Rgba32Float,
    /// Depth, one float.
    D32Float,
}

impl Format {
    /// The table: Vulkan's name, bytes of a texel, what a shader reads.
    fn row(self) -> (vk::Format, u64, Texel) {
        match self {
            Format::R8Unorm => (vk::Format::R8_UNORM, 1, Texel::Float),
            Format::R8Uint => (vk::Format::R8_UINT, 1, Texel::Uint),
            Format::R16Unorm => (vk::Format::R16_UNORM, 2, Texel::Float),
            Format::R16Float => (vk::Format::R16_SFLOAT, 2, Texel::Float),
            Format::R32Float => (vk::Format::R32_SFLOAT, 4, Texel::Float),
            Format::R32Uint => (vk::Format::R32_UINT, 4, Texel::Uint),
            Format::Rg32Float => (vk::Format::R32G32_SFLOAT, 8, Texel::Float),
            Format::Rgba8Unorm => (vk::Format::R8G8B8A8_UNORM, 4, Texel::Float),
            Format::Rgba16Float => (vk::Format::R16G16B16A16_SFLOAT, 8, Texel::Float),
            Format::Rgba32Float => (vk::Format::R32G32B32A32_SFLOAT, 16, Texel::Float),
            Format::D32Float => (vk::Format::D32_SFLOAT, 4, Texel::Depth),
        }
    }

    /// Vulkan's name of the format.
    pub fn vk(self) -> vk::Format {
        self.row().0
    }

    /// Bytes of one texel.
    pub fn bytes(self) -> u64 {
        self.row().1
    }

    /// What a shader reads.
    pub fn texel(self) -> Texel {
        self.row().2
    }

    /// Colour or depth.
    pub(crate) fn aspect(self) -> vk::ImageAspectFlags {
        match self.texel() {
            Texel::Depth => vk::ImageAspectFlags::DEPTH,
            _ => vk::ImageAspectFlags::COLOR,
        }
    }
}
