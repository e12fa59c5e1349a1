//! Progressive local ambient occlusion, the control of settling: one direction a frame, as Hernell, Ljung and Ynnerman trace it for volumes
//! that change (CAO §5).
//!
//! ```text
//! rolling   A(x) = Σ_k w_k A_k(x)                    A_k as it was when k was last traced, up to K frames ago
//! restart   A(x) = Σ_k w_k A_k(x) / Σ_k w_k          over the directions traced since the last change
//! ```
//!
//! In: the opacities before and after one change. Out: what is shown in each frame from the change on. By the twin; A_k are in 32 bits (the 8 bits of a
//! texture a direction would add up to 1/510 of their own). Memory: two values a voxel and direction. Cost: every ray of both scenes once, then K frames of a
//! few operations a voxel.

use cao_model::occlusion::Occlusion;
use cao_twin::Grid;
use cao_twin::cast::lao::lao_by_direction;

/// What is shown of the directions that were traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// All, as old as they are.
    Rolling,
    /// Those since the change.
    Restart,
}

/// Values along each direction before and after a change, and in which order they are traced.
pub(super) struct Progressive {
    weights: Vec<f64>,
    before: Vec<Vec<f32>>,
    after: Vec<Vec<f32>>,
    order: Vec<usize>,
}

/// What one frame shows.
pub(super) struct Shown {
    /// Largest |A − what all directions would give|.
    pub error: f64,
    /// Largest |A − A of the frame before|.
    pub change: f64,
}

impl Progressive {
    /// Traces every direction in both scenes. Opacities are per mm.
    pub fn new(grid: &Grid, occlusion: &Occlusion, [before, after]: [&[f32]; 2]) -> Self {
        let traced = |opacity| -> (Vec<f64>, Vec<Vec<f32>>) {
            let narrow = |values: Vec<f64>| values.into_iter().map(|v| v as f32).collect();
            lao_by_direction(grid, opacity, occlusion, 1.0).map(|(w, values)| (w, narrow(values))).unzip()
        };
        let (weights, before) = traced(before);
        let (_, after) = traced(after);
        let order = scrambled(weights.len());
        Self { weights, before, after, order }
    }

    /// K.
    pub fn directions(&self) -> usize {
        self.order.len()
    }

    /// What `frames` frames show from the change on, one direction each, at the voxels `of` only. The first is the one in which the clip moved; before it
    /// all were up to date.
    pub fn run(&self, kind: Kind, frames: usize, of: &[usize]) -> Vec<Shown> {
        let sum = |values: &[Vec<f32>], i: usize| -> f64 {
            values.iter().zip(&self.weights).map(|(values, weight)| weight * f64::from(values[i])).sum()
        };
        let truth: Vec<f64> = of.iter().map(|&i| sum(&self.after, i)).collect();
        let mut last: Vec<f64> = of.iter().map(|&i| sum(&self.before, i)).collect();
        let (mut traced, mut weight) = (vec![0.0; of.len()], 0.0);
        let mut stale = last.clone();
        (0..frames)
            .map(|frame| {
                // When all are traced there is nothing left to do.
                if let Some(&k) = self.order.get(frame) {
                    weight += self.weights[k];
                    for (n, &i) in of.iter().enumerate() {
                        traced[n] += self.weights[k] * f64::from(self.after[k][i]);
                        stale[n] -= self.weights[k] * f64::from(self.before[k][i]);
                    }
                }
                let mut shown = Shown { error: 0.0, change: 0.0 };
                for n in 0..of.len() {
                    let value = match kind {
                        Kind::Rolling => traced[n] + stale[n],
                        Kind::Restart => traced[n] / weight,
                    };
                    shown.error = shown.error.max((value - truth[n]).abs());
                    shown.change = shown.change.max((value - last[n]).abs());
                    last[n] = value;
                }
                shown
            })
            .collect()
    }
}

/// 0 … count − 1, neighbours far apart: multiples of the number nearest to the golden section of `count` that shares no factor with it.
fn scrambled(count: usize) -> Vec<usize> {
    let common = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let golden = (count as f64 * 0.618_034).round() as usize;
    let step =
        (0..count).flat_map(|n| [golden + n, golden.saturating_sub(n)]).find(|&s| common(s, count) == 1);
    (0..count).map(|n| n * step.unwrap_or(1) % count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::occlusion::{Quadrature, RaySet};

    #[test]
    fn every_direction_has_its_turn() {
        for count in [1, 2, 6, 14, 26, 50, 54] {
            let mut order = scrambled(count);
            order.sort_unstable();
            assert_eq!(order, (0..count).collect::<Vec<_>>());
        }
    }

    /// An opaque slab appears beside a free voxel: rolling and restart are both right after K frames and not before, and then nothing changes.
    #[test]
    fn a_change_takes_a_frame_for_each_direction() {
        let grid = Grid { dims: [9; 3], spacing: [1.0; 3] };
        let slab: Vec<f32> = (0..grid.len()).map(|i| if grid.voxel(i)[2] > 5 { 1.0 } else { 0.0 }).collect();
        let empty = vec![0.0; grid.len()];
        for rays in [RaySet::R6, RaySet::R26] {
            let occlusion = Occlusion {
                rays,
                quadrature: Quadrature::Left,
                radius_mm: 3.0,
                offset_mm: None,
                step_mm: None,
                ..Occlusion::paper(1.0)
            };
            let scene = Progressive::new(&grid, &occlusion, [&empty, &slab]);
            let count = scene.directions();
            assert_eq!(count, rays.count());
            for kind in [Kind::Rolling, Kind::Restart] {
                let seen = scene.run(kind, count + 3, &[grid.index([4, 4, 5])]);
                assert!(seen[count - 1].error < 1e-12 && seen[0].error > 0.01, "{kind:?} {rays:?}");
                assert!(seen[count..].iter().all(|shown| shown.change < 1e-12 && shown.error < 1e-12));
            }
            // Of no change nothing is seen by the one, while the other begins from one direction.
            let still = Progressive::new(&grid, &occlusion, [&slab, &slab]);
            let at = [grid.index([4, 4, 5])];
            assert!(still.run(Kind::Rolling, count, &at).iter().all(|shown| shown.error < 1e-12));
            assert!(still.run(Kind::Restart, count, &at)[0].error > 0.1);
        }
    }
}
