//! The volume on the device: `V` as a 3D texture, 8 and 16 bits as they are, everything else as f32.
//!
//! `value = texel · scale + bias`: unsigned and signed 8- and 16-bit integers become UNORM texels, which hold every
//! stored value exactly; the file's slope and intercept go into `scale` and `bias`. 32- and 64-bit values are rounded to
//! f32, the one loss there is. Devices need not filter 16-bit UNORM texels; where one cannot, 16-bit values become f32 texels.

pub mod bricks;
pub mod commit;
pub mod features;
pub mod near;
pub mod occupancy;
pub mod ones;
pub mod opacity;
pub mod transfer;

use crate::{Error, Result};
use cao_gpu::{Access, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse};
use cao_model::values::Values;
use cao_model::volume::Volume;

pub use cao_kernels::shared::bricks::BRICK;

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
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] as [`Volume::check`], [`cao_model::Error::Limit`] for more bricks than 32 bits count,
    /// [`cao_gpu::Error`] beyond the device's sizes or memory.
    pub fn upload(gpu: &Gpu, volume: &Volume) -> Result<Self> {
        let dims = dims(volume)?;
        volume.check()?;
        let (format, scale, bias, levels) = coding(gpu, volume);
        let image = gpu.image(
            "volume",
            &ImageDesc { dims, layers: 1, format, kind: ImageKind::D3, usage: ImageUse::SAMPLED },
        )?;

        let mut rec = gpu.recorder("upload")?;
        rec.discard(&image);
        rec.submit_and_wait()?;
        copy(gpu, &image, [0; 3], volume)?;
        Ok(Self { dims, spacing: volume.spacing.map(|s| s as f32), volume: image, scale, bias, levels })
    }

    /// Overwrites the box of voxels that begins at `first` by a volume of the same type. Uses the device's queue and waits for
    /// it.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] as [`Volume::check`], if the box is not inside, or if the values are stored or rescaled in another way.
    pub fn overwrite(&self, gpu: &Gpu, first: [u32; 3], values: &Volume) -> Result<()> {
        let refuse = |problem: String| Err(Error::refused("new values", problem));
        values.check()?;
        let end = |i: usize| (first[i] as usize).checked_add(values.dims[i]);
        let inside = (0..3).all(|i| end(i).is_some_and(|end| end <= self.dims[i] as usize));
        if !inside {
            return refuse(format!("{:?} voxels at {first:?} of {:?}", values.dims, self.dims));
        }
        let own = (self.volume.desc().format, self.scale, self.bias, self.levels);
        let given = coding(gpu, values);
        if given != own {
            return refuse(format!("stored as {given:?} (format, scale, bias, levels); expected {own:?}"));
        }
        copy(gpu, &self.volume, first, values)
    }

    /// Bricks along x, y, z.
    pub fn bricks(&self) -> [u32; 3] {
        self.dims.map(|d| d.div_ceil(BRICK))
    }

    /// Number of bricks.
    pub fn brick_count(&self) -> u32 {
        self.bricks().iter().product()
    }

    /// Refuses more voxels than kernels count in 32 bits.
    pub fn countable(&self) -> cao_gpu::Result<()> {
        let voxels = self.dims.iter().fold(1u64, |product, n| product.saturating_mul(u64::from(*n)));
        match u32::try_from(voxels) {
            Ok(_) => Ok(()),
            Err(_) => Err(cao_gpu::Error::Limit {
                what: "counting voxels".into(),
                needed: voxels,
                limit: u32::MAX.into(),
                hint: "choose a smaller volume".into(),
            }),
        }
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

/// Spacings in smallest spacings, rounded to 65536ths: the same in every unit of length, whatever its lengths round, so that no tie of what is
/// made of them turns.
pub fn ratios(spacing: [f32; 3]) -> [f64; 3] {
    let smallest = spacing.into_iter().fold(f32::INFINITY, f32::min);
    spacing.map(|s| (65536.0 * f64::from(s) / f64::from(smallest)).round() / 65536.0)
}

/// Voxels along x, y, z, of which the bricks have numbers of 32 bits.
fn dims(volume: &Volume) -> Result<[u32; 3]> {
    let bricks = volume.dims.map(|d| (d as u64).div_ceil(BRICK.into()));
    let bricks = bricks.into_iter().fold(1u64, u64::saturating_mul);
    let limit = |what: String, needed: u64| cao_model::Error::Limit {
        what,
        needed,
        limit: u32::MAX.into(),
        hint: "choose a smaller volume".into(),
    };
    u32::try_from(bricks).map_err(|_| limit(format!("volume: bricks of {BRICK}³ voxels"), bricks))?;
    let mut dims = [0; 3];
    for (to, from) in dims.iter_mut().zip(volume.dims) {
        *to = u32::try_from(from).map_err(|_| limit("volume: voxels along an axis".into(), from as u64))?;
    }
    Ok(dims)
}

/// Format of the texels that hold a volume, and `scale`, `bias` and `levels` of its [`Field`].
fn coding(gpu: &Gpu, volume: &Volume) -> (Format, f32, f32, f32) {
    let (format, scale, bias) = texel_format(&volume.values, gpu.filters(Format::R16Unorm));
    // Slope and intercept of other types are applied in f64 by `texels`, before the one rounding to f32.
    let rescaled = format == Format::R32Float;
    let (slope, intercept) = if rescaled { (1.0, 0.0) } else { (volume.slope, volume.intercept) };
    (format, (scale * slope) as f32, (bias * slope + intercept) as f32, scale as f32)
}

/// Writes a volume's texels into the box of an image that begins at `first`, whole slices at a time, at most 64 MiB of
/// staging.
fn copy(gpu: &Gpu, image: &Image, [x, y, z]: [u32; 3], volume: &Volume) -> Result<()> {
    let format = image.desc().format;
    let dims = dims(volume)?;
    let slice = volume.dims[0] * volume.dims[1];
    let slice_bytes = slice as u64 * format.bytes();
    let slices = ((64 << 20) / slice_bytes.max(1)).clamp(1, u64::from(dims[2])) as u32;
    let staging = gpu.buffer("volume staging", slice_bytes * u64::from(slices), BufferUse::Upload)?;
    let mut first = 0;
    while first < dims[2] {
        let count = slices.min(dims[2] - first);
        let range = first as usize * slice..(first + count) as usize * slice;
        staging.write(0, &texels(volume, format, range))?;
        let mut rec = gpu.recorder("upload")?;
        rec.barrier(&[Access::SampledRead, Access::GraphicsRead], &[Access::TransferWrite]);
        rec.copy_buffer_to_image(&staging, 0, image, [x, y, z + first], [dims[0], dims[1], count])?;
        rec.submit_and_wait()?;
        first += count;
    }
    Ok(())
}

/// Format, scale and bias of the texels that hold these values, with and without a device that filters `R16Unorm`.
fn texel_format(values: &Values, r16_ok: bool) -> (Format, f64, f64) {
    match values {
        Values::U8(_) => (Format::R8Unorm, 255.0, 0.0),
        Values::I8(_) => (Format::R8Unorm, 255.0, -128.0),
        Values::U16(_) if r16_ok => (Format::R16Unorm, 65535.0, 0.0),
        Values::I16(_) if r16_ok => (Format::R16Unorm, 65535.0, -32768.0),
        _ => (Format::R32Float, 1.0, 0.0),
    }
}

fn texels(volume: &Volume, format: Format, range: std::ops::Range<usize>) -> Vec<u8> {
    match (&volume.values, format) {
        (Values::U8(v), Format::R8Unorm) => v[range].to_vec(),
        (Values::I8(v), Format::R8Unorm) => v[range].iter().map(|v| (*v as u8) ^ 0x80).collect(),
        (Values::U16(v), Format::R16Unorm) => bytemuck::cast_slice(&v[range]).to_vec(),
        (Values::I16(v), Format::R16Unorm) => {
            v[range].iter().flat_map(|v| ((*v as u16) ^ 0x8000).to_ne_bytes()).collect()
        }
        // Beyond the largest number of 32 bits a transfer function goes on as it is there.
        _ => range.flat_map(|i| (volume.value(i) as f32).clamp(f32::MIN, f32::MAX).to_ne_bytes()).collect(),
    }
}

/// A 3D image of the field's size that kernels sample and store to.
pub fn volume_image(gpu: &Gpu, name: &str, field: &Field, format: Format) -> cao_gpu::Result<Image> {
    volume_of(gpu, name, field.dims, format)
}

/// One of another size.
pub fn volume_of(gpu: &Gpu, name: &str, dims: [u32; 3], format: Format) -> cao_gpu::Result<Image> {
    let usage = ImageUse::SAMPLED | ImageUse::STORAGE;
    gpu.image(name, &ImageDesc { dims, layers: 1, format, kind: ImageKind::D3, usage })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a kernel makes of the texels of this volume: `texel · scale + bias`, before slope and intercept.
    fn decoded(values: Values, r16_ok: bool) -> (Format, Vec<f64>) {
        let (format, scale, bias) = texel_format(&values, r16_ok);
        let volume = Volume::new([values.len(), 1, 1], [1.0; 3], values).unwrap();
        let bytes = texels(&volume, format, 0..volume.len());
        let stored: Vec<f64> = match format {
            Format::R8Unorm => bytes.iter().map(|&b| f64::from(b) / 255.0).collect(),
            Format::R16Unorm => bytemuck::pod_collect_to_vec::<u8, u16>(&bytes)
                .iter()
                .map(|&t| f64::from(t) / 65535.0)
                .collect(),
            _ => bytemuck::pod_collect_to_vec::<u8, f32>(&bytes).iter().map(|&t| f64::from(t)).collect(),
        };
        (format, stored.iter().map(|t| (t * scale + bias).round()).collect())
    }

    #[test]
    fn values_of_8_and_16_bits_survive_with_and_without_a_filter_for_16_bits() {
        let unsigned = Values::U16(vec![0, 1, 32767, 65535]);
        let signed = Values::I16(vec![-32768, -1000, 0, 32767]);
        for (r16_ok, format) in [(true, Format::R16Unorm), (false, Format::R32Float)] {
            assert_eq!(decoded(unsigned.clone(), r16_ok), (format, vec![0.0, 1.0, 32767.0, 65535.0]));
            assert_eq!(decoded(signed.clone(), r16_ok), (format, vec![-32768.0, -1000.0, 0.0, 32767.0]));
            let bytes = Values::I8(vec![-128, 0, 127]);
            assert_eq!(decoded(bytes, r16_ok), (Format::R8Unorm, vec![-128.0, 0.0, 127.0]));
        }
    }
}
