//! Copies, fills, updates and clears.

use super::{
    Buffer, BufferUse, Image, ImageKind, Recorder,
    access::Access,
    device::Inner,
    format::VulkanFormat,
    hazard::Touch,
    image::{ImageInner, extent},
    shader::Texel,
};
use crate::{Error, Result};
use ash::vk;
use std::ops::Range;

/// Most workgroups along an axis that every device can run at once.
const MOST_GROUPS: u32 = 65535;

/// Most bytes of one vkCmdUpdateBuffer.
const UPDATE_BYTES: usize = 65536;

fn source(buffer: &Buffer, range: Range<u64>) -> Touch<'_> {
    Touch { id: buffer.0.id, name: buffer.name(), via: "source", range, access: Access::TransferRead }
}

fn target(buffer: &Buffer, range: Range<u64>) -> Touch<'_> {
    Touch { id: buffer.0.id, name: buffer.name(), via: "target", range, access: Access::TransferWrite }
}

fn layers<'a>(image: &'a Image, via: &'static str, range: Range<u32>, access: Access) -> Touch<'a> {
    Touch { id: image.0.id, name: image.name(), via, range: range.start.into()..range.end.into(), access }
}

fn refuse<T>(what: String, problem: String) -> Result<T> {
    Err(Error::Config { what, problem })
}

/// Refuses to write a buffer that the device only reads, or to read one that it only writes.
fn check_direction(buffer: &Buffer, forbidden: BufferUse) -> Result<()> {
    if buffer.0.kind != forbidden {
        return Ok(());
    }
    let cannot =
        if forbidden == BufferUse::Upload { "written by the device" } else { "the source of a copy" };
    refuse(format!("buffer {}", buffer.name()), format!("is a {forbidden:?} buffer and cannot be {cannot}"))
}

fn check_multiple_of_four(buffer: &Buffer, offset: u64, size: u64) -> Result<()> {
    if offset.is_multiple_of(4) && size.is_multiple_of(4) && size > 0 {
        return Ok(());
    }
    refuse(
        format!("buffer {}", buffer.name()),
        format!("is set from {offset} for {size} bytes; both must be multiples of 4, the size at least 4"),
    )
}

impl Recorder {
    /// Writes `data` to `offset` (bytes) of a device buffer. For parameters: the bytes travel inside the command buffer.
    ///
    /// # Errors
    /// [`Error::Config`] for a range outside the buffer or not in multiples of 4 bytes, [`Error::Hazard`] for a missing barrier.
    pub fn update(&mut self, buffer: &Buffer, offset: u64, data: &[u8]) -> Result<()> {
        let size = data.len() as u64;
        check_direction(buffer, BufferUse::Upload)?;
        buffer.0.check_range(offset, size)?;
        check_multiple_of_four(buffer, offset, size)?;
        self.order("update", &[target(buffer, offset..offset + size)])?;
        let small = data.chunks_exact(4).all(|word| bytemuck::pod_read_unaligned::<u32>(word) <= MOST_GROUPS);
        self.note_words(buffer.0.id, offset..offset + size, small);
        self.keep(buffer.0.clone());
        let mut at = offset;
        for part in data.chunks(UPDATE_BYTES) {
            // SAFETY: `cmd` is recording, the range is inside the buffer, which is kept.
            unsafe { self.gpu.device.cmd_update_buffer(self.cmd, buffer.0.raw, at, part) };
            at += part.len() as u64;
        }
        Ok(())
    }

    /// Sets `size` bytes from `offset` (bytes) to copies of `value`.
    ///
    /// # Errors
    /// As [`update`](Self::update).
    pub fn fill(&mut self, buffer: &Buffer, offset: u64, size: u64, value: u32) -> Result<()> {
        check_direction(buffer, BufferUse::Upload)?;
        buffer.0.check_range(offset, size)?;
        check_multiple_of_four(buffer, offset, size)?;
        self.order("fill", &[target(buffer, offset..offset + size)])?;
        self.note_words(buffer.0.id, offset..offset + size, value <= MOST_GROUPS);
        self.keep(buffer.0.clone());
        // SAFETY: `cmd` is recording, the range is inside the buffer, which is kept.
        unsafe { self.gpu.device.cmd_fill_buffer(self.cmd, buffer.0.raw, offset, size, value) };
        Ok(())
    }

