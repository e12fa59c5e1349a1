//! What lies in images of the runtime, read back: commands of our own, beside those of `cao`.

use crate::device::Device;
use anyhow::{Context, Result};
use ash::vk;

/// A buffer that the processor reads, for one image of 4 bytes a pixel and two layers.
pub struct ReadBack<'a> {
    device: &'a Device,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    size: [u32; 2],
}

/// Two eyes.
pub const LAYERS: u32 = 2;

impl<'a> ReadBack<'a> {
    /// For images of this size.
    ///
    /// # Errors
    /// The device's.
    pub fn new(device: &'a Device, size: [u32; 2]) -> Result<Self> {
        let mut made = Self { device, buffer: vk::Buffer::null(), memory: vk::DeviceMemory::null(), size };
        let create =
            vk::BufferCreateInfo::default().size(made.bytes()).usage(vk::BufferUsageFlags::TRANSFER_DST);
        // SAFETY: the device is alive; what fails leaves what was made to the drop.
        unsafe {
            made.buffer = device.raw.create_buffer(&create, None)?;
            let needs = device.raw.get_buffer_memory_requirements(made.buffer);
            let kinds = device.instance.get_physical_device_memory_properties(device.physical);
            let wanted = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            let fits = |i: &u32| {
                needs.memory_type_bits >> i & 1 == 1
                    && kinds.memory_types[*i as usize].property_flags.contains(wanted)
            };
            let kind =
                (0..kinds.memory_type_count).find(fits).context("no memory that the processor reads")?;
            let allocate =
                vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(kind);
            made.memory = device.raw.allocate_memory(&allocate, None)?;
            device.raw.bind_buffer_memory(made.buffer, made.memory, 0)?;
        }
        Ok(made)
    }

    fn bytes(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1]) * u64::from(4 * LAYERS)
    }

    /// Records a copy of an image that is in this layout before and after.
    ///
    /// # Safety
    /// The command buffer must be recording on this device; the image be alive, of this size, two layers and 4 bytes a pixel, made to be
    /// copied from, and in this layout; this must live until the commands have run.
    pub unsafe fn record(
        &self,
        cmd: vk::CommandBuffer,
        image: vk::Image,
        aspect: vk::ImageAspectFlags,
        layout: vk::ImageLayout,
    ) {
        use vk::{AccessFlags2 as A, ImageLayout as L, PipelineStageFlags2 as S};
        let range =
            vk::ImageSubresourceRange::default().aspect_mask(aspect).level_count(1).layer_count(LAYERS);
        let turn = |from: L, to: L| {
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
                .subresource_range(range)
        };
        let [width, height] = self.size;
        let layers = vk::ImageSubresourceLayers::default().aspect_mask(aspect).layer_count(LAYERS);
        let copy = vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D {
            width,
            height,
            depth: 1,
        });
        let to_host = [vk::MemoryBarrier2::default()
            .src_stage_mask(S::ALL_TRANSFER)
            .src_access_mask(A::TRANSFER_WRITE)
            .dst_stage_mask(S::HOST)
            .dst_access_mask(A::HOST_READ)];
        let (before, after) =
            ([turn(layout, L::TRANSFER_SRC_OPTIMAL)], [turn(L::TRANSFER_SRC_OPTIMAL, layout)]);
        let device = &self.device.raw;
        // SAFETY: the caller's promise.
        unsafe {
            device.cmd_pipeline_barrier2(cmd, &vk::DependencyInfo::default().image_memory_barriers(&before));
            device.cmd_copy_image_to_buffer(cmd, image, L::TRANSFER_SRC_OPTIMAL, self.buffer, &[copy]);
            let after = vk::DependencyInfo::default().image_memory_barriers(&after).memory_barriers(&to_host);
            device.cmd_pipeline_barrier2(cmd, &after);
        }
    }

    /// The pixels of the left and of the right eye, once the commands have run.
    ///
    /// # Errors
    /// The device's.
    pub fn pixels(&self) -> Result<[Vec<[u8; 4]>; 2]> {
        let bytes = self.bytes();
        // SAFETY: the memory is as large, coherent, and not mapped elsewhere; the commands that wrote it have run.
        let all: Vec<u8> = unsafe {
            let at = self.device.raw.map_memory(self.memory, 0, bytes, vk::MemoryMapFlags::empty())?;
            let all = std::slice::from_raw_parts(at.cast::<u8>(), bytes as usize).to_vec();
            self.device.raw.unmap_memory(self.memory);
            all
        };
        let (left, right) = all.as_chunks::<4>().0.split_at(bytes as usize / 8);
        Ok([left.to_vec(), right.to_vec()])
    }
}

impl Drop for ReadBack<'_> {
    fn drop(&mut self) {
        // SAFETY: null or of this device; the commands that used them have run.
        unsafe {
            self.device.raw.destroy_buffer(self.buffer, None);
            self.device.raw.free_memory(self.memory, None);
        }
    }
}
