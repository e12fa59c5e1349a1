//! Structural similarity as DVAO measures it (DVAO §3.5, eq. (3); Wang et al. 2004):
//!
//! ```text
//! SSIM = (2 μ_p μ_t + c1)(2 σ_pt + c2) / ((μ_p² + μ_t² + c1)(σ_p² + σ_t² + c2)),   mean over all voxels
//! ```
//!
//! with means, variances and covariance in a neighbourhood of each voxel: in its slice along z for SSIM-2D, in the volume for
//! SSIM-3D. The paper leaves open:
//!
//! * the window: here Wang's, a Gaussian of σ = 1.5 voxels cut at 11, as the authors' published program has it;
//! * its rim: here only voxels that count have weight, in every window, and only their own windows are averaged. The authors'
//!   program drops the 5 outermost voxels instead;
//! * values below 0, of voxels whose structures are opposed: here kept; the authors' program takes them for 0;
//! * the constants: c1 = 0.01 and c2 = 0.03 as printed, while that program squares them as Wang does. See [`Constants`].

use cao_twin::Grid;

/// c1 and c2, for values in 0 … 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    /// Steadies the comparison of means.
    pub c1: f64,
    /// Steadies the comparison of variances.
    pub c2: f64,
}

impl Constants {
    /// DVAO eq. (3) as printed.
    pub const PRINTED: Self = Self { c1: 0.01, c2: 0.03 };
    /// Wang et al. 2004 and DVAO's published program, from which the numbers in its tables come: (0.01)² and (0.03)².
    pub const SQUARED: Self = Self { c1: 1e-4, c2: 9e-4 };
}

/// Half the window's width in voxels, beside its centre.
const REACH: usize = 5;
/// The Gaussian's σ in voxels.
const SIGMA: f64 = 1.5;

/// SSIM-2D: mean over the voxels that count, each in its slice along z. An image is a volume with one slice.
///
/// # Panics
/// If the lengths are not the number of voxels.
pub fn ssim_2d(grid: &Grid, found: &[f32], reference: &[f32], counts: &[bool], constants: Constants) -> f64 {
    ssim(grid, found, reference, counts, constants, &[0, 1])
}

/// SSIM-3D: mean over the voxels that count, each in its neighbourhood.
///
/// # Panics
/// If the lengths are not the number of voxels.
pub fn ssim_3d(grid: &Grid, found: &[f32], reference: &[f32], counts: &[bool], constants: Constants) -> f64 {
    ssim(grid, found, reference, counts, constants, &[0, 1, 2])
}

