//! Images and samplers. Images live in the GENERAL layout from their first [`discard`](super::Recorder::discard) on.

use super::{
    Gpu,
    device::{Inner, vulkan},
    external::States,
    format::{Format, VulkanFormat},
    hazard::ResourceId,
    shader::Texel,
};
use crate::{Error, Result};
use ash::vk;
use gpu_allocator::{MemoryLocation, vulkan::Allocation};
use std::sync::Arc;

/// Dimensionality of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageKind {
    /// Flat, with layers.
    D2,
    /// A volume, one layer.
    D3,
}

/// What an image is used for besides copies and clears, which all can do. Combine with `|`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageUse(u8);

impl ImageUse {
    /// `texture_*`
    pub const SAMPLED: Self = Self(1);
    /// `texture_storage_*`
    pub const STORAGE: Self = Self(2);
    /// Colour or depth attachment, as the format says.
    pub const ATTACHMENT: Self = Self(4);

    /// Whether all of `other` is included.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

impl std::ops::BitOr for ImageUse {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// What image to make.
#[derive(Debug, Clone, Copy)]
pub struct ImageDesc {
    /// `[x, y, z]` in texels; z is 1 for [`ImageKind::D2`].
    pub dims: [u32; 3],
    /// Layers; 1 for [`ImageKind::D3`].
    pub layers: u32,
    /// Texel format.
    pub format: Format,
    /// Dimensionality.
    pub kind: ImageKind,
    /// Uses.
    pub usage: ImageUse,
}

/// An image. Dropping it frees it, once the recorders that used it are gone too; with a host's command buffer the host must keep the
/// [`Recorded`](super::Recorded) until the device has run it.
pub struct Image(pub(crate) Arc<ImageInner>);

pub(crate) struct ImageInner {
    pub gpu: Arc<Inner>,
    pub id: ResourceId,
    pub name: String,
    pub desc: ImageDesc,
    pub raw: vk::Image,
    /// The whole image: 3D, or a 2D array.
    pub whole: vk::ImageView,
    /// One 2D view for each layer; empty for a 3D image.
    pub layers: Vec<vk::ImageView>,
    /// The layout in which commands find it.
    pub layout: vk::ImageLayout,
    /// States of a host's image, which is not destroyed here; `None` for our own.
    pub host: Option<States>,
    memory: Option<Allocation>,
}

impl Gpu {
    /// An image, content undefined; [`discard`](super::Recorder::discard) it before its first use.
    ///
    /// # Errors
    /// [`Error::Config`] for an impossible description, [`Error::Limit`] beyond the device's sizes, [`Error::Device`] for a format that
    /// cannot be used so, [`Error::Memory`] or [`Error::Vulkan`] if the device refuses.
    pub fn image(&self, name: &str, desc: &ImageDesc) -> Result<Image> {
        let gpu = &self.0;
        check(gpu, name, desc, COPIES)?;
        let create = vk::ImageCreateInfo::default()
            .image_type(match desc.kind {
                ImageKind::D2 => vk::ImageType::TYPE_2D,
                ImageKind::D3 => vk::ImageType::TYPE_3D,
            })
            .format(desc.format.vk())
            .extent(extent(desc.dims))
            .mip_levels(1)
            .array_layers(desc.layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(usage(desc, COPIES))
            .initial_layout(vk::ImageLayout::UNDEFINED);
        // SAFETY: the device is alive; size, format and usage were checked against it.
        let raw = unsafe { gpu.device.create_image(&create, None) }.map_err(vulkan("vkCreateImage", name))?;
        // From here on the drop of `image` cleans up.
        let mut image = ImageInner::bare(gpu, name, desc, raw);
        gpu.hazards().add_image(image.id);
        gpu.set_name(raw, name);
        // SAFETY: `raw` was just made of this device.
        let requirements = unsafe { gpu.device.get_image_memory_requirements(raw) };
        let memory = gpu.memory.allocate(name, requirements, MemoryLocation::GpuOnly, false)?;
        // SAFETY: the allocation fits the requirements and is bound to nothing else.
        let bound = unsafe { gpu.device.bind_image_memory(raw, memory.memory(), memory.offset()) };
        image.memory = Some(memory);
        bound.map_err(vulkan("vkBindImageMemory", name))?;
        image.make_views()?;
        Ok(Image(Arc::new(image)))
    }
}

/// What our own images can do besides their uses.
const COPIES: vk::ImageUsageFlags = vk::ImageUsageFlags::from_raw(
    vk::ImageUsageFlags::TRANSFER_SRC.as_raw() | vk::ImageUsageFlags::TRANSFER_DST.as_raw(),
);

/// Vulkan's usage flags.
fn usage(desc: &ImageDesc, more: vk::ImageUsageFlags) -> vk::ImageUsageFlags {
    use vk::ImageUsageFlags as U;
    let attachment = match desc.format.texel() {
        Texel::Depth => U::DEPTH_STENCIL_ATTACHMENT,
        _ => U::COLOR_ATTACHMENT,
    };
    [(ImageUse::SAMPLED, U::SAMPLED), (ImageUse::STORAGE, U::STORAGE), (ImageUse::ATTACHMENT, attachment)]
        .into_iter()
        .filter(|(ours, _)| desc.usage.contains(*ours))
        .fold(more, |all, (_, flag)| all | flag)
}

pub(crate) fn extent([width, height, depth]: [u32; 3]) -> vk::Extent3D {
    vk::Extent3D { width, height, depth }
}

/// Refuses what no image of this device is, with `more` uses than those of `desc`.
pub(crate) fn check(gpu: &Inner, name: &str, desc: &ImageDesc, more: vk::ImageUsageFlags) -> Result<()> {
    let what = format!("image {name}");
    let impossible = |problem: &str| Err(Error::Config { what: what.clone(), problem: problem.into() });
    if desc.dims.contains(&0) || desc.layers == 0 {
        return impossible(&format!(
            "has {:?} texels in {} layers, needs at least 1 of each",
            desc.dims, desc.layers
        ));
    }
    let max = match desc.kind {
        ImageKind::D2 if desc.dims[2] != 1 => return impossible("is flat, so its depth must be 1"),
        ImageKind::D3 if desc.layers != 1 => return impossible("is a volume, so it must have 1 layer"),
        ImageKind::D3 if desc.usage.contains(ImageUse::ATTACHMENT) => {
            return impossible("is a volume, which cannot be drawn to");
        }
        ImageKind::D2 => gpu.info.max_image_2d,
        ImageKind::D3 => gpu.info.max_image_3d,
    };
    if desc.usage.0 == 0 {
        return impossible("has no use; name at least one of SAMPLED, STORAGE, ATTACHMENT");
    }
    let limit = |what: String, needed: u32, limit: u32| {
        let hint = format!(
            "choose a smaller volume or picture, or a device that can hold it ({} cannot)",
            gpu.info.name
        );
        if needed <= limit {
            Ok(())
        } else {
            Err(Error::Limit { what, needed: needed.into(), limit: limit.into(), hint })
        }
    };
    for (axis, size) in ["width", "height", "depth"].iter().zip(desc.dims) {
        limit(format!("{what}: {axis} in texels"), size, max)?;
    }
    limit(format!("{what}: layers"), desc.layers, gpu.info.max_image_layers)?;
    let kind = if desc.kind == ImageKind::D2 { vk::ImageType::TYPE_2D } else { vk::ImageType::TYPE_3D };
    // SAFETY: `physical` belongs to `instance`.
    let supported = unsafe {
        gpu.instance.get_physical_device_image_format_properties(
            gpu.physical,
            desc.format.vk(),
            kind,
            vk::ImageTiling::OPTIMAL,
            usage(desc, more),
            vk::ImageCreateFlags::empty(),
        )
    };
    supported.map(drop).map_err(|result| Error::Device {
        problem: format!(
            "{what}: {} cannot use format {:?} for {:?} ({result})",
            gpu.info.name,
            desc.format,
            usage(desc, more)
        ),
    })
}

impl Image {
    /// Name given at creation.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Description given at creation.
    pub fn desc(&self) -> &ImageDesc {
        &self.0.desc
    }
}

impl ImageInner {
    /// Neither memory nor views yet.
    pub(crate) fn bare(gpu: &Arc<Inner>, name: &str, desc: &ImageDesc, raw: vk::Image) -> Self {
        Self {
            gpu: gpu.clone(),
            id: Inner::new_id(),
            name: name.into(),
            desc: *desc,
            raw,
            whole: vk::ImageView::null(),
            layers: Vec::new(),
            layout: vk::ImageLayout::GENERAL,
            host: None,
            memory: None,
        }
    }

