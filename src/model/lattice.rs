//! Lattice directions for the line sweep (method.md §4): integer vectors in index space whose rays meet voxel centres, and
//! weights that integrate the sphere as well as these directions can.
//!
//! Where spacing is equal along all axes the vectors of a [`RaySet`] are their own lattice directions, with the set's weights.
//! Otherwise each wanted direction takes the lattice vector (components up to 3) nearest in angle *in millimetres*, and
//! non-negative weights are fitted to the moments of the spherical harmonics Y_lm up to the set's degree:
//!
//! ```text
//! minimise over w ≥ 0   Σ_{l≤L} Σ_m (Σ_k w_k Y_lm(d_k) − δ_l0)²  =  wᵀGw − 2·1ᵀw + 1,
//! G_ij = Σ_{l≤L} (2l+1) P_l(d_i·d_j)                        (addition theorem)
//! ```
//!
//! with real Y_lm of unit mean square over the sphere. The residual is the square root of that: the worst error of the mean of
//! any function of degree L and unit mean square.
//!
//! What limits the directions, and what was tried to do with 50: `benches/runs/2026-11-24-llvmpipe-sweep/`.

use crate::occlusion::RaySet;
use glam::DVec3;

/// One direction of a sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatticeRay {
    /// Voxels along x, y, z from one point of the line to the next; coprime, at most [`REACH`] each.
    pub step: [i32; 3],
    /// Weight; those of a set sum to 1.
    pub weight: f64,
}

/// The directions of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct LatticeRays {
    /// In the fixed order in which every implementation sums them.
    pub rays: Vec<LatticeRay>,
    /// How far the weights are from integrating the sphere exactly to the set's degree; 0 is exact.
    pub residual: f64,
}

/// Largest component of a step.
pub const REACH: i32 = 3;

/// Spacings that differ by less than this share are equal: files round them.
const EQUAL: f64 = 1e-3;

/// Degree to which a set's weights are fitted: that of its Lebedev rule, or of the rule of its size.
fn degree(set: RaySet) -> usize {
    match set {
        RaySet::R6 => 3,
        RaySet::R14 | RaySet::W14 => 5,
        RaySet::R26 | RaySet::W26 => 7,
        RaySet::R54 | RaySet::W50 => 11,
    }
}

impl LatticeRays {
    /// The directions that stand for `set` in a volume of this spacing in mm.
    pub fn new(set: RaySet, spacing: [f64; 3]) -> Self {
        let wanted = set.directions();
        let smallest = spacing.into_iter().fold(f64::INFINITY, f64::min);
        let largest = spacing.into_iter().fold(0.0, f64::max);
        if largest <= smallest * (1.0 + EQUAL) {
            let rays: Vec<_> = wanted.into_iter().map(|(step, weight)| LatticeRay { step, weight }).collect();
            let residual = residual(&gram(&rays, [1.0; 3], degree(set)), &weights(&rays));
            return Self { rays, residual };
        }
        let mut rays: Vec<LatticeRay> = Vec::new();
        for (direction, _) in wanted {
            let step = nearest(unit(direction, [1.0; 3]), spacing);
            if !rays.iter().any(|ray| ray.step == step) {
                rays.push(LatticeRay { step, weight: 0.0 });
            }
        }
        rays.sort_by_key(|ray| ray.step);
        let gram = gram(&rays, spacing, degree(set));
        let fitted = fit(&rays, &gram);
        let residual = residual(&gram, &fitted);
        rays.iter_mut().zip(fitted).for_each(|(ray, weight)| ray.weight = weight);
        rays.retain(|ray| ray.weight > 0.0);
        Self { rays, residual }
    }
}

impl LatticeRays {
    /// The weights as whole 65535ths, equal for a ray and its reverse, that sum to 65534: sums of them, as 16-bit texels hold them,
    /// are exact in any order and never below 0. The largest remainders are rounded up; what is missing to 65535 is
    /// never occluded.
    pub fn parts(&self) -> Vec<u32> {
        let exact = |ray: &LatticeRay| ray.weight * 65535.0;
        let mut parts: Vec<u32> = self.rays.iter().map(|ray| exact(ray) as u32).collect();
        let mut pairs: Vec<usize> = (0..parts.len()).filter(|&i| self.rays[i].forward()).collect();
        let left = (65534 - parts.iter().sum::<u32>()) / 2;
        pairs.sort_by(|&a, &b| exact(&self.rays[b]).fract().total_cmp(&exact(&self.rays[a]).fract()));
        for i in pairs.into_iter().take(left as usize) {
            let reverse = self.rays[i].step.map(|c| -c);
            parts.iter_mut().zip(&self.rays).for_each(|(part, ray)| {
                *part += u32::from(ray.step == self.rays[i].step || ray.step == reverse);
            });
        }
        parts
    }
}

