//! Vicinity shading (docs/vicinity.md), from the definition, after Stewart, Vicinity shading for enhanced perception of volumetric data, 2003.
//!
//! ```text
//! g_i(x) = (V_o(x − e_i) − V_o(x + e_i)) / 2 · (smallest spacing / spacing_i),   0 outside the volume
//! A(x) = Σ_k w_k max(0, g·d_k) visible_k / Σ_k w_k max(0, g·d_k);   1 where |g| < 10⁻³ or the sum is 0
//! ```
//!
//! Direction k is visible if no voxel of its line within the radius is more opaque than x by more than 1/255, both of a smallest spacing:
//! a' = 1 − (1 − a)^e, e = smallest spacing / reference length. The m-th voxel of the line is (x·2¹⁶ + 2¹⁵ + m·s_k) / 2¹⁶, s_k the
//! direction scaled to one voxel along its longest axis, in 65536ths (Bresenham's line); the radius has ⌊R / length of s_k⌋ of them. Spacings
//! are 65536ths of the smallest.

use crate::{Grid, each};
use cao_model::occlusion::Occlusion;

/// What f64 rounds of two opacities that are just 1/255 apart, which is not more.
const EQUAL: f64 = 1e-12;

/// V_AO of every voxel; 1 where none is needed: where neither the voxel nor a neighbour has opacity, unless `unneeded`. `opacity` is V_o of
/// `reference_mm` in 65535ths.
pub fn vicinity(
    grid: &Grid,
    opacity: &[u16],
    occlusion: &Occlusion,
    reference_mm: f32,
    unneeded: bool,
) -> Vec<f64> {
    let (ratios, smallest) = (grid.ratios(), f64::from(grid.min_spacing() as f32));
    let radius = f64::from(occlusion.radius_mm);
    let exponent = smallest / f64::from(reference_mm);
    let at = |voxel: [i64; 3]| {
        let inside = (0..3).all(|i| voxel[i] >= 0 && voxel[i] < grid.dims[i] as i64);
        inside.then(|| opacity[grid.index(voxel.map(|c| c as usize))])
    };
    let of_spacing = |a: u16| 1.0 - (1.0 - f64::from(a) / 65535.0).powf(exponent);
    let value = |voxel: [usize; 3]| -> f64 {
        let x = voxel.map(|c| c as i64);
        let beside = |i: usize, d: i64| {
            let mut place = x;
            place[i] += d;
            f64::from(at(place).unwrap_or(0)) / 65535.0
        };
        let g: [f64; 3] = std::array::from_fn(|i| 0.5 * (beside(i, -1) - beside(i, 1)) / ratios[i]);
        if g.iter().map(|c| c * c).sum::<f64>() < 1e-6 || radius < 0.5 * smallest {
            return 1.0;
        }
        let own = of_spacing(opacity[grid.index(voxel)]);
        let (mut seen, mut all) = (0.0, 0.0);
        for (d, weight) in occlusion.rays.directions() {
            let weight = weight * (0..3).map(|i| g[i] * d[i]).sum::<f64>();
            if weight <= 0.0 {
                continue;
            }
            all += weight;
            let along: [f64; 3] = std::array::from_fn(|i| d[i] / ratios[i]);
            let longest = along.into_iter().map(f64::abs).fold(0.0, f64::max);
            let step = along.map(|c| (65536.0 * c / longest).round() as i64);
            let steps = (radius / smallest * longest * (1.0 + 1e-6)).floor() as i64;
            let line = (1..=steps)
                .map(|m| std::array::from_fn(|i| (x[i] * 65536 + 32768 + m * step[i]).div_euclid(65536)));
            let hidden = line.map_while(at).any(|a| of_spacing(a) > own + 1.0 / 255.0 + EQUAL);
            seen += if hidden { 0.0 } else { weight };
        }
        if all > 0.0 { seen / all } else { 1.0 }
    };
    each(grid.len(), |i| {
        let voxel = grid.voxel(i);
        let solid = |v: [usize; 3]| opacity[grid.index(v)] > 0;
        if unneeded || solid(voxel) || grid.neighbours(voxel).any(solid) { value(voxel) } else { 1.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::occlusion::{Quadrature, RaySet};

    fn settings(rays: RaySet, radius_mm: f32) -> Occlusion {
        Occlusion { rays, quadrature: Quadrature::Visible, radius_mm, ..Occlusion::paper(1.0) }
    }

    /// Of one voxel among these opacities.
    fn of(opacity: impl Fn([usize; 3]) -> f64, rays: RaySet, at: [usize; 3]) -> f64 {
        let grid = Grid { dims: [41, 41, 30], spacing: [1.0; 3] };
        let opacity: Vec<u16> =
            (0..grid.len()).map(|i| (65535.0 * opacity(grid.voxel(i))).round() as u16).collect();
        vicinity(&grid, &opacity, &settings(rays, 20.0), 1.0, false)[grid.index(at)]
    }

    #[test]
    fn uniform_matter_and_a_flat_wall_are_bright() {
        for a in [0.0, 0.1, 1.0] {
            assert_eq!(of(|_| a, RaySet::Spiral(50), [20, 20, 15]), 1.0);
            // The first solid layer, and one inside, which has no gradient.
            for z in [14, 8] {
                let wall = |[_, _, z]: [usize; 3]| if z < 15 { a } else { 0.0 };
                assert_eq!(of(wall, RaySet::W26, [20, 20, z]), 1.0, "{a} {z}");
            }
        }
    }

    /// Beside a wall of higher opacity, two voxels away from the floor's voxel so that the normal points up: half a hemisphere, and of the
    /// other half those that do not reach the wall within the radius, on the disc under the hemisphere the strip as wide as t = 1.5/20.
    #[test]
    fn a_wall_beside_a_softer_floor_hides_half() {
        let corner = |[x, _, z]: [usize; 3]| if x >= 22 { 1.0 } else { f64::from(u8::from(z < 8)) * 0.5 };
        let value = of(corner, RaySet::Spiral(254), [20, 20, 7]);
        let t = 1.5_f64 / 20.0;
        let beyond = (t * (1.0 - t * t).sqrt() + t.asin()) / std::f64::consts::PI;
        assert!((value - 0.5 - beyond).abs() < 0.02, "{value}");
        // Of equal opacity it hides nothing.
        let even = |v: [usize; 3]| if corner(v) > 0.0 { 0.5 } else { 0.0 };
        assert_eq!(of(even, RaySet::Spiral(254), [20, 20, 7]), 1.0);
    }
}