    /// Of all of it and, flat, of each layer.
    pub(crate) fn make_views(&mut self) -> Result<()> {
        let flat = self.desc.kind == ImageKind::D2;
        self.whole = self.view(0, self.desc.layers, flat)?;
        for layer in 0..if flat { self.desc.layers } else { 0 } {
            let view = self.view(layer, 1, false)?;
            self.layers.push(view);
        }
        Ok(())
    }

    fn view(&self, first: u32, count: u32, array: bool) -> Result<vk::ImageView> {
        let create = vk::ImageViewCreateInfo::default()
            .image(self.raw)
            .format(self.desc.format.vk())
            .view_type(match (self.desc.kind, array) {
                (ImageKind::D3, _) => vk::ImageViewType::TYPE_3D,
                (ImageKind::D2, true) => vk::ImageViewType::TYPE_2D_ARRAY,
                (ImageKind::D2, false) => vk::ImageViewType::TYPE_2D,
            })
            .subresource_range(vk::ImageSubresourceRange {
                // A view shows depth or stencil; only depth is of use here.
                aspect_mask: self.desc.format.seen(),
                base_array_layer: first,
                layer_count: count,
                ..self.all()
            });
        // SAFETY: the image is alive, has memory, and the layers are its own.
        let view = unsafe { self.gpu.device.create_image_view(&create, None) };
        let view = view.map_err(vulkan("vkCreateImageView", &self.name))?;
        self.gpu.set_name(view, &self.name);
        Ok(view)
    }

