//! The host side of each kernel: parameters, bindings, `record`. One file a kernel, named after it; each opens with the
//! equation and its source, what goes in and out, and what it costs.

pub mod brick_distance;
pub mod bricks;
pub mod carve;
pub mod classify;
pub mod clip_bricks;
pub mod clips;
pub mod compare;
pub mod consistency;
pub mod dilate;
pub mod eyes;
pub mod field;
pub mod lao;
pub mod near;
pub mod occupancy;
pub mod opacity;
pub mod past;
pub mod peel;
pub mod raycast;
pub mod reference;
pub mod ssao;
pub mod sweep;
pub mod sweep_list;
pub mod transfer;

use crate::Result;
use crate::gpu::{Access, Buffer, BufferUse, Gpu};

/// Device memory with this content. Uses the device's queue and waits for it.
fn device_buffer(gpu: &Gpu, name: &str, content: &[u8]) -> Result<Buffer> {
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
fn row_of_groups(n: u32) -> [u32; 3] {
    const ROW: u32 = 65535;
    [n.min(ROW), n.div_ceil(ROW), 1]
}
