//! The runtime's images, which its compositor shows: colour, and depth where it takes that; a layer an eye.

use crate::device::Device;
use crate::placement::{FAR_M, NEAR_M};
use crate::readback::LAYERS;
use crate::runtime::{Runtime, VIEWS};
use anyhow::{Context, Result, bail};
use ash::vk::{self, Handle};
use cao::gpu::{Access, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse, Recorder};
use openxr as xr;

/// A swapchain and its images.
struct Chain {
    handle: xr::Swapchain<xr::Vulkan>,
    images: Vec<vk::Image>,
    /// The one that is ours until it is released.
    current: usize,
}

impl Chain {
    fn new(
        session: &xr::Session<xr::Vulkan>,
        format: vk::Format,
        usage: xr::SwapchainUsageFlags,
        [width, height]: [u32; 2],
    ) -> Result<Self> {
        let handle = session.create_swapchain(&xr::SwapchainCreateInfo {
            create_flags: xr::SwapchainCreateFlags::EMPTY,
            usage_flags: usage
                | xr::SwapchainUsageFlags::TRANSFER_SRC
                | xr::SwapchainUsageFlags::TRANSFER_DST,
            format: format.as_raw() as u32,
            sample_count: 1,
            width,
            height,
            face_count: 1,
            array_size: LAYERS,
            mip_count: 1,
        })?;
        let images = handle.enumerate_images()?.into_iter().map(vk::Image::from_raw).collect();
        Ok(Self { handle, images, current: 0 })
    }

    /// Takes the next image, and waits until the compositor no longer reads it.
    fn acquire(&mut self) -> Result<vk::Image> {
        self.current = self.handle.acquire_image()? as usize;
        self.handle.wait_image(xr::Duration::INFINITE)?;
        Ok(self.images[self.current])
    }
}

/// Both swapchains.
pub struct Targets {
    colour: Chain,
    depth: Option<Chain>,
    /// Pixels of an eye.
    pub size: [u32; 2],
    own: [Image; 2],
    device: ash::Device,
}

/// Whose colours the compositor takes as they are: it decodes sRGB by itself.
const COLOUR: vk::Format = vk::Format::R8G8B8A8_SRGB;
const DEPTH: vk::Format = vk::Format::D32_SFLOAT;

impl Targets {
    /// As large as the runtime recommends.
    ///
    /// # Errors
    /// Eyes of different sizes, no sRGB; the runtime's.
    pub fn new(
        runtime: &Runtime,
        session: &xr::Session<xr::Vulkan>,
        device: &Device,
        gpu: &Gpu,
    ) -> Result<Self> {
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
        let offered = |format: vk::Format| formats.contains(&(format.as_raw() as u32));
        if !offered(COLOUR) {
            bail!("the runtime shows no images of {COLOUR:?}, which this program draws");
        }
        let colour = Chain::new(session, COLOUR, xr::SwapchainUsageFlags::COLOR_ATTACHMENT, size)?;
        let with_depth = runtime.depth && offered(DEPTH);
        let depth = with_depth
            .then(|| Chain::new(session, DEPTH, xr::SwapchainUsageFlags::DEPTH_STENCIL_ATTACHMENT, size))
            .transpose()?;
        let own = |format| {
            let (kind, usage) = (ImageKind::D2, ImageUse::ATTACHMENT);
            gpu.image("own", &ImageDesc { dims: [size[0], size[1], 1], layers: 2, format, kind, usage })
        };
        let own = [own(Format::Rgba16Float)?, own(Format::D32Float)?];
        Ok(Self { colour, depth, size, own, device: device.raw.clone() })
    }

    /// Whether the compositor takes depth.
    pub fn has_depth(&self) -> bool {
        self.depth.is_some()
    }

    pub(crate) fn acquire(&mut self) -> Result<()> {
        self.colour.acquire()?;
        self.depth.as_mut().map(Chain::acquire).transpose()?;
        Ok(())
    }

    pub(crate) fn own(&self) -> [&Image; 2] {
        [&self.own[0], &self.own[1]]
    }

    /// The images of this frame: colour, depth.
    pub(crate) fn current(&self) -> (vk::Image, Option<vk::Image>) {
        (self.colour.images[self.colour.current], self.depth.as_ref().map(|d| d.images[d.current]))
    }

    pub(crate) fn prepare(&self, rec: &mut Recorder) {
        rec.discard(&self.own[0]);
        rec.discard(&self.own[1]);
        rec.barrier(&[], &[Access::AttachmentWrite]);
    }

    /// Interim: blits.
    pub(crate) unsafe fn copy(&self, cmd: vk::CommandBuffer) {
        use vk::{AccessFlags2 as A, ImageAspectFlags as I, ImageLayout as L, PipelineStageFlags2 as S};
        let (colour, depth) = self.current();
        let turn = |image, aspect, from: L, to: L| {
            vk::ImageMemoryBarrier2::default()
                .src_stage_mask(S::ALL_COMMANDS)
                .src_access_mask(A::MEMORY_WRITE)
                .dst_stage_mask(S::ALL_COMMANDS)
                .dst_access_mask(A::MEMORY_READ | A::MEMORY_WRITE)
                .old_layout(from)
                .new_layout(to)
                .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .image(image)
                .subresource_range(
                    vk::ImageSubresourceRange::default().aspect_mask(aspect).level_count(1).layer_count(2),
                )
        };
        let mut before = vec![turn(colour, I::COLOR, L::UNDEFINED, L::TRANSFER_DST_OPTIMAL)];
        let mut after = vec![turn(colour, I::COLOR, L::TRANSFER_DST_OPTIMAL, L::COLOR_ATTACHMENT_OPTIMAL)];
        if let Some(depth) = depth {
            before.push(turn(depth, I::DEPTH, L::UNDEFINED, L::TRANSFER_DST_OPTIMAL));
            after.push(turn(depth, I::DEPTH, L::TRANSFER_DST_OPTIMAL, L::DEPTH_STENCIL_ATTACHMENT_OPTIMAL));
        }
        let all = [vk::MemoryBarrier2::default()
            .src_stage_mask(S::ALL_COMMANDS)
            .src_access_mask(A::MEMORY_WRITE)
            .dst_stage_mask(S::ALL_COMMANDS)
            .dst_access_mask(A::MEMORY_READ | A::MEMORY_WRITE)];
        let end = vk::Offset3D { x: self.size[0] as i32, y: self.size[1] as i32, z: 1 };
        let layers = |aspect| vk::ImageSubresourceLayers::default().aspect_mask(aspect).layer_count(2);
        let corners = [vk::Offset3D::default(), end];
        let blit = |aspect| vk::ImageBlit {
            src_subresource: layers(aspect),
            src_offsets: corners,
            dst_subresource: layers(aspect),
            dst_offsets: corners,
        };
        unsafe {
            self.device.cmd_pipeline_barrier2(
                cmd,
                &vk::DependencyInfo::default().image_memory_barriers(&before).memory_barriers(&all),
            );
            let blit = |from: &Image, to, aspect| {
                self.device.cmd_blit_image(
                    cmd,
                    from.raw(),
                    L::GENERAL,
                    to,
                    L::TRANSFER_DST_OPTIMAL,
                    &[blit(aspect)],
                    vk::Filter::NEAREST,
                );
            };
            blit(&self.own[0], colour, I::COLOR);
            if let Some(depth) = depth {
                blit(&self.own[1], depth, I::DEPTH);
            }
            self.device
                .cmd_pipeline_barrier2(cmd, &vk::DependencyInfo::default().image_memory_barriers(&after));
        }
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
            // SAFETY: a builder's call.
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
