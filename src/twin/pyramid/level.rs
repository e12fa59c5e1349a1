//! Means over cubes, straight from their definition (SPAO §1.2.3), without the levels in between.
//!
//! ```text
//! cell c of level l    the mean of a over the voxels [c t, c t + w) along each axis, 0 beyond the volume
//! looked up at p       trilinear between cells, at (p − w/2)/t + ½ from the corner of cell 0; p in voxels from the volume's corner
//! w                    2^l; of unequal spacings an axis is doubled while its cube, in mm, is at most √2 of the shortest
//! t                    1 (N-buffer), w (mip), w of level min(l, m) (mixed), w / (w of level min(l, k)) (reversed)
//! a                    1 − (1 − V_o)^(voxel / reference length), at level 0 of V_o as it is looked up
//! ```

use crate::{Grid, trilinear};
use cao_model::options::Levels;

/// Sums of opacities over boxes from the first voxel on.
pub struct Means {
    grid: Grid,
    /// V_o.
    opacity: Vec<f32>,
    /// Voxel / reference length.
    exponent: f64,
    /// (n + 1)³, with a border of zeros on the low sides.
    sums: Vec<f64>,
    /// w and t of each level.
    levels: Vec<([i64; 3], [i64; 3])>,
}

impl Means {
    /// Of `count` levels beside V_o, which is of `reference_mm`.
    pub fn new(grid: &Grid, opacity: &[f32], reference_mm: f64, count: usize, form: Levels) -> Self {
        let exponent = grid.min_spacing() / reference_mm;
        let [nx, ny, nz] = grid.dims;
        let at = |x: usize, y: usize, z: usize| (z * (ny + 1) + y) * (nx + 1) + x;
        let mut sums = vec![0.0; (nx + 1) * (ny + 1) * (nz + 1)];
        for z in 0..nz {
            for y in 0..ny {
                let mut row = 0.0;
                for x in 0..nx {
                    row += of_voxel(f64::from(opacity[grid.index([x, y, z])]), exponent);
                    sums[at(x + 1, y + 1, z + 1)] =
                        row + sums[at(x + 1, y, z + 1)] + sums[at(x + 1, y + 1, z)] - sums[at(x + 1, y, z)];
                }
            }
        }
        let mut widths = vec![[1_i64; 3]];
        for l in 0..count {
            let mm = |i: usize| widths[l][i] as f64 * grid.spacing[i];
            let shortest = mm(0).min(mm(1)).min(mm(2));
            let factor = |i: usize| if mm(i) <= 2_f64.sqrt() * shortest { 2 } else { 1 };
            widths.push(std::array::from_fn(|i| factor(i) * widths[l][i]));
        }
        let stride = |l: usize, i: usize| match form {
            Levels::Nbuffer => 1,
            Levels::Mip => widths[l][i],
            Levels::Mixed(m) => widths[l.min(m as usize)][i],
            Levels::Reversed(k) => widths[l][i] / widths[l.min(k as usize)][i],
        };
        let levels = (0..=count).map(|l| (widths[l], std::array::from_fn(|i| stride(l, i)))).collect();
        Self { grid: *grid, opacity: opacity.to_vec(), exponent, sums, levels }
    }

    /// Voxels along the edges of a level's cube.
    pub fn width(&self, l: usize) -> [i64; 3] {
        self.levels[l].0
    }

    /// Of the voxels from `low` on, `width` of them.
    fn mean(&self, low: [i64; 3], width: [i64; 3]) -> f64 {
        let [nx, ny, _] = self.grid.dims;
        let cut = |i: usize, c: i64| c.clamp(0, self.grid.dims[i] as i64) as usize;
        let ends: [[usize; 2]; 3] = std::array::from_fn(|i| [cut(i, low[i]), cut(i, low[i] + width[i])]);
        let mut sum = 0.0;
        for corner in 0..8_usize {
            let [x, y, z] = std::array::from_fn(|i| ends[i][corner >> i & 1]);
            let sign = if corner.count_ones() % 2 == 1 { 1.0 } else { -1.0 };
            sum += sign * self.sums[(z * (ny + 1) + y) * (nx + 1) + x];
        }
        sum / width.iter().product::<i64>() as f64
    }