    /// Copies `size` bytes from `from` at `from_offset` to `to` at `to_offset`.
    ///
    /// # Errors
    /// [`Error::Config`] for ranges outside the buffers, [`Error::Hazard`] for a missing barrier or overlapping ranges.
    pub fn copy_buffer(
        &mut self,
        from: &Buffer,
        from_offset: u64,
        to: &Buffer,
        to_offset: u64,
        size: u64,
    ) -> Result<()> {
        check_direction(from, BufferUse::Readback)?;
        check_direction(to, BufferUse::Upload)?;
        from.0.check_range(from_offset, size)?;
        to.0.check_range(to_offset, size)?;
        if size == 0 {
            return refuse(format!("copy from {} to {}", from.name(), to.name()), "has 0 bytes".into());
        }
        let touches =
            [source(from, from_offset..from_offset + size), target(to, to_offset..to_offset + size)];
        self.order("copy_buffer", &touches)?;
        self.note_words(to.0.id, to_offset..to_offset + size, false);
        self.keep(from.0.clone());
        self.keep(to.0.clone());
        let region = [vk::BufferCopy { src_offset: from_offset, dst_offset: to_offset, size }];
        // SAFETY: `cmd` is recording, the ranges are inside the buffers and do not overlap, both are kept.
        unsafe { self.gpu.device.cmd_copy_buffer(self.cmd, from.0.raw, to.0.raw, &region) };
        Ok(())
    }

    /// Copies texels, x fastest and without gaps, from `offset` (bytes) of `buffer` to the box `origin`, `size` `[x, y, z]` of an
    /// image. For a flat image `origin[2]` is the first layer and `size[2]` the number of layers.
    ///
    /// # Errors
    /// [`Error::Config`] for ranges outside buffer or image, [`Error::Hazard`] for a missing barrier.
    pub fn copy_buffer_to_image(
        &mut self,
        buffer: &Buffer,
        offset: u64,
        image: &Image,
        origin: [u32; 3],
        size: [u32; 3],
    ) -> Result<()> {
        check_direction(buffer, BufferUse::Readback)?;
        Inner::check_copies(image)?;
        let (layer_range, region, bytes) = region(buffer, offset, image, origin, size)?;
        let touches = [
            source(buffer, offset..offset + bytes),
            layers(image, "target", layer_range, Access::TransferWrite),
        ];
        self.order("copy_buffer_to_image", &touches)?;
        self.keep(buffer.0.clone());
        self.keep(image.0.clone());
        // SAFETY: `cmd` is recording, the box is inside the image and its bytes inside the buffer, both are kept.
        unsafe {
            let layout = vk::ImageLayout::GENERAL;
            self.gpu.device.cmd_copy_buffer_to_image(self.cmd, buffer.0.raw, image.0.raw, layout, &[region]);
        }
        Ok(())
    }

    /// Copies the box `origin`, `size` `[x, y, z]` of one layer (0 for a volume) to `offset` (bytes) of `buffer`, x fastest
    /// and without gaps.
    ///
    /// # Errors
    /// As [`copy_buffer_to_image`](Self::copy_buffer_to_image).
    pub fn copy_image_to_buffer(
        &mut self,
        image: &Image,
        layer: u32,
        origin: [u32; 3],
        size: [u32; 3],
        buffer: &Buffer,
        offset: u64,
    ) -> Result<()> {
        check_direction(buffer, BufferUse::Upload)?;
        // A flat image's third coordinate is its layer.
        let flat = image.desc().kind == ImageKind::D2;
        let lone = if flat { origin[2] == 0 && size[2] == 1 } else { layer == 0 };
        if !lone {
            return refuse(
                format!("copy from image {}", image.name()),
                format!("layer {layer} with origin {origin:?} and size {size:?} is not in one layer"),
            );
        }
        let origin = if flat { [origin[0], origin[1], layer] } else { origin };
        Inner::check_copies(image)?;
        let (layer_range, region, bytes) = region(buffer, offset, image, origin, size)?;
        let touches = [
            layers(image, "source", layer_range, Access::TransferRead),
            target(buffer, offset..offset + bytes),
        ];
        self.order("copy_image_to_buffer", &touches)?;
        self.note_words(buffer.0.id, offset..offset + bytes, false);
        self.keep(buffer.0.clone());
        self.keep(image.0.clone());
        // SAFETY: `cmd` is recording, the box is inside the image and its bytes inside the buffer, both are kept.
        unsafe {
            let layout = vk::ImageLayout::GENERAL;
            self.gpu.device.cmd_copy_image_to_buffer(self.cmd, image.0.raw, layout, buffer.0.raw, &[region]);
        }
        Ok(())
    }

    /// Copies a whole image to another of the same size, layers and format.
    ///
    /// # Errors
    /// [`Error::Config`] for images that differ, [`Error::Hazard`] for a missing barrier.
    pub fn copy_image(&mut self, from: &Image, to: &Image) -> Result<()> {
        Inner::check_copies(from)?;
        Inner::check_copies(to)?;
        let (a, b) = (from.desc(), to.desc());
        if (a.dims, a.layers, a.format, a.kind) != (b.dims, b.layers, b.format, b.kind) {
            return refuse(
                format!("copy from image {} to {}", from.name(), to.name()),
                format!(
                    "{:?} × {} {:?} is not {:?} × {} {:?}",
                    a.dims, a.layers, a.format, b.dims, b.layers, b.format
                ),
            );
        }
        let touches = [
            layers(from, "source", 0..a.layers, Access::TransferRead),
            layers(to, "target", 0..a.layers, Access::TransferWrite),
        ];
        self.order("copy_image", &touches)?;
        self.keep(from.0.clone());
        self.keep(to.0.clone());
        let sub = sublayers(&from.0, 0..a.layers);
        let region =
            [vk::ImageCopy::default().src_subresource(sub).dst_subresource(sub).extent(extent(a.dims))];
        // SAFETY: `cmd` is recording, the images are alike, different (or the touches clash) and kept.
        unsafe {
            let layout = vk::ImageLayout::GENERAL;
            self.gpu.device.cmd_copy_image(self.cmd, from.0.raw, layout, to.0.raw, layout, &region);
        }
        Ok(())
    }

