//! Rays by brick (method.md §4): every ray in whole numbers, written from the definition.
//!
//! For direction k from voxel x, T = 65535 and S = 0 at o from x, half a step unless an offset is given. Cells m = 1 … M, a step long each,
//! the last half as long; c = o/step − ½:
//!
//! ```text
//! cell of opacity a (65535ths)   T' = (T·(65536 − a − ⌊a/2¹⁵⌋) + 2¹⁵) / 2¹⁶,   S += 2·((T·f(a) + 2¹⁵) / 2¹⁶),   f = a/(−ln(1−a))
//! half a cell, the last cell     S += the same without the 2
//! near cells    a trilinear at x + m + c steps; the first is two halves, of 1 − √(1−a) at ¾ + c and 1¼ + c steps. nearest: none, hybrid: 3,
//!               linear: M; hybrid of M ≤ 3 is linear
//! far cells     a of the voxel x + (round(c·d_k) + m·d_k + 2¹⁵) / 2¹⁶, d_k = a step in 65536ths of a voxel; 0 outside the volume
//! A(x) = 65535 − (Σ_k ⌊(65535·(2M−1) − S_k)·c_k⌋ + 2¹³) / 2¹⁴,   c_k = w_k·2¹⁴/(2M−1) in f32; 65535 where M = 0
//! ```
//!
//! f is a table: 257 values in 65536ths, at a = 256 i / 65535, the nearest is taken. A ray with T < 64 has ended: with `linear` after any
//! cell, with `hybrid` after the near ones and after every second far one, with `nearest` after every fourth, but for those behind the last
//! whole group before M. Lengths are f32, as settings are. w_k are the weights in the light that there is (method.md §2.1); of coloured light each
//! channel has the values of its own grey one.

use crate::{Grid, each, trilinear};
use cao_kernels::rays::{DARK, FEW, MANY, NEAR};
use cao_model::occlusion::{Occlusion, Quadrature};

/// V_AO of every voxel in 65535ths; 65535 where none is needed: where neither the voxel nor a neighbour has opacity, unless `unneeded`.
/// `opacity` is V_o of `reference_mm` in 65535ths.
pub fn rays(
    grid: &Grid,
    opacity: &[u16],
    occlusion: &Occlusion,
    reference_mm: f32,
    unneeded: bool,
) -> Vec<u16> {
    let floats: Vec<f32> = opacity.iter().map(|&a| f32::from(a) / 65535.0).collect();
    let rays = Rays::new(grid, &floats, occlusion, reference_mm);
    each(grid.len(), |i| {
        let voxel = grid.voxel(i);
        let solid = |v: [usize; 3]| opacity[grid.index(v)] > 0;
        if !(unneeded || solid(voxel) || grid.neighbours(voxel).any(solid)) {
            return 65535;
        }
        rays.value(voxel)
    })
}

/// Ambient value of one voxel, whether it needs one or not. The device rounds opacities to 65535ths first.
pub fn rays_at(
    grid: &Grid,
    opacity: &[f32],
    occlusion: &Occlusion,
    reference_mm: f32,
    voxel: [usize; 3],
) -> f64 {
    f64::from(Rays::new(grid, opacity, occlusion, reference_mm).value(voxel)) / 65535.0
}

/// 1 − a; a trilinear opacity of opaque matter is opaque, whatever it rounds.
fn clear(a: f64) -> f64 {
    if 1.0 - a < 1e-6 { 0.0 } else { 1.0 - a }
}

pub(crate) struct Rays<'a> {
    grid: &'a Grid,
    floats: &'a [f32],
    /// f in 65536ths.
    means: Vec<u64>,
    /// A step in voxels, d_k, c_k.
    directions: Vec<([f64; 3], [i32; 3], f32)>,
    /// M.
    cells: u32,
    /// o in steps, less a half.
    shift: f32,
    /// Cells near the voxel, and far ones that a ray's end is looked for after.
    near: u32,
    group: u32,
    exponent: f64,
}

