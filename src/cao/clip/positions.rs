//! Where a voxel is sampled for CAO eq. (5) beyond its centre and its corners, as kernels read it.

use crate::host::device_buffer;
use cao_gpu::{Buffer, Gpu, Result};
use cao_kernels::shared::clip_opacity::{MOST_SAMPLES, Positions};
use cao_model::settings::AntiAliasing;

const _: () = assert!(MOST_SAMPLES == AntiAliasing::N32 as u32);

/// The table, a uniform buffer. Uses the device's queue and waits for it.
pub fn buffer(gpu: &Gpu) -> Result<Buffer> {
    device_buffer(gpu, "sample positions", bytemuck::bytes_of(&sample_positions()))
}

/// The N extra positions in the voxel's [−1, 1]³: points of the R3 sequence (Roberts 2018), whose every prefix is evenly
/// spread, each followed by its mirror image, so that the mean of every even number of them is the centre.
fn sample_positions() -> Positions {
    const G: f64 = 1.220_744_084_605_759_5;
    let sample = std::array::from_fn(|k| {
        let side = if k % 2 == 0 { 1.0 } else { -1.0 };
        let u = |power: i32| (0.5 + (k / 2 + 1) as f64 / G.powi(power)).fract();
        [1, 2, 3, 0].map(|axis| if axis == 0 { 0.0 } else { (side * (2.0 * u(axis) - 1.0)) as f32 })
    });
    Positions { sample }
}
