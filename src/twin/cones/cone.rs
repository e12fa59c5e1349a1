//! Cones through mip levels: ours, after voxel cone tracing (Crassin and others 2011).
//!
//! Lengths are in smallest spacings, r = R, s = start (½ unless an offset is given). For a direction d of weight w:
//!
//! ```text
//! cos θ = 1 − 2w                      the cone takes the direction's share of the sphere
//! Δ     = max(1, t tan θ), at most r − t;  m = t + Δ/2;  next t = t + Δ, the first s
//! ā     = mean opacity around x + m d over a cube of 2 m tan θ voxels, at least 1: between two mip levels by log2
//! b     = (1 − ā)^Δ                   means of opacities; means of −ln(1 − a) would make any opaque voxel in a wide cube block all of it
//! A_d   = Σ T Δ (1 − b)/(−ln b) / (r − s),  T the product of the b before       A = Σ w A_d
//! ```
//!
//! A cone with T < 0.001 has ended.

use crate::pyramid::level::Means;
use crate::{Grid, each};
use cao_model::occlusion::Occlusion;
use cao_model::options::Levels;

/// Most mip levels.
const MOST: f64 = 9.0;

/// V_AO of every voxel; 1 where none is needed: where neither the voxel nor a neighbour has opacity, unless `unneeded`. `opacity` is V_o of
/// `reference_mm`.
pub fn cones(
    grid: &Grid,
    opacity: &[f32],
    occlusion: &Occlusion,
    reference_mm: f64,
    unneeded: bool,
) -> Vec<f64> {
    let cones = Cones::new(grid, opacity, occlusion, reference_mm);
    each(grid.len(), |i| {
        let voxel = grid.voxel(i);
        let solid = |v: [usize; 3]| opacity[grid.index(v)] > 0.0;
        let needed = unneeded || solid(voxel) || grid.neighbours(voxel).any(solid);
        if needed { cones.value(voxel) } else { 1.0 }
    })
}

/// The values of these voxels, whether they need one or not.
pub fn cones_at(grid: &Grid, opacity: &[f32], occlusion: &Occlusion, voxels: &[[usize; 3]]) -> Vec<f64> {
    let cones = Cones::new(grid, opacity, occlusion, grid.min_spacing());
    each(voxels.len(), |i| cones.value(voxels[i]))
}

struct Cones {
    means: Means,
    levels: f64,
    /// Voxels a smallest spacing, weight, tan θ.
    directions: Vec<([f64; 3], f64, f64)>,
    start: f64,
    end: f64,
}

impl Cones {
    fn new(grid: &Grid, opacity: &[f32], occlusion: &Occlusion, reference_mm: f64) -> Self {
        let smallest = grid.min_spacing();
        let end = f64::from(occlusion.radius_mm) / smallest;
        let directions: Vec<_> = occlusion
            .rays
            .directions()
            .into_iter()
            .map(|(d, weight)| {
                let cosine: f64 = 1.0 - 2.0 * weight;
                (std::array::from_fn(|i| d[i] * smallest / grid.spacing[i]), weight, cosine.acos().tan())
            })
            .collect();
        let widest = directions.iter().map(|(.., tangent)| *tangent).fold(0.0, f64::max);
        let levels = (2.0 * end * widest).log2().ceil().clamp(0.0, MOST);
        Self {
            means: Means::new(grid, opacity, reference_mm, levels as usize, Levels::Mip),
            levels,
            directions,
            start: occlusion.offset_mm.map_or(0.5, |offset| f64::from(offset) / smallest),
            end,
        }
    }

    fn value(&self, voxel: [usize; 3]) -> f64 {
        if self.end <= self.start {
            return 1.0;
        }
        self.directions.iter().map(|cone| cone.1 * self.along(voxel, cone)).sum()
    }

