//! The volume on the device: `V` as a 3D texture, 8 and 16 bits as they are, everything else as f32.
//!
//! `value = texel · scale + bias`: unsigned and signed 8- and 16-bit integers become UNORM texels, which hold every
//! stored value exactly; the file's slope and intercept go into `scale` and `bias`. 32- and 64-bit values are rounded to
//! f32, the one loss there is.

use crate::Result;
use crate::gpu::{Access, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse};
use crate::volume::{Values, Volume};

/// Edge of a brick in voxels, as the kernels have it.
pub const BRICK: u32 = 8;

/// A volume on the device.
pub struct Field {
    /// Voxels along x, y, z.
    pub dims: [u32; 3],
    /// Distance between voxel centres in mm.
    pub spacing: [f32; 3],
    /// The texels.
    pub volume: Image,
    /// `value = texel · scale + bias`.
    pub scale: f32,
    /// See [`Self::scale`].
    pub bias: f32,
    /// Stored integers of a UNORM texel, 255 or 65535: `stored = round(texel · levels)`; 1 where a texel is the value itself.
    pub levels: f32,
}

impl Field {
    /// Copies a volume to the device through a staging buffer. Uses the device's queue and waits for it.
    pub fn upload(gpu: &Gpu, volume: &Volume) -> Result<Self> {
        let (format, scale, bias) = match &volume.values {
            Values::U8(_) => (Format::R8Unorm, 255.0, 0.0),
            Values::I8(_) => (Format::R8Unorm, 255.0, -128.0),
            Values::U16(_) => (Format::R16Unorm, 65535.0, 0.0),
            Values::I16(_) => (Format::R16Unorm, 65535.0, -32768.0),
            _ => (Format::R32Float, 1.0, 0.0),
        };
        // Slope and intercept of other types are applied in f64 below, before the one rounding to f32.
        let rescaled = format == Format::R32Float;
        let (slope, intercept) = if rescaled { (1.0, 0.0) } else { (volume.slope, volume.intercept) };
        let dims = volume.dims.map(|d| d as u32);
        let image = gpu.image(
            "volume",
            &ImageDesc { dims, layers: 1, format, kind: ImageKind::D3, usage: ImageUse::SAMPLED },
        )?;

        // Whole slices at a time, at most 64 MiB of staging.
        let slice = (dims[0] * dims[1]) as usize;
        let slice_bytes = slice as u64 * format.bytes();
        let slices = ((64 << 20) / slice_bytes.max(1)).clamp(1, u64::from(dims[2])) as u32;
        let staging = gpu.buffer("volume staging", slice_bytes * u64::from(slices), BufferUse::Upload)?;
        let mut first = 0;
        while first < dims[2] {
            let count = slices.min(dims[2] - first);
            let range = first as usize * slice..(first + count) as usize * slice;
            staging.write(0, &texels(volume, range))?;
            let mut rec = gpu.recorder("upload")?;
            if first == 0 {
                rec.discard(&image);
                rec.barrier(&[], &[Access::TransferWrite]);
            }
            rec.copy_buffer_to_image(&staging, 0, &image, [0, 0, first], [dims[0], dims[1], count])?;
            rec.submit_and_wait()?;
            first += count;
        }
        Ok(Self {
            dims,
            spacing: volume.spacing.map(|s| s as f32),
            volume: image,
            scale: (scale * slope) as f32,
            bias: (bias * slope + intercept) as f32,
            levels: scale as f32,
        })
    }

    /// Bricks along x, y, z.
    pub fn bricks(&self) -> [u32; 3] {
        self.dims.map(|d| d.div_ceil(BRICK))
    }

    /// Number of bricks.
    pub fn brick_count(&self) -> u32 {
        self.bricks().iter().product()
    }

    /// Smallest distance between voxel centres in mm.
    pub fn min_spacing(&self) -> f32 {
        self.spacing.into_iter().fold(f32::INFINITY, f32::min)
    }

    /// Length of a voxel's diagonal in mm.
    pub fn diagonal(&self) -> f32 {
        glam::Vec3::from_array(self.spacing).length()
    }
}

fn texels(volume: &Volume, range: std::ops::Range<usize>) -> Vec<u8> {
    match &volume.values {
        Values::U8(v) => v[range].to_vec(),
        Values::I8(v) => v[range].iter().map(|v| (*v as u8) ^ 0x80).collect(),
        Values::U16(v) => bytemuck::cast_slice(&v[range]).to_vec(),
        Values::I16(v) => v[range].iter().flat_map(|v| ((*v as u16) ^ 0x8000).to_ne_bytes()).collect(),
        _ => range.flat_map(|i| (volume.value(i) as f32).to_ne_bytes()).collect(),
    }
}
