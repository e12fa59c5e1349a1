//! Occlusion of a pixel from that of one pixel of each block (AOV §3.2): a joint bilateral mean over 5×5 blocks.

use super::gbuffer::Shown;

/// Blocks along an edge of the kernel.
const TAPS: i64 = 5;

/// 1 − AO of a pixel from `sums`, those of the middle pixel of each block of `step`² pixels; `None` where no block is like it.
pub fn upsampled(
    shown: &[Option<Shown>],
    [width, height]: [u32; 2],
    sums: &[f64],
    step: u32,
    delta: f64,
    [x, y]: [u32; 2],
) -> Option<f64> {
    let here = shown[(y * width + x) as usize]?;
    let blocks = [width.div_ceil(step), height.div_ceil(step)].map(i64::from);
    let (sigma, plane) = (TAPS as f64 / 4.0, 0.1 * delta);
    let (mut sum, mut weights) = (0.0, 0.0);
    for dy in -TAPS / 2..=TAPS / 2 {
        for dx in -TAPS / 2..=TAPS / 2 {
            let [bx, by] = [i64::from(x / step) + dx, i64::from(y / step) + dy];
            if bx < 0 || by < 0 || bx >= blocks[0] || by >= blocks[1] {
                continue;
            }
            let middle = |block: i64, size: u32| (block as u32 * step + step / 2).min(size - 1);
            let [px, py] = [middle(bx, width), middle(by, height)];
            let Some(there) = shown[(py * width + px) as usize] else { continue };
            let away = |p: u32, q: u32| (f64::from(p) - f64::from(q)) / f64::from(step);
            let distance2 = away(px, x).powi(2) + away(py, y).powi(2);
            let off = here.normal.dot(there.place - here.place);
            let alike = here.normal.dot(there.normal).max(0.0).powi(8);
            let weight = (-0.5 * (distance2 / (sigma * sigma) + (off / plane).powi(2))).exp() * alike;
            sum += weight * sums[(by * blocks[0] + bx) as usize].min(1.0);
            weights += weight;
        }
    }
    (weights >= 1e-3).then(|| 1.0 - sum / weights)
}