impl LatticeRay {
    /// Whether its last component that is not 0 is positive. Sets are symmetric: the others are the reverses of these.
    pub fn forward(&self) -> bool {
        self.step.into_iter().rev().find(|&c| c != 0) > Some(0)
    }

    /// Length of a step in mm.
    pub fn length_mm(&self, spacing: [f64; 3]) -> f64 {
        (0..3).map(|i| (f64::from(self.step[i]) * spacing[i]).powi(2)).sum::<f64>().sqrt()
    }

    /// Segments of a ray of this radius: the nearest whole number, at least one.
    pub fn segments(&self, spacing: [f64; 3], radius_mm: f64) -> u32 {
        (radius_mm / self.length_mm(spacing)).round().max(1.0) as u32
    }

    /// Pieces of a segment, so that samples are at most `step_mm` apart.
    pub fn pieces(&self, spacing: [f64; 3], step_mm: f64) -> u32 {
        (self.length_mm(spacing) / step_mm - 1e-6).ceil().max(1.0) as u32
    }
}

fn weights(rays: &[LatticeRay]) -> Vec<f64> {
    rays.iter().map(|ray| ray.weight).collect()
}

fn unit(step: [i32; 3], spacing: [f64; 3]) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|i| f64::from(step[i]) * spacing[i])).normalize()
}

/// The lattice vector nearest to a direction in mm; of equally near ones the shortest in mm, then the first in order.
fn nearest(direction: DVec3, spacing: [f64; 3]) -> [i32; 3] {
    let mut best = ([0; 3], f64::NEG_INFINITY, f64::INFINITY);
    for x in -REACH..=REACH {
        for y in -REACH..=REACH {
            for z in -REACH..=REACH {
                let step = [x, y, z];
                if gcd(gcd(x.abs(), y.abs()), z.abs()) != 1 {
                    continue;
                }
                let cosine = unit(step, spacing).dot(direction);
                let length: f64 = (0..3).map(|i| (f64::from(step[i]) * spacing[i]).powi(2)).sum();
                // Mirror images must tie in spite of rounding.
                let nearer = cosine > best.1 + 1e-9;
                if nearer || (cosine > best.1 - 1e-9 && length < best.2 - 1e-9) {
                    best = (step, cosine, length);
                }
            }
        }
    }
    best.0
}

fn gcd(a: i32, b: i32) -> i32 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// G_ij = Σ_{l≤L} (2l+1) P_l(d_i·d_j).
fn gram(rays: &[LatticeRay], spacing: [f64; 3], degree: usize) -> Vec<Vec<f64>> {
    let units: Vec<DVec3> = rays.iter().map(|ray| unit(ray.step, spacing)).collect();
    let kernel = |x: f64| {
        let (mut before, mut now, mut sum) = (1.0, x, 1.0);
        for l in 1..=degree {
            sum += (2 * l + 1) as f64 * now;
            let next = ((2 * l + 1) as f64 * x * now - l as f64 * before) / (l + 1) as f64;
            (before, now) = (now, next);
        }
        sum
    };
    units.iter().map(|a| units.iter().map(|b| kernel(a.dot(*b))).collect()).collect()
}

/// √(wᵀGw − 2·1ᵀw + 1).
fn residual(gram: &[Vec<f64>], weights: &[f64]) -> f64 {
    let quadratic: f64 = gram
        .iter()
        .zip(weights)
        .map(|(row, w)| w * row.iter().zip(weights).map(|(g, v)| g * v).sum::<f64>())
        .sum();
    (quadratic - 2.0 * weights.iter().sum::<f64>() + 1.0).max(0.0).sqrt()
}

