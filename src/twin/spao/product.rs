//! Smooth probabilistic ambient occlusion (SPAO): the product of what shells of cubes let through.
//!
//! ```text
//! a_l  = clamp((S_l A_l − S_l−1 A_l−1)/(S_l − S_l−1), 0, 1)      §1.2.2: A_l mean opacity of the cube of level l, S_l its voxels
//! A(x) = Π_l=1..L (1 − a_l)                                      §1.2.1; level 0 is no shell
//! L    = 1 + log2(R / smallest spacing), rounded, at least 0
//! p_l  = x + factor·g·w_l/2                                      §1.3: where the cube is, w_l its edges in voxels
//! g_i  = (a(x − e_i) − a(x + e_i))·smallest spacing/spacing_i, shortened to length 1
//! ```
//!
//! The paper writes of values in [0, 1] that give a normal; here it is opacities, for a cut face needs one too.

use crate::pyramid::level::{Means, of_voxel};
use crate::{Grid, each};
use cao_model::options::Options;

/// L.
pub fn shells(grid: &Grid, radius_mm: f64) -> usize {
    (1.0 + (radius_mm / grid.min_spacing()).log2().round()).max(0.0) as usize
}

/// V_AO of every voxel; 1 where none is needed: where neither the voxel nor a neighbour has opacity, unless `unneeded`. `opacity` is V_o of
/// `reference_mm`.
pub fn product(
    grid: &Grid,
    opacity: &[f32],
    radius_mm: f64,
    options: &Options,
    reference_mm: f64,
    unneeded: bool,
) -> Vec<f64> {
    let shells = Shells::new(grid, opacity, radius_mm, options, reference_mm);
    each(grid.len(), |i| {
        let voxel = grid.voxel(i);
        let solid = |v: [usize; 3]| opacity[grid.index(v)] > 0.0;
        let needed = unneeded || solid(voxel) || grid.neighbours(voxel).any(solid);
        if needed { shells.value(voxel) } else { 1.0 }
    })
}

/// The value of one voxel, whether it needs one or not.
pub fn product_at(
    grid: &Grid,
    opacity: &[f32],
    radius_mm: f64,
    options: &Options,
    reference_mm: f64,
    voxel: [usize; 3],
) -> f64 {
    Shells::new(grid, opacity, radius_mm, options, reference_mm).value(voxel)
}

/// A scene with its means.
pub struct Shells<'a> {
    grid: &'a Grid,
    opacity: &'a [f32],
    exponent: f64,
    means: Means,
    /// L.
    count: usize,
    factor: f64,
}

impl<'a> Shells<'a> {
    /// As [`product`] has them.
    pub fn new(
        grid: &'a Grid,
        opacity: &'a [f32],
        radius_mm: f64,
        options: &Options,
        reference_mm: f64,
    ) -> Self {
        let count = shells(grid, radius_mm);
        Self {
            grid,
            opacity,
            exponent: grid.min_spacing() / reference_mm,
            means: Means::new(grid, opacity, reference_mm, count, options.levels),
            count,
            factor: f64::from(options.normal),
        }
    }

    /// The value of one voxel, whether it needs one or not.
    pub fn value(&self, voxel: [usize; 3]) -> f64 {
        let out = self.normal(voxel);
        let mean = |l: usize| {
            let width = self.means.width(l);
            let moved = |i: usize| self.factor * out[i] * 0.5 * width[i] as f64;
            self.means.around(l, std::array::from_fn(|i| voxel[i] as f64 + 0.5 + moved(i)))
        };
        let voxels = |l: usize| self.means.width(l).iter().product::<i64>() as f64;
        let let_through = |l: usize| {
            let shell = voxels(l) - voxels(l - 1);
            1.0 - ((voxels(l) * mean(l) - voxels(l - 1) * mean(l - 1)) / shell).clamp(0.0, 1.0)
        };
        (1..=self.count).map(let_through).product()
    }

