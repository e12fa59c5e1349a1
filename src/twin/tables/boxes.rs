//! Values from boxes (docs/tables.md), from the definition: every voxel of every box is read.
//!
//! Box i of a voxel has `h_i = round(r_i / spacing)` voxels on each side along each axis, r_i whole smallest spacings, spacings 65536ths of
//! one. S_i is the sum of
//! the opacities in it (0 outside the volume), N_i its number of voxels, outside or not; box 0 is the voxel itself. n shells up to a radius
//! of R smallest spacings: r_i = round(i·R / n), none twice. e = smallest spacing / reference length of the opacity.
//!
//! ```text
//! box         A = (1 − S_n / N_n)^e                                            n = 1
//! shells      ā_i = (S_i − S_{i−1}) / (N_i − N_{i−1}),   b_i = (1 − ā_i)^(e·(r_i − r_{i−1}))
//! mean        A = 1/R Σ_i (r_i − r_{i−1}) T_{i−1} (1 − b_i)/(−ln b_i),   T_i = T_{i−1} b_i
//! end         A = Π b_i
//! published   A = exp(−(e/R²) Σ_i (S_i − S_{i−1}) / r_i²), S of extinctions −ln(1 − a) up to 11.09 instead of opacities
//! ```
//!
//! `mean` is eq. (2) of CAO with shells for cells, by the rule of method.md §3 for a cell of one extinction. `published` has the constants of
//! its authors' program as they stand there.

use crate::{Grid, each};
use cao_kernels::sums::MOST_EXTINCTION;
use cao_model::occlusion::{Occlusion, Quadrature};

/// V_AO of every voxel; 1 where none is needed: where neither the voxel nor a neighbour has opacity, unless `unneeded`. `opacity` is V_o of
/// `reference_mm`.
pub fn boxes(
    grid: &Grid,
    opacity: &[f32],
    occlusion: &Occlusion,
    shells: u32,
    reference_mm: f32,
    unneeded: bool,
) -> Vec<f64> {
    each(grid.len(), |i| {
        let voxel = grid.voxel(i);
        let solid = |v: [usize; 3]| opacity[grid.index(v)] > 0.0;
        if !(unneeded || solid(voxel) || grid.neighbours(voxel).any(solid)) {
            return 1.0;
        }
        box_at(grid, opacity, occlusion, shells, reference_mm, voxel)
    })
}

