//! Vulkan's side of texel formats.

use super::shader::Texel;
use ash::vk;
pub use cao_reflect::Format;

/// What Vulkan calls a format.
pub(crate) trait VulkanFormat {
    /// Its name.
    fn vk(self) -> vk::Format;
    /// All that it holds: colour, or depth, with stencil.
    fn aspect(self) -> vk::ImageAspectFlags;
    /// What shaders and copies see of that.
    fn seen(self) -> vk::ImageAspectFlags;
}

impl VulkanFormat for Format {
    fn vk(self) -> vk::Format {
        match self {
            Format::R8Unorm => vk::Format::R8_UNORM,
            Format::R8Uint => vk::Format::R8_UINT,
            Format::R16Unorm => vk::Format::R16_UNORM,
            Format::R16Uint => vk::Format::R16_UINT,
            Format::R16Float => vk::Format::R16_SFLOAT,
            Format::R32Float => vk::Format::R32_SFLOAT,
            Format::R32Uint => vk::Format::R32_UINT,
            Format::Rg32Float => vk::Format::R32G32_SFLOAT,
            Format::Rgba8Unorm => vk::Format::R8G8B8A8_UNORM,
            Format::Rgba8Srgb => vk::Format::R8G8B8A8_SRGB,
            Format::Bgra8Unorm => vk::Format::B8G8R8A8_UNORM,
            Format::Bgra8Srgb => vk::Format::B8G8R8A8_SRGB,
            Format::A2b10g10r10Unorm => vk::Format::A2B10G10R10_UNORM_PACK32,
            Format::Rgba16Unorm => vk::Format::R16G16B16A16_UNORM,
            Format::Rgba16Float => vk::Format::R16G16B16A16_SFLOAT,
            Format::Rgba32Float => vk::Format::R32G32B32A32_SFLOAT,
            Format::D16Unorm => vk::Format::D16_UNORM,
            Format::D24UnormS8 => vk::Format::D24_UNORM_S8_UINT,
            Format::D32Float => vk::Format::D32_SFLOAT,
        }
    }

    fn aspect(self) -> vk::ImageAspectFlags {
        match self {
            Format::D24UnormS8 => vk::ImageAspectFlags::DEPTH | vk::ImageAspectFlags::STENCIL,
            _ => self.seen(),
        }
    }

    fn seen(self) -> vk::ImageAspectFlags {
        match self.texel() {
            Texel::Depth => vk::ImageAspectFlags::DEPTH,
            _ => vk::ImageAspectFlags::COLOR,
        }
    }
}