impl<'a> Rays<'a> {
    /// Of opacities in 0 … 1, of `reference_mm`.
    pub(crate) fn new(grid: &'a Grid, floats: &'a [f32], occlusion: &Occlusion, reference_mm: f32) -> Self {
        let spacing = grid.spacing.map(|s| f64::from(s as f32));
        let smallest = spacing.into_iter().fold(f64::INFINITY, f64::min);
        let (cells, step_mm) = (occlusion.samples(smallest), occlusion.step(smallest));
        let halves = f64::from(2 * cells.max(1) - 1);
        let direction = |(d, weight): ([f64; 3], f64)| {
            let step: [f64; 3] = std::array::from_fn(|i| d[i] * f64::from(step_mm) / spacing[i]);
            (step, step.map(|c| (65536.0 * c).round() as i32), (weight * 16384.0 / halves) as f32)
        };
        let mean = |i: u32| {
            let a = f64::from(256 * i) / 65535.0;
            if i == 0 { 65536 } else { (65536.0 * a / -(1.0 - a).ln()).round() as u64 }
        };
        let (near, group) = match occlusion.quadrature {
            Quadrature::Nearest => (0, MANY),
            Quadrature::Hybrid if cells > NEAR => (NEAR, FEW),
            Quadrature::Hybrid | Quadrature::Linear => (cells, 1),
            rule => panic!("{rule:?} is no rule of rays by brick"),
        };
        Self {
            grid,
            floats,
            means: (0..256).map(mean).chain([0]).collect(),
            directions: occlusion.weighted_directions().into_iter().map(direction).collect(),
            cells,
            shift: occlusion.offset_mm.map_or(0.0, |offset| offset / step_mm - 0.5),
            near,
            group,
            exponent: f64::from(step_mm / reference_mm),
        }
    }

    /// Of one voxel in 65535ths, whether it needs one or not.
    pub(crate) fn value(&self, voxel: [usize; 3]) -> u16 {
        if self.cells == 0 {
            return 65535;
        }
        let whole = 65535 * u64::from(2 * self.cells - 1);
        // In f32, as part of the definition.
        let lost = |k: usize| ((whole - self.sum(voxel, k)) as f32 * self.directions[k].2) as u64;
        let lost: u64 = (0..self.directions.len()).map(lost).sum();
        (65535 - ((lost + (1 << 13)) >> 14)) as u16
    }

    /// Opacity of one step in 65535ths.
    fn in_step(&self, a: f64) -> u64 {
        let of_step = if self.exponent == 1.0 { a } else { 1.0 - clear(a).powf(self.exponent) };
        (65535.0 * of_step).round() as u64
    }

    fn trilinear(&self, voxel: [usize; 3], k: usize, steps: f64) -> f64 {
        let steps = steps + f64::from(self.shift);
        let place = |i: usize| voxel[i] as f64 + steps * self.directions[k].0[i];
        trilinear(self.grid, self.floats, std::array::from_fn(place))
    }

    fn nearest(&self, voxel: [usize; 3], k: usize, m: u32) -> f64 {
        let at: [i64; 3] = std::array::from_fn(|i| {
            let step = self.directions[k].1[i];
            let first = (self.shift * step as f32).round_ties_even() as i64;
            voxel[i] as i64 + ((first + i64::from(step) * i64::from(m) + 32768) >> 16)
        });
        if (0..3).any(|i| at[i] < 0 || at[i] >= self.grid.dims[i] as i64) {
            return 0.0;
        }
        f64::from(self.floats[self.grid.index(at.map(|c| c as usize))])
    }