    fn normal(&self, voxel: [usize; 3]) -> [f64; 3] {
        let grid = self.grid;
        let solid = |i: usize, step: i64| {
            let mut at = voxel.map(|c| c as i64);
            at[i] += step;
            let inside = at[i] >= 0 && at[i] < grid.dims[i] as i64;
            let there = || f64::from(self.opacity[grid.index(at.map(|c| c as usize))]);
            if inside { of_voxel(there(), self.exponent) } else { 0.0 }
        };
        let smallest = grid.min_spacing();
        let g: [f64; 3] = std::array::from_fn(|i| (solid(i, -1) - solid(i, 1)) * smallest / grid.spacing[i]);
        let length = g.iter().map(|c| c * c).sum::<f64>().sqrt();
        g.map(|c| c / length.max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::options::Levels;

    const GRID: Grid = Grid { dims: [72, 72, 72], spacing: [1.0; 3] };

    fn options(levels: Levels, normal: f32) -> Options {
        Options { levels, normal, ..Options::DEFAULT }
    }

    fn at(opacity: &[f32], levels: usize, options: &Options, voxel: [usize; 3]) -> f64 {
        product_at(&GRID, opacity, f64::from(1 << (levels - 1)), options, 1.0, voxel)
    }

    fn half_space() -> Vec<f32> {
        (0..GRID.len()).map(|i| f32::from(GRID.voxel(i)[2] < 36)).collect()
    }

    #[test]
    fn uniform_opacity_is_a_power_of_what_it_lets_through() {
        for a in [0.0, 0.1, 0.5, 1.0] {
            let opacity = vec![a as f32; GRID.len()];
            for levels in 1..=5 {
                for form in [Levels::Nbuffer, Levels::Mip, Levels::Mixed(1), Levels::Reversed(3)] {
                    let found = at(&opacity, levels, &options(form, 0.0), [36; 3]);
                    let expected = (1.0 - f64::from(a as f32)).powi(levels as i32);
                    assert!((found - expected).abs() < 1e-6, "{a} {levels} {form:?}: {found} {expected}");
                }
            }
        }
        assert_eq!(shells(&GRID, 0.0), 0);
        assert_eq!([0.6, 1.0, 1.5, 16.0, 20.0, 50.0].map(|r| shells(&GRID, r)), [0, 1, 2, 5, 5, 7]);
    }

    /// Computed in float64 outside of this program, L = 1 … 5.
    #[test]
    fn a_half_space_has_its_known_answers() {
        let opacity = half_space();
        for (layer, normal, expected) in [
            (35, 0.0, [0.2857, 0.1122, 0.0501, 0.0237, 0.0115]),
            (35, 0.5, [0.5357, 0.3444, 0.2398, 0.1735, 0.1278]),
            (35, 1.0, [0.7857, 0.7015, 0.6639, 0.6462, 0.6375]),
            (35, 2.0, [1.0; 5]),
            (36, 0.0, [0.7143, 0.4337, 0.2401, 0.1265, 0.0649]),
            (36, 1.0, [1.0; 5]),
        ] {
            for (levels, expected) in (1..).zip(expected) {
                let found = at(&opacity, levels, &options(Levels::Nbuffer, normal), [36, 36, layer]);
                assert!((found - expected).abs() < 6e-5, "{layer} {normal} L {levels}: {found} {expected}");
            }
        }
    }

    #[test]
    fn one_opaque_voxel_does_not_darken_itself() {
        let mut opacity = vec![0.0; GRID.len()];
        opacity[GRID.index([36; 3])] = 1.0;
        let own = options(Levels::Nbuffer, 0.0);
        for levels in 1..=3 {
            assert_eq!(at(&opacity, levels, &own, [36; 3]), 1.0);
        }
        for (levels, expected) in [(1, 0.9286), (2, 0.9203)] {
            let found = at(&opacity, levels, &own, [37, 36, 36]);
            assert!((found - expected).abs() < 6e-5, "{levels}: {found}");
        }
    }

    /// The half voxel of even cubes: what is left of a wall is what is right of its mirror image.
    #[test]
    fn shading_does_not_shift() {
        for form in [Levels::Nbuffer, Levels::Mixed(2), Levels::Mip, Levels::Reversed(2)] {
            let slab: Vec<f32> =
                (0..GRID.len()).map(|i| f32::from((28..36).contains(&GRID.voxel(i)[0]))).collect();
            for depth in 0..12 {
                let value = |x: usize| at(&slab, 4, &options(form, 0.0), [x, 36, 36]);
                let (left, right) = (value(32 - 1 - depth), value(32 + depth));
                assert!((left - right).abs() < 1e-9, "{form:?} {depth}: {left} {right}");
            }
        }
    }
}
