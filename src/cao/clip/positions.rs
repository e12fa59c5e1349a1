//! How a cut voxel is sampled (CAO eq. (5)), as kernels read it.

use crate::host::device_buffer;
use cao_gpu::{Buffer, Gpu, Result};
use cao_kernels::shared::clip_opacity::{FEW_SAMPLES, MOST_SAMPLES, Positions, Sampling};
use cao_model::settings::{AntiAliasing, Estimator, Samples};

const _: () = assert!(MOST_SAMPLES == Samples::N32 as u32 && FEW_SAMPLES == Samples::N8 as u32);

/// The settings.
pub fn sampling(of: AntiAliasing) -> Sampling {
    Sampling {
        more: of.samples as u32,
        first: if of.samples == Samples::N8 { MOST_SAMPLES } else { 0 },
        interior: u32::from(of.estimator == Estimator::Interior),
        support: of.support.extent(),
        corner: of.support.corner(),
    }
}

/// The table of further places, a uniform buffer. Uses the device's queue and waits for it.
pub fn buffer(gpu: &Gpu) -> Result<Buffer> {
    device_buffer(gpu, "sample positions", bytemuck::bytes_of(&sample_positions()))
}

/// The N extra positions in [−1, 1]³, whose unit is the support: a lattice of rank 1, (u, a u, b u)/N for odd u, modulo 2 to the middle.
/// Along each axis they are the middles of N equal steps, so that a plane along the axes passes one at a time; with each its mirror
/// image is one, so that their mean is the centre. The factors have the least error for planes in any direction.
fn sample_positions() -> Positions {
    let place = |k: u32, n: u32, factors: [i32; 2]| {
        let u = 2 * (k as i32 / 2) + 1;
        let middle = |v: i32| (v + n as i32).rem_euclid(2 * n as i32) - n as i32;
        let side = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let [x, y, z] = [1, factors[0], factors[1]].map(|factor| side * middle(factor * u) as f32 / n as f32);
        [x, y, z, 0.0]
    };
    let sample = std::array::from_fn(|i| match i as u32 {
        i if i < MOST_SAMPLES => place(i, MOST_SAMPLES, [19, 23]),
        i => place(i - MOST_SAMPLES, FEW_SAMPLES, [5, 7]),
    });
    Positions { sample }
}