/// Non-negative least squares by coordinate descent over pairs of opposite directions, which share a weight; normalised to
/// the sum 1, for an empty volume must be unobstructed exactly.
fn fit(rays: &[LatticeRay], gram: &[Vec<f64>]) -> Vec<f64> {
    const SWEEPS: usize = 2000;
    let opposite: Vec<usize> = rays
        .iter()
        .map(|ray| rays.iter().position(|other| other.step == ray.step.map(|c| -c)).unwrap_or(0))
        .collect();
    let mut weights = vec![1.0 / rays.len() as f64; rays.len()];
    for _ in 0..SWEEPS {
        for i in 0..rays.len() {
            let j = opposite[i];
            if j < i {
                continue;
            }
            let slope: f64 = gram[i].iter().zip(&weights).map(|(g, w)| g * w).sum::<f64>()
                + gram[j].iter().zip(&weights).map(|(g, w)| g * w).sum::<f64>()
                - 2.0;
            let curvature = gram[i][i] + gram[j][j] + gram[i][j] + gram[j][i];
            let weight = (weights[i] - slope / curvature).max(0.0);
            (weights[i], weights[j]) = (weight, weight);
        }
    }
    weights.iter_mut().filter(|w| **w < 1e-6).for_each(|w| *w = 0.0);
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_spacing_keeps_the_set_and_lebedev_rules_are_exact() {
        for set in RaySet::ALL {
            let found = LatticeRays::new(set, [0.7; 3]);
            assert_eq!(found.rays.iter().map(|r| (r.step, r.weight)).collect::<Vec<_>>(), set.directions());
            let exact = matches!(set, RaySet::R6 | RaySet::W14 | RaySet::W26 | RaySet::W50);
            assert_eq!(found.residual < 1e-6, exact, "{} {}", set.name(), found.residual);
        }
    }

    #[test]
    fn directions_come_in_pairs_of_equal_weight_and_sum_to_one() {
        for set in RaySet::ALL {
            for spacing in [[1.0, 1.0, 1.5], [1.0, 1.0, 4.0], [0.5, 1.0, 3.0], [1.0, 1.0, 8.0]] {
                let rays = LatticeRays::new(set, spacing).rays;
                let sum: f64 = rays.iter().map(|r| r.weight).sum();
                assert!((sum - 1.0).abs() < 1e-4, "{} {spacing:?}: {sum}", set.name());
                for ray in &rays {
                    assert!(ray.weight > 0.0);
                    assert!(ray.step.iter().all(|c| c.abs() <= REACH));
                    let back = rays.iter().find(|r| r.step == ray.step.map(|c| -c)).unwrap();
                    assert!((back.weight - ray.weight).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn parts_are_the_weights_and_sum_to_what_a_texel_holds() {
        for set in RaySet::ALL {
            for spacing in [[1.0, 1.0, 1.0], [1.0, 1.0, 1.5], [0.5, 1.0, 3.0]] {
                let rays = LatticeRays::new(set, spacing);
                let parts = rays.parts();
                assert_eq!(parts.iter().sum::<u32>(), 65534, "{} {spacing:?}", set.name());
                for (ray, part) in rays.rays.iter().zip(&parts) {
                    assert!((f64::from(*part) - ray.weight * 65535.0).abs() < 1.0, "{ray:?} {part}");
                    let reverse = rays.rays.iter().position(|r| r.step == ray.step.map(|c| -c)).unwrap();
                    assert_eq!(parts[reverse], *part);
                }
            }
        }
    }

    /// Fitted weights are better than the set's own on the same directions, and moderate anisotropy stays accurate.
    #[test]
    fn fitted_weights_beat_equal_ones() {
        for spacing in [[1.0, 1.0, 1.5], [1.0, 1.0, 2.0], [1.0, 1.2, 3.0]] {
            let found = LatticeRays::new(RaySet::W26, spacing);
            let gram = gram(&found.rays, spacing, degree(RaySet::W26));
            let equal = residual(&gram, &vec![1.0 / found.rays.len() as f64; found.rays.len()]);
            assert!(found.residual < equal, "{spacing:?}: {} against {equal}", found.residual);
        }
    }

    #[test]
    fn the_nearest_vector_is_nearest_in_millimetres() {
        assert_eq!(nearest(DVec3::Z, [1.0, 1.0, 8.0]), [0, 0, 1]);
        let diagonal = DVec3::new(1.0, 0.0, 1.0).normalize();
        assert_eq!(nearest(diagonal, [1.0, 1.0, 2.0]), [2, 0, 1]);
        assert_eq!(nearest(diagonal, [1.0, 1.0, 3.0]), [3, 0, 1]);
        assert_eq!(nearest(-diagonal, [1.0, 1.0, 3.0]), [-3, 0, -1]);
    }
}
