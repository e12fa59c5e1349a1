//! Whether a device's filter keeps more than 8 bits of 8-bit texels: Vulkan does not say, and some drivers round what they
//! interpolate to a texel's own 255 levels, which a steep transfer function magnifies to all of a picture's.

use crate::Result;
use crate::host::read_buffer;
use cao_gpu::{Access, BufferUse, Format, Gpu, ImageDesc, ImageKind, ImageUse, Sampler, SamplerDesc};
use cao_kernels::filter as kernel;

/// Share of a level that a value may be off: weights have 8 bits on GPUs, and halves of one round.
const FINE: f32 = 1.0 / 64.0;

/// Filters between two neighbouring levels, and compares. Uses the device's queue and waits for it.
pub fn keeps_fractions(gpu: &Gpu) -> Result<bool> {
    if gpu.plain() {
        return Ok(false);
    }
    let image = gpu.image(
        "filtered",
        &ImageDesc {
            dims: [2, 1, 1],
            layers: 1,
            format: Format::R8Unorm,
            kind: ImageKind::D3,
            usage: ImageUse::SAMPLED,
        },
    )?;
    let linear: Sampler = gpu.sampler("filter", SamplerDesc { linear: true, border_zero: false })?;
    let texels = gpu.buffer("texels", 4, BufferUse::Upload)?;
    texels.write(0, &[0, 1, 0, 0])?;
    let found = gpu.buffer("found", size_of::<kernel::Found>() as u64, BufferUse::Device)?;
    let pipeline = gpu.compute(&kernel::SHADER, "main")?;
    let mut rec = gpu.recorder("filter")?;
    rec.discard(&image);
    rec.barrier(&[], &[Access::TransferWrite]);
    rec.copy_buffer_to_image(&texels, 0, &image, [0; 3], [2, 1, 1])?;
    rec.barrier(&[Access::TransferWrite], &[Access::SampledRead, Access::StorageWrite]);
    let binds = kernel::MainBindings { texels: &image, linear: &linear, found: &found };
    rec.dispatch(&pipeline, &binds, &[], [1, 1, 1])?;
    rec.submit_and_wait()?;
    let kernel::Found { value } = bytemuck::pod_read_unaligned(&read_buffer(gpu, &found)?);
    let off = |(i, level): (usize, &f32)| (255.0 * level - i as f32 / kernel::STEPS as f32).abs();
    Ok(value.iter().enumerate().map(off).all(|off| off <= FINE))
}