fn ssim(
    grid: &Grid,
    found: &[f32],
    reference: &[f32],
    counts: &[bool],
    Constants { c1, c2 }: Constants,
    axes: &[usize],
) -> f64 {
    let voxels = grid.len();
    assert_eq!((found.len(), reference.len(), counts.len()), (voxels, voxels, voxels), "voxels");
    let gauss: [f64; REACH + 1] = std::array::from_fn(|d| (-((d * d) as f64) / (2.0 * SIGMA * SIGMA)).exp());
    // Each window by itself, for of a large volume a sample counts.
    let window = |i: usize| {
        let at = grid.voxel(i);
        let along = |axis: usize| {
            let reach = if axes.contains(&axis) { REACH } else { 0 };
            (at[axis].saturating_sub(reach)..=(at[axis] + reach).min(grid.dims[axis] - 1))
                .map(move |j| (j, gauss[j.abs_diff(at[axis])]))
        };
        let mut moments = [0.0; 6];
        for (z, by_z) in along(2) {
            for (y, by_y) in along(1) {
                let (row, weight) = (grid.index([0, y, z]), by_y * by_z);
                for (x, by_x) in along(0).filter(|(x, _)| counts[row + x]) {
                    let (p, t) = (f64::from(found[row + x]), f64::from(reference[row + x]));
                    let terms = [1.0, p, t, p * p, t * t, p * t];
                    moments.iter_mut().zip(terms).for_each(|(sum, term)| *sum += weight * by_x * term);
                }
            }
        }
        let weight = moments[0];
        moments.map(|sum| sum / weight)
    };
    let (mut sum, mut count) = (0.0, 0);
    for i in (0..voxels).filter(|&i| counts[i]) {
        let [_, mp, mt, pp, tt, pt] = window(i);
        let (vp, vt, c) = (pp - mp * mp, tt - mt * mt, pt - mp * mt);
        sum += (2.0 * mp * mt + c1) * (2.0 * c + c2) / ((mp * mp + mt * mt + c1) * (vp + vt + c2));
        count += 1;
    }
    sum / f64::from(count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }

    const SHORT: Grid = Grid { dims: [2, 1, 1], spacing: [1.0; 3] };

    /// Two constant fields: no variance, so that only the means count.
    #[test]
    fn constant_fields_by_hand() {
        let grid = Grid { dims: [4, 5, 3], spacing: [1.0; 3] };
        let (p, t, all) = (vec![0.5; 60], vec![0.25; 60], vec![true; 60]);
        for c in [Constants::PRINTED, Constants::SQUARED] {
            let expected = (2.0 * 0.125 + c.c1) / (0.25 + 0.0625 + c.c1);
            close(ssim_2d(&grid, &p, &t, &all, c), expected);
            close(ssim_3d(&grid, &p, &t, &all, c), expected);
        }
    }

    /// Two voxels have weights 1 and g = exp(−1/4.5) in the first one's window, and the other way round in the second's.
    #[test]
    fn two_voxels_by_hand() {
        let Constants { c1, c2 } = Constants::PRINTED;
        let g = (-1.0_f64 / 4.5).exp();
        let (a, b) = (1.0 / (1.0 + g), g / (1.0 + g));
        // p = (1, 0), t = (0, 1): means a, b and b, a; variances ab; covariance −ab.
        let expected = (2.0 * a * b + c1) * (c2 - 2.0 * a * b) / ((a * a + b * b + c1) * (2.0 * a * b + c2));
        let found = ssim_3d(&SHORT, &[1.0, 0.0], &[0.0, 1.0], &[true; 2], Constants::PRINTED);
        close(found, expected);
        assert!(found < -0.7);
        // Where only one voxel counts, it is alone in its window.
        let found = ssim_3d(&SHORT, &[1.0, f32::NAN], &[0.5, f32::NAN], &[true, false], Constants::PRINTED);
        close(found, (1.0 + c1) / (1.25 + c1));
    }

    #[test]
    fn equal_fields_are_alike_and_shuffled_ones_are_not() {
        let grid = Grid { dims: [13, 12, 14], spacing: [1.0; 3] };
        let mut random = Random::new(4);
        let field: Vec<f32> = (0..grid.len()).map(|_| random.between(0.0, 1.0)).collect();
        let counts: Vec<bool> = (0..grid.len()).map(|_| random.below(4) != 0).collect();
        let mut turned = field.clone();
        turned.rotate_left(5);
        for ssim in [ssim_2d, ssim_3d] {
            close(ssim(&grid, &field, &field, &counts, Constants::SQUARED), 1.0);
            assert!(ssim(&grid, &turned, &field, &counts, Constants::SQUARED) < 0.2);
        }
    }

    /// Slices of even brightness, each 0.2 brighter than it should be on odd slices: in a slice there is no structure to
    /// lose, along z there is.
    #[test]
    fn only_the_third_axis_sees_structure_along_it() {
        let grid = Grid { dims: [3, 3, 12], spacing: [1.0; 3] };
        let reference = vec![0.5; grid.len()];
        let found: Vec<f32> =
            (0..grid.len()).map(|i| if grid.voxel(i)[2] % 2 == 1 { 0.7 } else { 0.5 }).collect();
        let all = vec![true; grid.len()];
        let flat = ssim_2d(&grid, &found, &reference, &all, Constants::SQUARED);
        let deep = ssim_3d(&grid, &found, &reference, &all, Constants::SQUARED);
        assert!(flat > 0.95 && deep < 0.2, "{flat} {deep}");
    }

    /// Every window summed by itself, straight from the definition.
    #[test]
    fn windows_are_those_of_the_definition() {
        let grid = Grid { dims: [14, 7, 9], spacing: [1.0; 3] };
        let mut random = Random::new(8);
        let mut field = || (0..grid.len()).map(|_| random.between(0.0, 1.0)).collect::<Vec<f32>>();
        let (p, t) = (field(), field());
        let counts: Vec<bool> = field().into_iter().map(|c| c > 0.3).collect();
        let Constants { c1, c2 } = Constants::SQUARED;
        for (deep, ssim) in [
            (false, ssim_2d(&grid, &p, &t, &counts, Constants::SQUARED)),
            (true, ssim_3d(&grid, &p, &t, &counts, Constants::SQUARED)),
        ] {
            let (mut sum, mut count) = (0.0, 0.0);
            for i in (0..grid.len()).filter(|i| counts[*i]) {
                let weight = |j: &usize| {
                    let apart: [usize; 3] =
                        std::array::from_fn(|a| grid.voxel(i)[a].abs_diff(grid.voxel(*j)[a]));
                    let inside = apart.iter().all(|d| *d <= 5) && (deep || apart[2] == 0) && counts[*j];
                    let squares = apart.iter().map(|d| (d * d) as f64).sum::<f64>();
                    if inside { (-squares / (2.0 * 1.5 * 1.5)).exp() } else { 0.0 }
                };
                let total: f64 = (0..grid.len()).map(|j| weight(&j)).sum();
                let mean = |of: &dyn Fn(usize) -> f64| {
                    (0..grid.len()).map(|j| weight(&j) / total * of(j)).sum::<f64>()
                };
                let [p, t] = [&p, &t].map(|f| move |j: usize| f64::from(f[j]));
                let (mp, mt) = (mean(&p), mean(&t));
                let vp = mean(&|j| (p(j) - mp).powi(2));
                let vt = mean(&|j| (t(j) - mt).powi(2));
                let c = mean(&|j| (p(j) - mp) * (t(j) - mt));
                sum += (2.0 * mp * mt + c1) / (mp * mp + mt * mt + c1) * (2.0 * c + c2) / (vp + vt + c2);
                count += 1.0;
            }
            close(ssim, sum / count);
        }
    }
}
