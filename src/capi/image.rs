//! The host's images, lent.

use crate::device::CaoDevice;
use crate::device::vulkan::{VkAccessFlags2, VkFormat, VkImage, VkImageLayout, VkPipelineStageFlags2};
use crate::edge::{answer, read, versioned};
use crate::error::{CaoResult, Result, guard, refuse};
use crate::handle::{free, get, handle, insert};
use ash::vk::{self, Handle as _};
use cao_gpu::{Format, Image, ImageState, ImageUse, Lent};

/// An image that a host lent. 0 is none.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CaoImage {
    /// Without meaning for a host.
    pub id: u64,
}
handle!(CaoImage, 5, "image", Image);

/// What an image is used for here; the sum of those that it is.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaoImageUse {
    /// Its depth ends rays: CaoTarget.scene. Of VK_IMAGE_USAGE_SAMPLED_BIT.
    Sampled = 1,
    /// Drawn to: CaoTarget.colour and depth. Of VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT, or that of depth.
    Attachment = 2,
}

/// One side of a barrier: how a host leaves an image, or wants it.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoImageState {
    /// Stages that touched it last, or touch it next.
    pub stages: VkPipelineStageFlags2,
    /// How.
    pub access: VkAccessFlags2,
    /// Before, VK_IMAGE_LAYOUT_UNDEFINED gives up what it holds.
    pub layout: VkImageLayout,
    /// The family that owns it there, if another than the recordings'; else VK_QUEUE_FAMILY_IGNORED.
    pub queue_family: u32,
}

/// An image of a host: flat, of one sample and one level.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoImageInfo {
    /// sizeof(CaoImageInfo).
    pub size: u32,
    /// As it was made: R8G8B8A8 or B8G8R8A8 in UNORM or SRGB, A2B10G10R10_UNORM_PACK32, R16G16B16A16_SFLOAT, R32G32B32A32_SFLOAT,
    /// D16_UNORM, D24_UNORM_S8_UINT, D32_SFLOAT.
    pub format: VkFormat,
    /// On this device.
    pub device: CaoDevice,
    /// It must outlive the CaoImage.
    pub image: VkImage,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// One a view, or one that views share.
    pub layers: u32,
    /// Of CaoImageUse.
    pub uses: u32,
    /// How recordings find it.
    pub before: CaoImageState,
    /// How they leave it.
    pub after: CaoImageState,
}
versioned!(CaoImageInfo);

/// The formats that can be drawn to or end rays.
const FORMATS: [(vk::Format, Format); 10] = [
    (vk::Format::R8G8B8A8_UNORM, Format::Rgba8Unorm),
    (vk::Format::R8G8B8A8_SRGB, Format::Rgba8Srgb),
    (vk::Format::B8G8R8A8_UNORM, Format::Bgra8Unorm),
    (vk::Format::B8G8R8A8_SRGB, Format::Bgra8Srgb),
    (vk::Format::A2B10G10R10_UNORM_PACK32, Format::A2b10g10r10Unorm),
    (vk::Format::R16G16B16A16_SFLOAT, Format::Rgba16Float),
    (vk::Format::R32G32B32A32_SFLOAT, Format::Rgba32Float),
    (vk::Format::D16_UNORM, Format::D16Unorm),
    (vk::Format::D24_UNORM_S8_UINT, Format::D24UnormS8),
    (vk::Format::D32_SFLOAT, Format::D32Float),
];

/// Our name of Vulkan's format.
pub(crate) fn format(number: VkFormat) -> Result<Format> {
    match FORMATS.iter().find(|(known, _)| known.as_raw() == number) {
        Some((_, format)) => Ok(*format),
        None => {
            let known: Vec<_> = FORMATS.iter().map(|(known, _)| format!("{known:?}")).collect();
            let what = format!("format: {number} is none of {}", known.join(", "));
            refuse(CaoResult::BadValue, what)
        }
    }
}

fn uses(number: u32) -> Result<ImageUse> {
    match number {
        1 => Ok(ImageUse::SAMPLED),
        2 => Ok(ImageUse::ATTACHMENT),
        3 => Ok(ImageUse::SAMPLED | ImageUse::ATTACHMENT),
        _ => refuse(CaoResult::BadValue, format!("CaoImageInfo.uses: {number}; expected 1, 2 or their sum")),
    }
}

fn state(given: CaoImageState) -> ImageState {
    ImageState {
        layout: vk::ImageLayout::from_raw(given.layout),
        stages: vk::PipelineStageFlags2::from_raw(given.stages),
        access: vk::AccessFlags2::from_raw(given.access),
        queue_family: (given.queue_family != vk::QUEUE_FAMILY_IGNORED).then_some(given.queue_family),
    }
}

/// Lends an image, for as many recordings as wanted, between cao_recording_acquire and cao_recording_release. Free it with cao_image_free
/// before the host destroys it.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_image_adopt(info: *const CaoImageInfo, image: *mut CaoImage) -> CaoResult {
    let make = || {
        // SAFETY: the header asks for it.
        let info = unsafe { read(info) }?;
        let gpu = get(info.device)?;
        let lent = Lent {
            image: vk::Image::from_raw(info.image),
            size: [info.width, info.height],
            layers: info.layers,
            format: format(info.format)?,
            usage: uses(info.uses)?,
            before: state(info.before),
            after: state(info.after),
        };
        // SAFETY: the header asks for an image of this device as described, that outlives what is made here.
        Ok(insert(unsafe { gpu.adopt_image("of the host", &lent) }?, info.device.id))
    };
    // SAFETY: the header asks for it.
    guard(|| unsafe { answer(image, CaoImage { id: 0 }, make) })
}

/// Gives an image back. Refused while a recording that acquired it is not freed.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_image_free(image: CaoImage) -> CaoResult {
    guard(|| free(image))
}
