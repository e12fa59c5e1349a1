//! The transfer function on the device (`spirv/shared/transfer.wgsl`): its control points, 2 KiB.

use bytemuck::Zeroable;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Recorder};
use cao_kernels::shared::transfer::{MOST_POINTS, Transfer};
use cao_model::transfer::{MAX_POINTS, TransferFunction};

const _: () = assert!(MOST_POINTS as usize == MAX_POINTS);

/// Control points of a transfer function in device memory.
pub struct TransferBuffer {
    /// Bound as `transfer`.
    pub buffer: Buffer,
}

impl TransferBuffer {
    /// Memory for any transfer function.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { buffer: gpu.buffer("transfer", size_of::<Transfer>() as u64, BufferUse::Device)? })
    }

    /// Writes the control points and makes them visible to all shaders.
    pub fn record(&self, rec: &mut Recorder, function: &TransferFunction) -> Result<()> {
        let mut data = Transfer::zeroed();
        data.opacity_points = function.opacity.len() as u32;
        data.colour_points = function.colour.len() as u32;
        [data.least, data.most] = showing(function);
        for (i, &[value, opacity]) in function.opacity.iter().enumerate() {
            let slope = match function.opacity.get(i + 1) {
                Some(next) if next[0] > value => (next[1] - opacity) / (next[0] - value),
                _ => 0.0,
            };
            data.opacity[i] = [value, opacity, slope, 0.0];
        }
        data.colour[..function.colour.len()].copy_from_slice(&function.colour);
        rec.barrier(&[Access::StorageRead, Access::GraphicsRead], &[Access::TransferWrite]);
        rec.update(&self.buffer, 0, bytemuck::bytes_of(&data))?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::GraphicsRead]);
        Ok(())
    }
}

/// Values up to the first and from the second on have no opacity: the first is not below the second where none has any.
fn showing(function: &TransferFunction) -> [f32; 2] {
    let points = &function.opacity;
    let shows = |point: &[f32; 2]| point[1] > 0.0;
    let (Some(first), Some(last)) = (points.iter().position(shows), points.iter().rposition(shows)) else {
        return [f32::MAX, f32::MIN];
    };
    // Where opacity begins by a step, or ends by one, the value itself has some.
    let beside = |point: usize, other: Option<usize>, past: fn(f32) -> f32, end: f32| match other
        .and_then(|i| points.get(i))
    {
        Some(&[value, _]) if value == points[point][0] => past(value),
        Some(&[value, _]) => value,
        None => end,
    };
    [
        beside(first, first.checked_sub(1), f32::next_down, f32::MIN),
        beside(last, Some(last + 1), f32::next_up, f32::MAX),
    ]
}
