//! Bricks that can show anything: occupied ⇔ max TF_o(v) > 0 over the values v that a sample in the brick can
//! interpolate, which lie between the smallest and the largest of its voxels and their neighbours.

use crate::field::bricks::{EDGE, bricks};
use crate::{Grid, each};
use cao_model::transfer::TransferFunction;

/// Whether each brick of [`bricks`] can hold a sample with opacity, from the volume's data values, x fastest.
pub fn occupancy(grid: &Grid, values: &[f32], transfer: &TransferFunction) -> Vec<bool> {
    let bricks = bricks(grid);
    each(bricks.len(), |brick| {
        let brick = bricks.voxel(brick);
        // One voxel of border: a sample up to half a voxel outside the brick's centres reads it.
        let range = |axis: usize| {
            let first = brick[axis] * EDGE;
            first.saturating_sub(1)..(first + EDGE + 1).min(grid.dims[axis])
        };
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let value = values[grid.index([x, y, z])];
                    (low, high) = (low.min(value), high.max(value));
                }
            }
        }
        transfer.max_opacity_in(low, high) > 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::trilinear_clamped;

    fn peak(low: f32, top: f32, high: f32) -> TransferFunction {
        let opacity = vec![[low, 0.0], [top, 0.8], [high, 0.0]];
        TransferFunction::new(opacity, vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap()
    }

    /// Samples every quarter voxel: one with opacity never lies in an empty brick.
    #[test]
    fn no_sample_with_opacity_lies_in_an_empty_brick() {
        let mut random = Random(31);
        let mut counts = [0, 0];
        for dims in [[17, 9, 8], [1, 24, 3], [8, 8, 20]] {
            let grid = Grid { dims, spacing: [1.0; 3] };
            for _ in 0..6 {
                // Mostly 0 with lone peaks, so that many bricks are empty.
                let values: Vec<f32> = (0..grid.len())
                    .map(|_| if random.unit() < 0.004 { random.within(-1.0, 1.0) } else { 0.0 })
                    .collect();
                let transfer = peak(0.3, 0.4, 0.5);
                let occupied = occupancy(&grid, &values, &transfer);
                occupied.iter().for_each(|&o| counts[usize::from(o)] += 1);
                let steps = |axis: usize| (0..4 * dims[axis]).map(|i| i as f64 / 4.0 - 0.375);
                for z in steps(2) {
                    for y in steps(1) {
                        for x in steps(0) {
                            let at = [x, y, z];
                            let value = trilinear_clamped(&grid, &values, at);
                            let brick = at.map(|c| c.max(0.0) as usize / EDGE);
                            let seen = transfer.opacity_at(value as f32) > 0.0;
                            assert!(!seen || occupied[bricks(&grid).index(brick)], "{at:?}");
                        }
                    }
                }
            }
        }
        assert!(counts[0] > 10 && counts[1] > 10, "{counts:?}");
    }

    /// No voxel lies in the peak, but values between neighbours do: also across the border of bricks.
    #[test]
    fn values_between_voxels_count() {
        let grid = Grid { dims: [24, 8, 8], spacing: [1.0; 3] };
        let step = |edge: usize| -> Vec<f32> {
            (0..grid.len()).map(|i| if grid.voxel(i)[0] < edge { 0.0 } else { 1.0 }).collect()
        };
        assert_eq!(occupancy(&grid, &step(4), &peak(0.3, 0.4, 0.5)), [true, false, false]);
        assert_eq!(occupancy(&grid, &step(8), &peak(0.3, 0.4, 0.5)), [true, true, false]);
        assert_eq!(occupancy(&grid, &step(4), &peak(1.3, 1.4, 1.5)), [false, false, false]);
    }
}
