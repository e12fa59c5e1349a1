//! What the host sides of kernels share.

use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu};

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
    const ROW: u32 = 65535;
    [n.min(ROW), n.div_ceil(ROW), 1]
}