    /// S of a ray.
    fn sum(&self, voxel: [usize; 3], k: usize) -> u64 {
        let (cells, near, group) = (self.cells, self.near, self.group);
        let (mut through, mut sum) = (65535_u64, 0_u64);
        let mut pass = |a: u64, halves: u64| {
            sum += halves * ((through * self.means[(a as usize + 128) / 256] + 32768) >> 16);
            through = (through * (65536 - a - (a >> 15)) + 32768) >> 16;
            (through, sum)
        };
        // Far cells of whole groups; those behind them are passed whatever is left.
        let grouped = (cells - near).saturating_sub(1) / group * group;
        let mut now = (65535, 0);
        for m in 1..=cells {
            let last = m == cells;
            if m == 1 && near > 0 {
                for from in [0.75, 1.25].into_iter().take(if last { 1 } else { 2 }) {
                    now = pass(self.in_step(1.0 - clear(self.trilinear(voxel, k, from)).sqrt()), 1);
                }
            } else {
                let a = if m <= near {
                    self.trilinear(voxel, k, f64::from(m))
                } else {
                    self.nearest(voxel, k, m)
                };
                now = pass(self.in_step(a), if last { 1 } else { 2 });
            }
            let all_near = near == cells;
            let looked_at = all_near || m >= near && m <= near + grouped && (m - near).is_multiple_of(group);
            if looked_at && now.0 < u64::from(DARK) {
                break;
            }
        }
        now.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::occlusion::RaySet;

    fn settings(count: u8, quadrature: Quadrature, radius_mm: f32) -> Occlusion {
        Occlusion { rays: RaySet::Spiral(count), quadrature, radius_mm, ..Occlusion::paper(1.0) }
    }

    #[test]
    fn empty_volume_and_radius_0_are_unobstructed() {
        let grid = Grid { dims: [5, 4, 3], spacing: [1.0; 3] };
        for rule in Quadrature::BRICK {
            assert_eq!(rays(&grid, &[0; 60], &settings(50, rule, 6.0), 1.0, true), [65535; 60]);
            assert_eq!(rays(&grid, &[65535; 60], &settings(50, rule, 0.0), 1.0, true), [65535; 60]);
        }
    }

    /// An opaque half-space below a voxel, half a voxel away, takes nearly half of its light: 0.569 is the converged integral.
    #[test]
    fn half_space_takes_half() {
        let grid = Grid { dims: [33, 33, 24], spacing: [1.0; 3] };
        let opacity: Vec<u16> =
            (0..grid.len()).map(|i| if grid.voxel(i)[2] < 12 { 65535 } else { 0 }).collect();
        for rule in Quadrature::BRICK {
            let found = rays(&grid, &opacity, &settings(254, rule, 12.0), 1.0, false);
            let value = f64::from(found[grid.index([16, 16, 12])]) / 65535.0;
            assert!((value - 0.569).abs() < 0.03, "{rule:?}: {value}");
            // Inside nothing comes through.
            assert_eq!(found[grid.index([16, 16, 6])], 0, "{rule:?}");
        }
    }

    /// (1 − e^−τL)/(τL), L the length of a ray, whatever its step and start.
    #[test]
    fn uniform_opacity_has_the_closed_form() {
        let grid = Grid { dims: [27, 27, 27], spacing: [1.0; 3] };
        for a in [0.02_f64, 0.1, 0.4, 0.8] {
            let opacity = vec![(a * 65535.0).round() as u16; grid.len()];
            for rule in Quadrature::BRICK {
                // The last half cell has the mean of a whole one, which is more where steps are long.
                for (offset_mm, step_mm, length, off) in [
                    (None, None, 9.5, 2e-3),
                    (Some(0.2), None, 9.5, 2e-3),
                    (None, Some(0.5), 9.75, 2e-3),
                    (Some(1.0), Some(2.0), 9.0, 4e-3),
                ] {
                    let occlusion = Occlusion { offset_mm, step_mm, ..settings(14, rule, 10.0) };
                    let found = rays(&grid, &opacity, &occlusion, 1.0, false);
                    let value = f64::from(found[grid.index([13, 13, 13])]) / 65535.0;
                    let x = -(1.0 - a).ln() * length;
                    let expected = (1.0 - (-x).exp()) / x;
                    assert!((value - expected).abs() < off, "{rule:?} a={a}: {value} {expected}");
                }
            }
        }
    }
}