    /// Sets every texel: r g b a for colours (rounded for integer formats), the first number, 0 ... 1, for depth.
    ///
    /// # Errors
    /// [`Error::Config`] for another depth, [`Error::Hazard`] for a missing barrier.
    pub fn clear_image(&mut self, image: &Image, value: [f32; 4]) -> Result<()> {
        Inner::check_copies(image)?;
        let depth = match image.desc().format.texel() {
            Texel::Depth => clear_depth(image, value[0])?,
            _ => vk::ClearDepthStencilValue::default(),
        };
        let all = 0..image.desc().layers;
        self.order("clear_image", &[layers(image, "target", all, Access::TransferWrite)])?;
        self.keep(image.0.clone());
        let (range, layout) = ([image.0.all()], vk::ImageLayout::GENERAL);
        let device = &self.gpu.device;
        // SAFETY: `cmd` is recording, the image is kept and in the GENERAL layout.
        unsafe {
            match image.desc().format.texel() {
                Texel::Depth => {
                    device.cmd_clear_depth_stencil_image(self.cmd, image.0.raw, layout, &depth, &range);
                }
                texel => {
                    let value = clear_colour(texel, value);
                    device.cmd_clear_color_image(self.cmd, image.0.raw, layout, &value, &range);
                }
            }
        }
        Ok(())
    }
}

/// A depth to clear to. Vulkan knows none outside 0 ... 1.
pub(crate) fn clear_depth(image: &Image, depth: f32) -> Result<vk::ClearDepthStencilValue> {
    if (0.0..=1.0).contains(&depth) {
        return Ok(vk::ClearDepthStencilValue { depth, stencil: 0 });
    }
    refuse(
        format!("image {}", image.name()),
        format!("is cleared to depth {depth}; a depth is within 0 ... 1"),
    )
}

/// A clear value in the format's own number type.
pub(crate) fn clear_colour(texel: Texel, value: [f32; 4]) -> vk::ClearColorValue {
    match texel {
        Texel::Uint => vk::ClearColorValue { uint32: value.map(|v| v.round() as u32) },
        Texel::Sint => vk::ClearColorValue { int32: value.map(|v| v.round() as i32) },
        Texel::Float | Texel::Depth => vk::ClearColorValue { float32: value },
    }
}

fn sublayers(image: &ImageInner, range: Range<u32>) -> vk::ImageSubresourceLayers {
    vk::ImageSubresourceLayers {
        aspect_mask: image.desc.format.seen(),
        mip_level: 0,
        base_array_layer: range.start,
        layer_count: range.end - range.start,
    }
}

/// Checks a box against image and buffer. Returns the layers, the region and the bytes in the buffer.
fn region(
    buffer: &Buffer,
    offset: u64,
    image: &Image,
    origin: [u32; 3],
    size: [u32; 3],
) -> Result<(Range<u32>, vk::BufferImageCopy, u64)> {
    let desc = image.desc();
    let flat = desc.kind == ImageKind::D2;
    let whole = [desc.dims[0], desc.dims[1], if flat { desc.layers } else { desc.dims[2] }];
    let inside =
        (0..3).all(|i| size[i] > 0 && origin[i].checked_add(size[i]).is_some_and(|end| end <= whole[i]));
    let what = || format!("copy between buffer {} and image {}", buffer.name(), image.name());
    if !inside {
        return refuse(what(), format!("box of {size:?} texels at {origin:?} is not inside {whole:?}"));
    }
    let texel = desc.format.bytes();
    if !offset.is_multiple_of(texel.max(4)) {
        return refuse(
            what(),
            format!("offset {offset} in the buffer must be a multiple of {}", texel.max(4)),
        );
    }
    let bytes = size.iter().fold(texel, |product, n| product.saturating_mul(u64::from(*n)));
    buffer.0.check_range(offset, bytes)?;
    let range = if flat { origin[2]..origin[2] + size[2] } else { 0..1 };
    let (z, depth) = if flat { (0, 1) } else { (origin[2], size[2]) };
    let region = vk::BufferImageCopy::default()
        .buffer_offset(offset)
        .image_subresource(sublayers(&image.0, range.clone()))
        .image_offset(vk::Offset3D { x: origin[0] as i32, y: origin[1] as i32, z: z as i32 })
        .image_extent(extent([size[0], size[1], depth]));
    Ok((range, region, bytes))
}
