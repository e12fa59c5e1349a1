//! The runtime's images, which its compositor shows: colour, and depth where it takes that; a layer an eye.

use crate::placement::{FAR_M, NEAR_M};
use crate::readback::LAYERS;
use crate::runtime::{Runtime, VIEWS};
use anyhow::{Context, Result, bail};
use ash::vk::{self, Handle};
use cao::gpu::{Format, Gpu, Image, ImageState, ImageUse, Lent};
use cao::renderer::{Place, Target};
use openxr as xr;

/// A swapchain and its images, which `cao` borrows.
struct Chain {
    /// Before the swapchain, and so dropped before it: views of images that are its own.
    images: Vec<Image>,
    handle: xr::Swapchain<xr::Vulkan>,
    /// The one that is ours until it is released.
    current: usize,
}

impl Chain {
    fn new(session: &xr::Session<xr::Vulkan>, gpu: &Gpu, kind: &Kind, size: [u32; 2]) -> Result<Self> {
        let handle = session.create_swapchain(&xr::SwapchainCreateInfo {
            create_flags: xr::SwapchainCreateFlags::EMPTY,
            // To be drawn to, and for the check to be read.
            usage_flags: kind.usage | xr::SwapchainUsageFlags::TRANSFER_SRC,
            format: kind.vulkan.as_raw() as u32,
            sample_count: 1,
            width: size[0],
            height: size[1],
            face_count: 1,
            array_size: LAYERS,
            mip_count: 1,
        })?;
        let lend = |image| {
            let lent = Lent {
                image: vk::Image::from_raw(image),
                size,
                layers: LAYERS,
                format: kind.format,
                usage: ImageUse::ATTACHMENT,
                // All of it is drawn anew.
                before: ImageState { layout: vk::ImageLayout::UNDEFINED, ..kind.state },
                after: kind.state,
            };
            // SAFETY: an image of the swapchain just made, on this device, as asked for above; it lives as long as the swapchain, which
            // is dropped after `images` and after what was recorded. It is used only while it is acquired.
            unsafe { gpu.adopt_image(kind.name, &lent) }
        };
        let images = handle.enumerate_images()?.into_iter().map(lend).collect::<Result<_, _>>()?;
        Ok(Self { images, handle, current: 0 })
    }

    fn acquire(&mut self) -> Result<()> {
        self.current = self.handle.acquire_image()? as usize;
        Ok(self.handle.wait_image(xr::Duration::INFINITE)?)
    }

    fn current(&self) -> &Image {
        &self.images[self.current]
    }
}

/// What a swapchain holds.
pub(crate) struct Kind {
    name: &'static str,
    vulkan: vk::Format,
    pub format: Format,
    usage: xr::SwapchainUsageFlags,
    /// In which the runtime wants its images back.
    state: ImageState,
}

/// Light, coded by the format as compositors decode it.
pub(crate) const COLOUR: Kind = Kind {
    name: "colour of the headset",
    vulkan: vk::Format::R8G8B8A8_SRGB,
    format: Format::Rgba8Srgb,
    usage: xr::SwapchainUsageFlags::COLOR_ATTACHMENT,
    state: ImageState::COLOUR_ATTACHMENT,
};
const DEPTH: Kind = Kind {
    name: "depth of the headset",
    vulkan: vk::Format::D32_SFLOAT,
    format: Format::D32Float,
    usage: xr::SwapchainUsageFlags::DEPTH_STENCIL_ATTACHMENT,
    state: ImageState::DEPTH_ATTACHMENT,
};

/// The images of a frame.
pub(crate) struct Images<'a> {
    pub colour: &'a Image,
    pub depth: Option<&'a Image>,
}

impl<'a> Images<'a> {
    pub fn all(&self) -> impl Iterator<Item = &'a Image> + use<'a> {
        [self.colour].into_iter().chain(self.depth)
    }

    /// A layer an eye.
    pub fn targets(&self) -> [Target<'a>; 2] {
        [0, 1].map(|layer| {
            let place = |image| Place { image, layer, at: [0; 2] };
            Target { colour: place(self.colour), depth: self.depth.map(place), scene: None }
        })
    }
}

/// Both swapchains.
pub struct Targets {
    colour: Chain,
    depth: Option<Chain>,
    /// Pixels of an eye.
    pub size: [u32; 2],
}

