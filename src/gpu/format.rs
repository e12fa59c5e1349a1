//! Vulkan's side of texel formats.

use super::shader::Texel;
use ash::vk;
pub use cao_reflect::Format;

/// What Vulkan calls a format.
pub(crate) trait VulkanFormat {
    /// Its name.
    fn vk(self) -> vk::Format;
    /// Colour or depth.
    fn aspect(self) -> vk::ImageAspectFlags;
}

impl VulkanFormat for Format {
    fn vk(self) -> vk::Format {
        match self {
            Format::R8Unorm => vk::Format::R8_UNORM,
            Format::R8Uint => vk::Format::R8_UINT,
            Format::R16Unorm => vk::Format::R16_UNORM,
            Format::R16Float => vk::Format::R16_SFLOAT,
            Format::R32Float => vk::Format::R32_SFLOAT,
            Format::R32Uint => vk::Format::R32_UINT,
            Format::Rg32Float => vk::Format::R32G32_SFLOAT,
            Format::Rgba8Unorm => vk::Format::R8G8B8A8_UNORM,
            Format::Rgba16Float => vk::Format::R16G16B16A16_SFLOAT,
            Format::Rgba32Float => vk::Format::R32G32B32A32_SFLOAT,
            Format::D32Float => vk::Format::D32_SFLOAT,
        }
    }

    fn aspect(self) -> vk::ImageAspectFlags {
        match self.texel() {
            Texel::Depth => vk::ImageAspectFlags::DEPTH,
            _ => vk::ImageAspectFlags::COLOR,
        }
    }
}