/// Value of one voxel, whether it needs one or not.
pub fn box_at(
    grid: &Grid,
    opacity: &[f32],
    occlusion: &Occlusion,
    shells: u32,
    reference_mm: f32,
    voxel: [usize; 3],
) -> f64 {
    let (ratios, smallest) = (grid.ratios(), f64::from(grid.min_spacing() as f32));
    let radius = f64::from(occlusion.radius_mm) / smallest;
    let edge = radius.round() as u32;
    let exponent = smallest / f64::from(reference_mm);
    let rule = occlusion.quadrature;
    let extinction = |a: f64| (-(1.0 - a).max(1e-6).ln()).min(f64::from(MOST_EXTINCTION));
    let number = |a: f64| if rule == Quadrature::Published { extinction(a) } else { a };
    // S and N of a box.
    let summed = |edge: u32| -> (f64, f64) {
        let half = ratios.map(|ratio| (f64::from(edge) / ratio).round() as i64);
        let range = |i: usize| {
            let (centre, last) = (voxel[i] as i64, grid.dims[i] as i64 - 1);
            (centre - half[i]).max(0) as usize..=(centre + half[i]).min(last) as usize
        };
        let mut sum = 0.0;
        for z in range(2) {
            for y in range(1) {
                sum += range(0).map(|x| number(f64::from(opacity[grid.index([x, y, z])]))).sum::<f64>();
            }
        }
        (sum, half.iter().map(|h| (2 * h + 1) as f64).product())
    };
    let count = if rule == Quadrature::Box { 1 } else { shells.min(edge) };
    let edges: Vec<u32> = (1..=count)
        .map(|i| (f64::from(i) * f64::from(edge) / f64::from(count)).round() as u32)
        .filter(|edge| *edge > 0)
        .collect();
    let Some(&last) = edges.last() else { return 1.0 };
    if rule == Quadrature::Box {
        let (sum, voxels) = summed(last);
        return (1.0 - sum / voxels).max(0.0).powf(exponent);
    }
    let (mut light, mut mean, mut published) = (1.0, 0.0, 0.0);
    let (mut before, mut r_before) = (summed(0), 0);
    for r in edges {
        let here = summed(r);
        let (sum, voxels) = (here.0 - before.0, here.1 - before.1);
        let thickness = f64::from(r - r_before);
        published += sum / f64::from(r * r);
        // What rounds to all is all.
        let q = 1.0 - sum / voxels;
        let q = if q < 1e-6 { 0.0 } else { q };
        let depth = -q.ln() * thickness * exponent;
        let b = (-depth).exp();
        let through = match depth {
            depth if depth.is_infinite() => 0.0,
            depth if depth < 1e-9 => 1.0,
            depth => (1.0 - b) / depth,
        };
        mean += light * through * thickness / f64::from(last);
        light *= b;
        (before, r_before) = (here, r);
    }
    match rule {
        Quadrature::Mean => mean,
        Quadrature::End => light,
        Quadrature::Published => (-exponent * published / (radius * radius)).exp(),
        rule => panic!("{rule:?} is no rule of boxes"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::occlusion::RaySet;

    fn settings(quadrature: Quadrature, radius_mm: f32) -> Occlusion {
        Occlusion { rays: RaySet::None, quadrature, radius_mm, ..Occlusion::paper(1.0) }
    }

    /// Of the middle of a cube that the largest box fills.
    fn middle(half: usize, opacity: impl Fn([usize; 3]) -> f32, rule: Quadrature, shells: u32) -> f64 {
        let grid = Grid { dims: [2 * half + 1; 3], spacing: [1.0; 3] };
        let opacity: Vec<f32> = (0..grid.len()).map(|i| opacity(grid.voxel(i))).collect();
        box_at(&grid, &opacity, &settings(rule, half as f32), shells, 1.0, [half; 3])
    }

    #[test]
    fn uniform_opacity_has_the_closed_forms() {
        assert!((middle(5, |_| 0.3, Quadrature::Box, 1) - 0.7).abs() < 1e-7);
        // One-voxel shells of 0.1, as rays of as many cells.
        for (n, expected) in [(4, 0.8160), (8, 0.6757), (16, 0.4833)] {
            let value = middle(n, |_| 0.1, Quadrature::Mean, n as u32);
            assert!((value - expected).abs() < 5e-5, "{n}: {value}");
            // Shells of any thickness are of one extinction.
            assert!((middle(n, |_| 0.1, Quadrature::Mean, 3) - value).abs() < 1e-9);
            assert!((middle(n, |_| 0.1, Quadrature::End, n as u32) - 0.9_f64.powi(n as i32)).abs() < 1e-6);
        }
        for rule in Quadrature::SHELLS.into_iter().chain([Quadrature::Box]) {
            assert!((middle(6, |_| 0.0, rule, 4) - 1.0).abs() < 1e-12, "{rule:?}");
        }
    }

    /// The first solid layer of a half-space.
    #[test]
    fn half_space_has_what_was_computed_for_it() {
        let half = |[_, _, z]: [usize; 3]| if z <= 16 { 1.0 } else { 0.0 };
        let value = middle(16, half, Quadrature::Box, 1);
        assert!((value - 0.4848).abs() < 5e-5, "{value}");
        let value = middle(16, half, Quadrature::Mean, 16);
        assert!((value - 0.0644).abs() < 5e-5, "{value}");
        // More shells make a wall darker: their opacities are taken for independent.
        let values = [1, 2, 4, 8, 16].map(|shells| middle(16, half, Quadrature::Mean, shells));
        assert!(values.windows(2).all(|pair| pair[0] > pair[1]), "{values:?}");
    }
}