    /// All layers.
    pub fn all(&self) -> vk::ImageSubresourceRange {
        vk::ImageSubresourceRange {
            aspect_mask: self.desc.format.aspect(),
            base_mip_level: 0,
            level_count: 1,
            base_array_layer: 0,
            layer_count: self.desc.layers,
        }
    }
}

impl Drop for ImageInner {
    fn drop(&mut self) {
        self.gpu.hazards().remove(self.id);
        // SAFETY: ours, and nothing recorded refers to them: recorders hold an `Arc` until their commands have run. Null is allowed.
        unsafe {
            for view in self.layers.drain(..).chain([self.whole]) {
                self.gpu.device.destroy_image_view(view, None);
            }
            if self.host.is_none() {
                self.gpu.device.destroy_image(self.raw, None);
            }
        }
        if let Some(memory) = self.memory.take() {
            self.gpu.memory.free(memory);
        }
    }
}

/// How to sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SamplerDesc {
    /// Interpolate between texels, else take the nearest.
    pub linear: bool,
    /// Outside the image everything is 0 (transparent black), else the border texel goes on.
    pub border_zero: bool,
}

/// A sampler.
pub struct Sampler(pub(crate) Arc<SamplerInner>);

pub(crate) struct SamplerInner {
    pub gpu: Arc<Inner>,
    pub raw: vk::Sampler,
}

impl Gpu {
    /// A sampler for normalised coordinates, without mip levels.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the device refuses.
    pub fn sampler(&self, name: &str, desc: SamplerDesc) -> Result<Sampler> {
        let filter = if desc.linear { vk::Filter::LINEAR } else { vk::Filter::NEAREST };
        let mode = if desc.border_zero {
            vk::SamplerAddressMode::CLAMP_TO_BORDER
        } else {
            vk::SamplerAddressMode::CLAMP_TO_EDGE
        };
        let create = vk::SamplerCreateInfo::default()
            .mag_filter(filter)
            .min_filter(filter)
            .mipmap_mode(vk::SamplerMipmapMode::NEAREST)
            .address_mode_u(mode)
            .address_mode_v(mode)
            .address_mode_w(mode)
            .border_color(vk::BorderColor::FLOAT_TRANSPARENT_BLACK);
        // SAFETY: the device is alive.
        let raw = unsafe { self.0.device.create_sampler(&create, None) }
            .map_err(vulkan("vkCreateSampler", name))?;
        self.0.set_name(raw, name);
        Ok(Sampler(Arc::new(SamplerInner { gpu: self.0.clone(), raw })))
    }
}

impl Drop for SamplerInner {
    fn drop(&mut self) {
        // SAFETY: ours, and nothing recorded refers to it: recorders hold an `Arc` until their commands have run.
        unsafe { self.gpu.device.destroy_sampler(self.raw, None) };
    }
}
