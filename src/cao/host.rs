//! What the host sides of kernels share.

use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Format, Gpu, Image};
use cao_kernels::shared::bricks::GROUPS_PER_ROW;
use cao_kernels::shared::parts::PARTS;

/// Device memory with this content. Uses the device's queue and waits for it.
pub fn device_buffer(gpu: &Gpu, name: &str, content: &[u8]) -> Result<Buffer> {
    let bytes = content.len() as u64;
    let staging = gpu.buffer("staging", bytes, BufferUse::Upload)?;
    staging.write(0, content)?;
    let buffer = gpu.buffer(name, bytes, BufferUse::Device)?;
    let mut rec = gpu.recorder("upload")?;
    rec.barrier(&[], &[Access::TransferRead, Access::TransferWrite]);
    rec.copy_buffer(&staging, 0, &buffer, 0, bytes)?;
    rec.submit_and_wait()?;
    Ok(buffer)
}

/// Group counts for `n` workgroups when one axis may not hold them all; kernels drop the surplus.
pub fn row_of_groups(n: u32) -> [u32; 3] {
    [n.min(GROUPS_PER_ROW), n.div_ceil(GROUPS_PER_ROW), 1]
}

/// Group counts for `n` invocations of such a kernel, whose workgroups lie along one axis.
pub fn rows_over(n: u32, workgroup: [u32; 3]) -> [u32; 3] {
    row_of_groups(n.div_ceil(workgroup[0]))
}

/// Two structs of kernels that are one to the host: what some kernels read as plain numbers, others write as atomics.
macro_rules! same_layout {
    ($one:ty, $other:ty { $($field:ident),+ }) => {
        const _: () = {
            assert!(size_of::<$one>() == size_of::<$other>());
            $(assert!(::core::mem::offset_of!($one, $field) == ::core::mem::offset_of!($other, $field));)+
        };
    };
}
pub(crate) use same_layout;

/// Texels of a volume, x fastest; slices at a time, a sixteenth of it, so that reading takes little memory. Uses the device's queue and
/// waits for it.
pub fn read_texels(gpu: &Gpu, image: &Image) -> Result<Vec<u8>> {
    let [x, y, z] = image.desc().dims;
    let slice = u64::from(x) * u64::from(y) * image.desc().format.bytes();
    let slices = ((64 << 20) / slice).clamp(1, u64::from(z.div_ceil(16))) as u32;
    let read_back = gpu.buffer("volume read-back", slice * u64::from(slices), BufferUse::Readback)?;
    let mut all = Vec::with_capacity((slice * u64::from(z)) as usize);
    let mut first = 0;
    while first < z {
        let count = slices.min(z - first);
        let mut rec = gpu.recorder("read volume")?;
        rec.copy_image_to_buffer(image, 0, [0, 0, first], [x, y, count], &read_back, 0)?;
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        rec.submit_and_wait()?;
        all.extend(read_back.read(0, slice * u64::from(count))?);
        first += count;
    }
    Ok(all)
}

/// What the texels of an r32float or r16unorm volume stand for, x fastest; of rgba16unorm the least of four. Uses the device's queue and waits for it.
pub fn read_values(gpu: &Gpu, image: &Image) -> Result<Vec<f32>> {
    let texels = read_texels(gpu, image)?;
    Ok(match image.desc().format {
        Format::R16Unorm => bytemuck::pod_collect_to_vec::<u8, u16>(&texels)
            .into_iter()
            .map(|texel| f32::from(texel) / PARTS)
            .collect(),
        Format::Rgba16Unorm => bytemuck::pod_collect_to_vec::<u8, [u16; 4]>(&texels)
            .into_iter()
            .map(|texel| f32::from(texel.into_iter().fold(u16::MAX, u16::min)) / PARTS)
            .collect(),
        _ => bytemuck::pod_collect_to_vec(&texels),
    })
}

/// Red, green and blue of an rgba16unorm volume, x fastest; of one with a single value, r32float or r16unorm, that value thrice. Uses the
/// device's queue and waits for it.
pub fn read_colours(gpu: &Gpu, image: &Image) -> Result<Vec<[f32; 3]>> {
    if image.desc().format != Format::Rgba16Unorm {
        return Ok(read_values(gpu, image)?.into_iter().map(|value| [value; 3]).collect());
    }
    let texels = bytemuck::pod_collect_to_vec::<u8, [u16; 4]>(&read_texels(gpu, image)?);
    Ok(texels.into_iter().map(|[r, g, b, _]| [r, g, b].map(|part| f32::from(part) / PARTS)).collect())
}

/// Content of a buffer. Uses the device's queue and waits for it.
pub fn read_buffer(gpu: &Gpu, buffer: &Buffer) -> Result<Vec<u8>> {
    let read_back = gpu.buffer("read-back", buffer.bytes(), BufferUse::Readback)?;
    let mut rec = gpu.recorder("read buffer")?;
    rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
    rec.copy_buffer(buffer, 0, &read_back, 0, buffer.bytes())?;
    rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    rec.submit_and_wait()?;
    read_back.read(0, buffer.bytes())
}