    /// The mean that level `l` has around a place in voxels from the volume's corner.
    pub fn around(&self, l: usize, place: [f64; 3]) -> f64 {
        if l == 0 {
            return of_voxel(trilinear(&self.grid, &self.opacity, place.map(|c| c - 0.5)), self.exponent);
        }
        let (width, stride) = self.levels[l];
        let cells = std::array::from_fn(|i| (place[i] - 0.5 * width[i] as f64) / stride[i] as f64);
        crate::blend(cells, |cell| self.mean(std::array::from_fn(|i| cell[i] * stride[i]), width))
    }
}

/// The opacity of one voxel's length, the smallest spacing.
pub fn of_voxel(opacity: f64, exponent: f64) -> f64 {
    if exponent == 1.0 { opacity } else { 1.0 - (1.0 - opacity).max(0.0).powf(exponent) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { dims: [9, 7, 6], spacing: [1.0; 3] };

    fn field() -> Vec<f32> {
        (0..GRID.len()).map(|i| (i * 37 % 101) as f32 / 101.0).collect()
    }

    /// Every form, against the centred box with half of its weight in the outermost layers (N-buffers), and against tents of cells.
    #[test]
    fn a_look_up_is_the_weighted_mean_that_it_stands_for() {
        let field = field();
        let value = |v: [i64; 3]| {
            let inside = (0..3).all(|i| v[i] >= 0 && v[i] < GRID.dims[i] as i64);
            if inside { f64::from(field[GRID.index(v.map(|c| c as usize))]) } else { 0.0 }
        };
        let weighted = |at: [i64; 3], weight: &dyn Fn(i64) -> f64, reach: i64| {
            let mut sum = 0.0;
            for z in -reach..=reach {
                for y in -reach..=reach {
                    for x in -reach..=reach {
                        let w = weight(x) * weight(y) * weight(z);
                        sum += w * value([at[0] + x, at[1] + y, at[2] + z]);
                    }
                }
            }
            sum
        };
        let nbuffer = Means::new(&GRID, &field, 1.0, 3, Levels::Nbuffer);
        for l in 1..=3 {
            let half = 1_i64 << (l - 1);
            let weight = |d: i64| {
                let share = if d.abs() == half { 0.5 } else { f64::from(u8::from(d.abs() < half)) };
                share / (2 * half) as f64
            };
            for at in [[0, 0, 0], [4, 3, 3], [8, 6, 2]] {
                let found = nbuffer.around(l, at.map(|c| c as f64 + 0.5));
                let expected = weighted(at, &weight, half);
                assert!((found - expected).abs() < 1e-12, "level {l} at {at:?}: {found} {expected}");
            }
        }
        // The first mip level weights the voxels of a cell alike: around voxel 4, cells 2 and 1 by 3/4 and 1/4.
        let mip = Means::new(&GRID, &field, 1.0, 2, Levels::Mip);
        let weight = |d: i64| match d {
            0 | 1 => 0.375,
            -1 | -2 => 0.125,
            _ => 0.0,
        };
        let found = mip.around(1, [4.5; 3]);
        assert!((found - weighted([4; 3], &weight, 2)).abs() < 1e-12, "{found}");
    }

    /// Level by level, as kernels make them: the mean of the eight cells before.
    #[test]
    fn a_level_is_the_mean_of_the_one_before() {
        let field = field();
        for form in [Levels::Nbuffer, Levels::Mip, Levels::Mixed(1), Levels::Reversed(2)] {
            let means = Means::new(&GRID, &field, 1.0, 3, form);
            for l in 1..=3 {
                let ((w, t), (before, _)) = (means.levels[l], means.levels[l - 1]);
                for cell in [[0, 0, 0], [1, 0, 1], [0, 2, 0]] {
                    let low: [i64; 3] = std::array::from_fn(|i| cell[i] * t[i]);
                    let eight = (0..8_usize).map(|n| {
                        let at = std::array::from_fn(|i| low[i] + (n >> i & 1) as i64 * before[i]);
                        means.mean(at, before) / 8.0
                    });
                    assert!((eight.sum::<f64>() - means.mean(low, w)).abs() < 1e-12, "{form:?} {l}");
                }
            }
        }
    }
}
