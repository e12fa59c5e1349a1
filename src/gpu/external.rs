//! Images of a host: its swapchain's, its render targets, its depth. Used as they are, never destroyed here. And the only place with barriers
//! for single images: [`Recorder::acquire`] takes a host's over in the state that the host left it in, [`Recorder::release`] gives it back in
//! the state that the host wants next, [`Recorder::discard`] begins one of ours.

use super::{
    Gpu, Image, ImageDesc, ImageKind, ImageUse, Recorder,
    device::Inner,
    format::VulkanFormat,
    image::{ImageInner, check},
};
use crate::{Error, Result};
use ash::vk;
use std::sync::Arc;

/// How a host holds an image before it lends it, or wants it afterwards: one side of a barrier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageState {
    /// Layout. Before, `UNDEFINED` gives up what the image holds.
    pub layout: vk::ImageLayout,
    /// Stages of the host that touched it last, or touch it next.
    pub stages: vk::PipelineStageFlags2,
    /// How they did, or will.
    pub access: vk::AccessFlags2,
    /// The queue family that owns it there, if it is another than the one of the recording: then the host records the other half of the
    /// transfer, with the same layouts.
    pub queue_family: Option<u32>,
}

impl ImageState {
    /// A colour attachment, written by drawing: what OpenXR's runtimes hand out and take back.
    pub const COLOUR_ATTACHMENT: Self = Self {
        layout: vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
        stages: vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
        access: vk::AccessFlags2::from_raw(
            vk::AccessFlags2::COLOR_ATTACHMENT_READ.as_raw()
                | vk::AccessFlags2::COLOR_ATTACHMENT_WRITE.as_raw(),
        ),
        queue_family: None,
    };
    /// A depth attachment, likewise.
    pub const DEPTH_ATTACHMENT: Self = Self {
        layout: vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
        stages: vk::PipelineStageFlags2::from_raw(
            vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS.as_raw()
                | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS.as_raw(),
        ),
        access: vk::AccessFlags2::from_raw(
            vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_READ.as_raw()
                | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE.as_raw(),
        ),
        queue_family: None,
    };
}

/// An image of a host, flat, of one sample and one level.
#[derive(Debug, Clone, Copy)]
pub struct Lent {
    /// The host's handle.
    pub image: vk::Image,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Layers.
    pub layers: u32,
    /// Format that it was made with.
    pub format: super::Format,
    /// What it is used for here; the host made it for that. [`ImageUse::ATTACHMENT`] or [`ImageUse::SAMPLED`] alone keeps it in the
    /// layout that is best for that, several keep it in `GENERAL`.
    pub usage: ImageUse,
    /// How the host leaves it.
    pub before: ImageState,
    /// How the host wants it afterwards.
    pub after: ImageState,
}

/// What is kept of a [`Lent`] image.
pub(crate) struct States {
    before: ImageState,
    after: ImageState,
}

impl Gpu {
    /// Takes a host's image for use between [`Recorder::acquire`] and [`Recorder::release`], in as many recordings as wanted. Dropping it
    /// destroys our views and leaves the host's image alone.
    ///
    /// # Safety
    /// The handle must be an image of this device as `lent` says, with one sample and one level, made for the uses named, with memory, and
    /// stay alive until this [`Image`], and the recordings that used it, are gone. When commands run that acquire it, it must be in the
    /// state `before`, and nobody else may use it until they have released it.
    ///
    /// # Errors
    /// [`Error::Config`] for a null handle or an impossible description; [`Error::Limit`], [`Error::Device`] for sizes, formats and uses
    /// that no image of this device has; [`Error::Vulkan`] if the device refuses views of it.
    pub unsafe fn adopt_image(&self, name: &str, lent: &Lent) -> Result<Image> {
        let gpu = &self.0;
        let refuse =
            |problem: &str| Err(Error::Config { what: format!("image {name}"), problem: problem.into() });
        if lent.image == vk::Image::null() {
            return refuse("is a null handle; give an image of the device");
        }
        if lent.after.layout == vk::ImageLayout::UNDEFINED {
            return refuse("is to be left in no layout; name the one that the host wants it in");
        }
        let [width, height] = lent.size;
        let desc = ImageDesc {
            dims: [width, height, 1],
            layers: lent.layers,
            format: lent.format,
            kind: ImageKind::D2,
            usage: lent.usage,
        };
        check(gpu, name, &desc, vk::ImageUsageFlags::empty())?;
        let states = States { before: lent.before, after: lent.after };
        let mut image = ImageInner::bare(gpu, name, &desc, lent.image);
        image.host = Some(states);
        image.layout = layout(&desc);
        gpu.hazards().add_hosts_image(image.id);
        image.make_views()?;
        Ok(Image(Arc::new(image)))
    }
}

