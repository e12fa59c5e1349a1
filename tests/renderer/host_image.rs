//! Images of the host's own, with its own memory and commands.

use crate::host::Host;
use ash::vk;

/// A flat image that the host made, and a buffer to see what it holds.
pub struct HostImage {
    pub raw: vk::Image,
    memory: vk::DeviceMemory,
    buffer: vk::Buffer,
    buffer_memory: vk::DeviceMemory,
    aspect: vk::ImageAspectFlags,
    size: [u32; 2],
    layers: u32,
    /// Bytes of a texel in the buffer.
    texel: usize,
}

fn everything(layout: vk::ImageLayout) -> (vk::PipelineStageFlags2, vk::AccessFlags2, vk::ImageLayout) {
    let any = vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE;
    (vk::PipelineStageFlags2::ALL_COMMANDS, any, layout)
}

impl HostImage {
    pub fn new(host: &Host, format: vk::Format, texel: usize, size: [u32; 2], layers: u32) -> Self {
        let depth = [vk::Format::D16_UNORM, vk::Format::D32_SFLOAT, vk::Format::D24_UNORM_S8_UINT];
        let stencil = format == vk::Format::D24_UNORM_S8_UINT;
        let (aspect, usage) = match depth.contains(&format) {
            true => (vk::ImageAspectFlags::DEPTH, vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT),
            false => (vk::ImageAspectFlags::COLOR, vk::ImageUsageFlags::COLOR_ATTACHMENT),
        };
        let copies = vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST;
        let create = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(vk::Extent3D { width: size[0], height: size[1], depth: 1 })
            .mip_levels(1)
            .array_layers(layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(usage | copies | vk::ImageUsageFlags::SAMPLED);
        let bytes = (texel * (size[0] * size[1] * layers) as usize) as u64;
        let create_buffer = vk::BufferCreateInfo::default()
            .size(bytes)
            .usage(vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST);
        let device = host.device();
        // SAFETY: the calls follow Vulkan's rules; everything passed lives during its call.
        unsafe {
            let raw = device.create_image(&create, None).unwrap();
            let memory = host.memory(device.get_image_memory_requirements(raw), false);
            device.bind_image_memory(raw, memory, 0).unwrap();
            let buffer = device.create_buffer(&create_buffer, None).unwrap();
            let buffer_memory = host.memory(device.get_buffer_memory_requirements(buffer), true);
            device.bind_buffer_memory(buffer, buffer_memory, 0).unwrap();
            let aspect = if stencil { aspect | vk::ImageAspectFlags::STENCIL } else { aspect };
            Self { raw, memory, buffer, buffer_memory, aspect, size, layers, texel }
        }
    }

    fn barrier(&self, host: &Host, cmd: vk::CommandBuffer, from: vk::ImageLayout, to: vk::ImageLayout) {
        let ((src, src_access, from), (dst, dst_access, to)) = (everything(from), everything(to));
        let barrier = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(src)
            .src_access_mask(src_access)
            .dst_stage_mask(dst)
            .dst_access_mask(dst_access)
            .old_layout(from)
            .new_layout(to)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(self.raw)
            .subresource_range(vk::ImageSubresourceRange {
                aspect_mask: self.aspect,
                base_mip_level: 0,
                level_count: 1,
                base_array_layer: 0,
                layer_count: self.layers,
            })];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barrier);
        // SAFETY: the command buffer is recording, the image alive.
        unsafe { host.device().cmd_pipeline_barrier2(cmd, &info) };
    }

    fn region(&self) -> vk::BufferImageCopy {
        vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                // Depth alone of a format with stencil.
                aspect_mask: match self.aspect {
                    vk::ImageAspectFlags::COLOR => self.aspect,
                    _ => vk::ImageAspectFlags::DEPTH,
                },
                mip_level: 0,
                base_array_layer: 0,
                layer_count: self.layers,
            })
            .image_extent(vk::Extent3D { width: self.size[0], height: self.size[1], depth: 1 })
    }

    /// Has the commands fill the image with these texels, all layers one after the other, and leave it in a layout.
    pub fn fill(&self, host: &Host, cmd: vk::CommandBuffer, texels: &[u8], layout: vk::ImageLayout) {
        assert_eq!(texels.len(), self.texel * (self.size[0] * self.size[1] * self.layers) as usize);
        // SAFETY: the memory is the host's own, visible and large enough; nothing on the device uses it now.
        unsafe {
            let to = host.device().map_memory(self.buffer_memory, 0, vk::WHOLE_SIZE, Default::default());
            std::ptr::copy_nonoverlapping(texels.as_ptr(), to.unwrap().cast(), texels.len());
            host.device().unmap_memory(self.buffer_memory);
        }
        let middle = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        self.barrier(host, cmd, vk::ImageLayout::UNDEFINED, middle);
        // SAFETY: the command buffer is recording, buffer and image are alive and fit.
        unsafe {
            host.device().cmd_copy_buffer_to_image(cmd, self.buffer, self.raw, middle, &[self.region()]);
        }
        self.barrier(host, cmd, middle, layout);
    }

    /// Has the commands copy the image, which they find in a layout, to where [`Self::texels`] reads it.
    pub fn copy(&self, host: &Host, cmd: vk::CommandBuffer, layout: vk::ImageLayout) {
        let middle = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        self.barrier(host, cmd, layout, middle);
        // SAFETY: the command buffer is recording, buffer and image are alive and fit.
        unsafe {
            host.device().cmd_copy_image_to_buffer(cmd, self.raw, middle, self.buffer, &[self.region()]);
        }
    }

    /// What was copied, once the commands have run.
    pub fn texels(&self, host: &Host) -> Vec<u8> {
        let bytes = self.texel * (self.size[0] * self.size[1] * self.layers) as usize;
        let mut texels = vec![0; bytes];
        // SAFETY: the memory is the host's own and coherent; the device has written it.
        unsafe {
            let from = host.device().map_memory(self.buffer_memory, 0, vk::WHOLE_SIZE, Default::default());
            std::ptr::copy_nonoverlapping(from.unwrap().cast(), texels.as_mut_ptr(), bytes);
            host.device().unmap_memory(self.buffer_memory);
        }
        texels
    }

    pub fn destroy(self, host: &Host) {
        let device = host.device();
        // SAFETY: nothing uses them any more.
        unsafe {
            device.destroy_image(self.raw, None);
            device.free_memory(self.memory, None);
            device.destroy_buffer(self.buffer, None);
            device.free_memory(self.buffer_memory, None);
        }
    }
}