    fn along(&self, voxel: [usize; 3], &(direction, _, tangent): &([f64; 3], f64, f64)) -> f64 {
        let (mut t, mut through, mut sum) = (self.start, 1.0, 0.0);
        while t < self.end && through >= 0.001 {
            let step = (t * tangent).max(1.0).min(self.end - t);
            let middle = t + 0.5 * step;
            let place = std::array::from_fn(|i| voxel[i] as f64 + 0.5 + middle * direction[i]);
            let lod = (2.0 * middle * tangent).log2().clamp(0.0, self.levels);
            let share = lod.fract();
            let mut mean = (1.0 - share) * self.means.around(lod as usize, place);
            if share > 0.0 {
                mean += share * self.means.around(lod as usize + 1, place);
            }
            let q = 1.0 - mean;
            if q < 1e-6 {
                break;
            }
            let x = -q.ln() * step;
            sum += through * step * if x > 1e-9 { -(-x).exp_m1() / x } else { 1.0 };
            through *= (-x).exp();
            t += step;
        }
        sum / (self.end - self.start)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::occlusion::RaySet;

    fn settings(rays: RaySet, radius_mm: f32) -> Occlusion {
        Occlusion { rays, radius_mm, ..Occlusion::paper(1.0) }
    }

    /// (1 − q^(R−½))/(−ln q (R−½)), however long the steps are; from the voxel itself the numbers of one-voxel shells by the segment rule.
    #[test]
    fn uniform_opacity_has_the_closed_form() {
        // Whole cells of every level: a cell that the border cuts has nothing beyond it.
        let grid = Grid { dims: [96; 3], spacing: [1.0; 3] };
        // Means are whole 65535ths.
        let a = 6554.0 / 65535.0;
        let opacity = vec![a as f32; grid.len()];
        for (radius, shells) in [(4.0, 0.8160), (8.0, 0.6757), (16.0, 0.4833)] {
            for rays in [RaySet::W14, RaySet::W26] {
                for (offset_mm, start) in [(None, 0.5), (Some(0.0), 0.0)] {
                    let occlusion = Occlusion { offset_mm, ..settings(rays, radius) };
                    let found = cones_at(&grid, &opacity, &occlusion, &[[48; 3]])[0];
                    let x = -(1.0_f64 - a).ln() * (f64::from(radius) - start);
                    let expected = -(-x).exp_m1() / x;
                    assert!((found - expected).abs() < 1e-6, "{radius} {start}: {found} {expected}");
                    if start == 0.0 {
                        assert!((found - shells).abs() < 6e-5, "{radius}: {found}");
                    }
                }
            }
        }
    }

    #[test]
    fn nothing_is_lost_without_matter_and_all_of_it_inside_of_opaque_matter() {
        let grid = Grid { dims: [24, 24, 24], spacing: [1.0, 1.0, 2.0] };
        let all =
            |a: f32, radius| cones(&grid, &vec![a; grid.len()], &settings(RaySet::W14, radius), 1.0, true);
        assert!(all(0.0, 8.0).iter().all(|v| (v - 1.0).abs() < 1e-12));
        assert!(all(1.0, 0.0).iter().all(|v| *v == 1.0));
        assert_eq!(all(1.0, 6.0)[grid.index([12; 3])], 0.0);
    }

    /// The truth of a half-space is 0.218 and 0.550 at R = 16 (method.md §2). Cubes as wide as the cone reach back into the wall: the first empty
    /// layer is too dark by an eighth (docs/cones.md).
    #[test]
    fn a_half_space_is_seen_as_cubes_show_it() {
        let grid = Grid { dims: [64; 3], spacing: [1.0; 3] };
        let opacity: Vec<f32> = (0..grid.len()).map(|i| f32::from(grid.voxel(i)[2] < 32)).collect();
        let found = cones_at(&grid, &opacity, &settings(RaySet::W26, 16.0), &[[32, 32, 31], [32, 32, 32]]);
        assert!((found[0] - 0.218).abs() < 0.01 && (found[1] - 0.423).abs() < 0.001, "{found:?}");
    }
}