/// The layout that suits its uses here.
fn layout(desc: &ImageDesc) -> vk::ImageLayout {
    use vk::ImageLayout as L;
    let depth = desc.format.aspect().contains(vk::ImageAspectFlags::DEPTH);
    match desc.usage {
        ImageUse::ATTACHMENT if depth => L::DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
        ImageUse::ATTACHMENT => L::COLOR_ATTACHMENT_OPTIMAL,
        ImageUse::SAMPLED if depth => L::DEPTH_STENCIL_READ_ONLY_OPTIMAL,
        ImageUse::SAMPLED => L::SHADER_READ_ONLY_OPTIMAL,
        _ => L::GENERAL,
    }
}

impl Recorder {
    /// Gives up an image's content and moves it to the GENERAL layout, in which it stays; once before its first use. It waits for
    /// all that was recorded before, and all that follows waits for it. An image of another device, or of a host, is left alone; its uses
    /// are refused.
    pub fn discard(&mut self, image: &Image) {
        if !Arc::ptr_eq(&image.0.gpu, &self.gpu) || image.0.host.is_some() {
            return;
        }
        let ours = ours(image);
        self.transfer(image, ImageState { layout: vk::ImageLayout::UNDEFINED, ..ours }, ours, None, None);
        self.hazards.discard(image.0.id);
    }

    /// Takes a host's image over: from the state that the host left it in. What follows waits for it.
    ///
    /// # Errors
    /// [`Error::Config`] for an image of our own, or one that is held already.
    pub fn acquire(&mut self, image: &Image) -> Result<()> {
        let states = self.host_states(image)?;
        self.hazards.learn(&self.gpu.hazards(), image.0.id);
        if !self.hazards.is_hosts(image.0.id) {
            return refuse(image, "is held already; release it first");
        }
        let ours = ours(image);
        self.transfer(image, states.before, ours, states.before.queue_family, None);
        self.hazards.take_over(image.0.id);
        Ok(())
    }

    /// Gives a host's image back, in the state that the host wants. What was recorded before comes first.
    ///
    /// # Errors
    /// [`Error::Config`] for an image of our own, or one that is not held.
    pub fn release(&mut self, image: &Image) -> Result<()> {
        let states = self.host_states(image)?;
        self.hazards.learn(&self.gpu.hazards(), image.0.id);
        if self.hazards.is_hosts(image.0.id) {
            return refuse(image, "is not held; acquire it first");
        }
        let ours = ours(image);
        self.transfer(image, ours, states.after, None, states.after.queue_family);
        self.hazards.give_back(image.0.id);
        Ok(())
    }

    fn host_states<'a>(&self, image: &'a Image) -> Result<&'a States> {
        if !Arc::ptr_eq(&image.0.gpu, &self.gpu) {
            return refuse(image, "belongs to another device");
        }
        match &image.0.host {
            Some(states) => Ok(states),
            None => refuse(image, "is our own, which no host lent; it is discarded, not acquired"),
        }
    }

    /// One image's barrier, with a change of layout and, where a family is named, of owner.
    fn transfer(
        &mut self,
        image: &Image,
        from: ImageState,
        to: ImageState,
        from_family: Option<u32>,
        to_family: Option<u32>,
    ) {
        let here = self.gpu.queue_family;
        let differs = [from_family, to_family].into_iter().flatten().any(|family| family != here);
        let family = |of: Option<u32>| if differs { of.unwrap_or(here) } else { vk::QUEUE_FAMILY_IGNORED };
        let barrier = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(from.stages)
            .src_access_mask(from.access)
            .dst_stage_mask(to.stages)
            .dst_access_mask(to.access)
            .old_layout(from.layout)
            .new_layout(to.layout)
            .src_queue_family_index(family(from_family))
            .dst_queue_family_index(family(to_family))
            .image(image.0.raw)
            .subresource_range(image.0.all())];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barrier);
        // SAFETY: `cmd` is recording, outside a rendering pass; the image is alive by the promise of `adopt_image`, and kept.
        unsafe { (self.gpu.v13.cmd_pipeline_barrier2)(self.cmd, &info) };
        self.count(0, 1);
        self.keep(image.0.clone());
    }
}

/// Our side of the barriers: whatever commands do here.
fn ours(image: &Image) -> ImageState {
    ImageState {
        layout: image.0.layout,
        stages: vk::PipelineStageFlags2::ALL_COMMANDS,
        access: vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE,
        queue_family: None,
    }
}

fn refuse<T>(image: &Image, problem: &str) -> Result<T> {
    Err(Error::Config { what: format!("image {}", image.name()), problem: problem.into() })
}

impl Image {
    /// Vulkan's handle, for what a host does with a picture itself. Images of ours are in the GENERAL layout, from their first
    /// [`discard`](Recorder::discard) on; commands of the host's must be ordered after those that write it, and before later recordings.
    /// It is alive as long as this [`Image`].
    pub fn raw(&self) -> vk::Image {
        self.0.raw
    }

    /// A view of all of it: 3D, or a 2D array.
    pub fn raw_view(&self) -> vk::ImageView {
        self.0.whole
    }
}

impl Inner {
    /// Refuses a copy or a clear of an image that a host lent: those are its own.
    pub(crate) fn check_copies(image: &Image) -> Result<()> {
        match image.0.host {
            None => Ok(()),
            Some(_) => refuse(image, "is the host's, which copies and clears it itself"),
        }
    }
}