impl Targets {
    /// As large as the runtime recommends for the larger eye.
    ///
    /// # Errors
    /// Not two views, no sRGB; the runtime's.
    pub fn new(runtime: &Runtime, session: &xr::Session<xr::Vulkan>, gpu: &Gpu) -> Result<Self> {
        let views = runtime.instance.enumerate_view_configuration_views(runtime.system, VIEWS)?;
        let sizes: Vec<_> = views
            .iter()
            .map(|view| [view.recommended_image_rect_width, view.recommended_image_rect_height])
            .collect();
        let [left, right] = sizes[..] else {
            bail!("{} views, expected one for each of two eyes", sizes.len())
        };
        let size = [left[0].max(right[0]), left[1].max(right[1])];
        let formats = session.enumerate_swapchain_formats()?;
        let offered = |kind: &Kind| formats.contains(&(kind.vulkan.as_raw() as u32));
        if !offered(&COLOUR) {
            bail!("the runtime shows no images of {:?}, which this program draws", COLOUR.vulkan);
        }
        let colour = Chain::new(session, gpu, &COLOUR, size)?;
        let depth = runtime.depth && offered(&DEPTH);
        let depth = depth.then(|| Chain::new(session, gpu, &DEPTH, size)).transpose()?;
        Ok(Self { colour, depth, size })
    }

    /// Whether the compositor takes depth.
    pub fn has_depth(&self) -> bool {
        self.depth.is_some()
    }

    /// Takes the images of the next frame, and waits until the compositor no longer reads them.
    pub(crate) fn acquire(&mut self) -> Result<()> {
        self.colour.acquire()?;
        self.depth.as_mut().map(Chain::acquire).transpose()?;
        Ok(())
    }

    /// Those that were acquired.
    pub(crate) fn images(&self) -> Images<'_> {
        Images { colour: self.colour.current(), depth: self.depth.as_ref().map(Chain::current) }
    }

    pub(crate) fn release(&mut self) -> Result<()> {
        self.colour.handle.release_image()?;
        if let Some(depth) = &mut self.depth {
            depth.handle.release_image()?;
        }
        Ok(())
    }

    /// Ends a frame with what was drawn from these eyes.
    pub(crate) fn end(
        &self,
        stream: &mut xr::FrameStream<xr::Vulkan>,
        space: &xr::Space,
        time: xr::Time,
        blend: xr::EnvironmentBlendMode,
        eyes: &[xr::View; 2],
    ) -> Result<()> {
        let rect = xr::Rect2Di {
            offset: xr::Offset2Di { x: 0, y: 0 },
            extent: xr::Extent2Di { width: self.size[0] as i32, height: self.size[1] as i32 },
        };
        let part = |chain: &Chain, eye: u32| {
            xr::SwapchainSubImage::new()
                .swapchain(&chain.handle)
                .image_array_index(eye)
                .image_rect(rect)
                .into_raw()
        };
        let depths = self.depth.as_ref().map(|chain| {
            [0, 1].map(|eye| xr::sys::CompositionLayerDepthInfoKHR {
                ty: xr::sys::CompositionLayerDepthInfoKHR::TYPE,
                next: std::ptr::null(),
                sub_image: part(chain, eye),
                min_depth: 0.0,
                max_depth: 1.0,
                near_z: NEAR_M,
                far_z: FAR_M,
            })
        });
        let views = [0, 1].map(|eye: usize| {
            let view = xr::CompositionLayerProjectionView::<xr::Vulkan>::new()
                .pose(eyes[eye].pose)
                .fov(eyes[eye].fov);
            let mut raw = view.into_raw();
            raw.sub_image = part(&self.colour, eye as u32);
            if let Some(depths) = &depths {
                raw.next = (&raw const depths[eye]).cast();
            }
            // SAFETY: swapchains and depths live until the call below has returned.
            unsafe { xr::CompositionLayerProjectionView::from_raw(raw) }
        });
        let layer = xr::CompositionLayerProjection::new()
            // Opacities lie beside premultiplied colours, for headsets that show what is behind.
            .layer_flags(xr::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA)
            .space(space)
            .views(&views);
        stream.end(time, blend, &[&layer]).context("xrEndFrame")
    }
}
