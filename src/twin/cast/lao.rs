//! Local ambient occlusion (CAO §3.4 step 1).
//!
//! For ray k from voxel x, with samples s_m = o + (m − ½)Δ, m = 1 … M, along the unit vector in mm
//! (o = Δ/2 gives s_m = mΔ), a_m the trilinear opacity there and b_m = (1 − a_m)^(Δ/ℓ):
//!
//! ```text
//! left     A_k = 1/M Σ_m Π_{i<m} b_i                                              CAO eq. (2)
//! cell     A_k = 1/M Σ_m T_{m−1} (1 + b_m)/2,   T_m = T_{m−1} b_m                  method.md §3
//! segment  A_k = 1/((M−½)Δ) Σ_j L_j T_{j−1} (1 − b_j)/(L_j λ_j/ℓ),  b_j = exp(−L_j λ_j/ℓ)
//!          λ(q0, q1) = 1 − (q1 ln q1 − q0 ln q0)/(q1 − q0),  q = 1 − a             method.md §3
//! A(x) = Σ_k w_k A_k(x),  Σ_k w_k = 1                                             CAO eq. (3)
//! ```
//!
//! Eq. (3) is printed as A = 1/K Σ_k w_k A_k; the w_k here are w_k/K there, and of light that is not the same from everywhere the w_k' of
//! method.md §2.1.
//!
//! The segments run from the offset o, where q is the mean of its values at s_0 = o − Δ/2 and s_1, to s_1 (length
//! Δ/2), and from each sample to the next (length Δ). A segment with q below [`OPAQUE`] at both ends lets nothing
//! through and adds nothing, the limit of its formula.

use crate::{Grid, each, trilinear};
use cao_model::occlusion::{Occlusion, Quadrature};

/// Below this q = 1 − a counts as 0 where both ends of a segment are. λ grows without bound as q → 0, so the rounding
/// of eight interpolation weights, 1e-16 here and 6e-8 in a shader, would otherwise decide whether an opaque segment
/// adds nothing or a twentieth of its length.
pub const OPAQUE: f64 = 1e-6;
const _: () = assert!(OPAQUE as f32 == cao_kernels::shared::opaque::OPAQUE);

/// Ambient value of every voxel, 0 = fully occluded … 1 = unobstructed. `opacity` is V_o, per `reference_mm`.
pub fn lao(grid: &Grid, opacity: &[f32], occlusion: &Occlusion, reference_mm: f64) -> Vec<f64> {
    let rays = rays(grid, occlusion);
    each(grid.len(), |i| along(&rays, grid, opacity, occlusion, reference_mm, grid.voxel(i)))
}

/// The weight of each direction and every voxel's A_k along it, one at a time.
pub fn lao_by_direction<'a>(
    grid: &'a Grid,
    opacity: &'a [f32],
    occlusion: &'a Occlusion,
    reference_mm: f64,
) -> impl Iterator<Item = (f64, Vec<f64>)> + 'a {
    rays(grid, occlusion).into_iter().map(move |(direction, weight)| {
        let ray = [(direction, 1.0)];
        (weight, each(grid.len(), |i| along(&ray, grid, opacity, occlusion, reference_mm, grid.voxel(i))))
    })
}

/// Ambient value of one voxel.
pub fn lao_at(
    grid: &Grid,
    opacity: &[f32],
    occlusion: &Occlusion,
    reference_mm: f64,
    voxel: [usize; 3],
) -> f64 {
    along(&rays(grid, occlusion), grid, opacity, occlusion, reference_mm, voxel)
}

/// Unit vectors in mm, as index coordinates per mm, and weights.
pub(crate) fn rays(grid: &Grid, occlusion: &Occlusion) -> Vec<([f64; 3], f64)> {
    let per_mm = |v: [f64; 3]| std::array::from_fn(|i| v[i] / grid.spacing[i]);
    occlusion.weighted_directions().into_iter().map(|(v, weight)| (per_mm(v), weight)).collect()
}

/// Ambient value of one voxel along given [`rays`].
pub(crate) fn along(
    rays: &[([f64; 3], f64)],
    grid: &Grid,
    opacity: &[f32],
    occlusion: &Occlusion,
    reference_mm: f64,
    voxel: [usize; 3],
) -> f64 {
    let samples = occlusion.samples(grid.min_spacing());
    if samples == 0 {
        return 1.0;
    }
    let step = f64::from(occlusion.step(grid.min_spacing()));
    let first = f64::from(occlusion.first(grid.min_spacing()));
    let mut ambient = 0.0;
    for (direction, weight) in rays {
        // Opacity at s_m; s_0 lies one step before the first sample.
        let at = |m: u32| {
            let s = first + (f64::from(m) - 1.0) * step;
            let position = std::array::from_fn(|i| voxel[i] as f64 + s * direction[i]);
            // Eight weights of 1 may sum to a little more; opacity above 1 has no logarithm.
            trilinear(grid, opacity, position).min(1.0)
        };
        let ratio = step / reference_mm;
        ambient += weight
            * match occlusion.quadrature {
                Quadrature::Left => left(samples, ratio, at),
                Quadrature::Cell => cell(samples, ratio, at),
                Quadrature::Segment => segment(samples, ratio, at),
                rule => panic!("{rule:?} is a rule of rays by brick"),
            };
    }
    ambient
}

fn left(samples: u32, ratio: f64, opacity: impl Fn(u32) -> f64) -> f64 {
    let (mut sum, mut transmittance) = (0.0, 1.0);
    for m in 1..=samples {
        sum += transmittance;
        transmittance *= (1.0 - opacity(m)).powf(ratio);
    }
    sum / f64::from(samples)
}

fn cell(samples: u32, ratio: f64, opacity: impl Fn(u32) -> f64) -> f64 {
    let (mut sum, mut transmittance) = (0.0, 1.0);
    for m in 1..=samples {
        let b = (1.0 - opacity(m)).powf(ratio);
        sum += transmittance * (1.0 + b) / 2.0;
        transmittance *= b;
    }
    sum / f64::from(samples)
}

/// Lengths in steps.
fn segment(samples: u32, ratio: f64, opacity: impl Fn(u32) -> f64) -> f64 {
    let (mut sum, mut transmittance) = (0.0, 1.0);
    let second = 1.0 - opacity(1);
    let mut q0 = (1.0 - opacity(0) + second) / 2.0;
    for m in 1..=samples {
        let q1 = if m == 1 { second } else { 1.0 - opacity(m) };
        let length = if m == 1 { 0.5 } else { 1.0 };
        if q0.max(q1) < OPAQUE {
            break;
        }
        let depth = length * ratio * mean_extinction(q0, q1);
        sum += length * transmittance * mean_transmittance(depth);
        transmittance *= (-depth).exp();
        q0 = q1;
    }
    sum / (f64::from(samples) - 0.5)
}

/// λ, the mean of −ln q over q from q0 to q1, each in [0, 1], not both 0.
pub(crate) fn mean_extinction(q0: f64, q1: f64) -> f64 {
    let mean = (q0 + q1) / 2.0;
    let half = (q1 - q0) / 2.0;
    if half.abs() <= 1e-3 * mean {
        // Mean of −ln(1 + dt) over t in [−1, 1]; the quotient below would lose digits.
        let d = half / mean;
        return d * d / 6.0 + d.powi(4) / 20.0 - mean.ln();
    }
    let entropy = |q: f64| if q > 0.0 { q * q.ln() } else { 0.0 };
    1.0 - (entropy(q1) - entropy(q0)) / (q1 - q0)
}

/// (1 − e^−x)/x, the mean transmittance over an optical depth x.
pub(crate) fn mean_transmittance(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { -(-x).exp_m1() / x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::occlusion::RaySet;

    const UNIT: [f64; 3] = [1.0; 3];

    fn settings(rays: RaySet, quadrature: Quadrature, radius_mm: f32) -> Occlusion {
        Occlusion { rays, quadrature, radius_mm, ..Occlusion::paper(1.0) }
    }

    fn close(found: f64, expected: f64, what: &str) {
        assert!((found - expected).abs() < 1e-12, "{what}: {found}, expected {expected}");
    }

    #[test]
    fn empty_volume_is_unobstructed() {
        for dims in [[5, 5, 5], [1, 1, 1], [1, 7, 1], [3, 1, 2]] {
            let grid = Grid { dims, spacing: [1.0, 0.7, 2.0] };
            for rays in RaySet::ALL {
                for quadrature in Quadrature::CAST {
                    for value in lao(&grid, &vec![0.0; grid.len()], &settings(rays, quadrature, 4.0), 1.0) {
                        close(value, 1.0, "empty");
                    }
                }
            }
        }
    }

    #[test]
    fn radius_zero_is_unobstructed() {
        let grid = Grid { dims: [3, 3, 3], spacing: UNIT };
        for quadrature in Quadrature::CAST {
            assert_eq!(lao(&grid, &[1.0; 27], &settings(RaySet::R26, quadrature, 0.0), 1.0), [1.0; 27]);
        }
    }

    /// Closed forms for opacity a everywhere, with q = (1−a)^(Δ/ℓ).
    fn uniform(quadrature: Quadrature, q: f64, m: f64) -> f64 {
        if q == 1.0 {
            return 1.0;
        }
        match quadrature {
            Quadrature::Left => (1.0 - q.powf(m)) / (m * (1.0 - q)),
            Quadrature::Cell => (1.0 - q.powf(m)) / (m * (1.0 - q)) * (1.0 + q) / 2.0,
            Quadrature::Segment if q == 0.0 => 0.0,
            Quadrature::Segment => (1.0 - q.powf(m - 0.5)) / (-(m - 0.5) * q.ln()),
            rule => panic!("{rule:?}"),
        }
    }

    #[test]
    fn uniform_opacity_has_the_closed_form() {
        let grid = Grid { dims: [15, 15, 15], spacing: UNIT };
        for rays in RaySet::ALL {
            for quadrature in Quadrature::CAST {
                for a in [0.0, 1e-6_f32, 0.1, 0.5, 0.97, 1.0] {
                    let opacity = vec![a; grid.len()];
                    let found = lao_at(&grid, &opacity, &settings(rays, quadrature, 6.0), 1.0, [7, 7, 7]);
                    let expected = uniform(quadrature, 1.0 - f64::from(a), 6.0);
                    assert!(
                        (found - expected).abs() < 1e-9,
                        "{} {} a={a}: {found}, expected {expected}",
                        rays.name(),
                        quadrature.name()
                    );
                }
            }
        }
        // Eq. (2) as printed, by hand: a = 1/2, M = 3: (1 + 1/2 + 1/4)/3.
        close(uniform(Quadrature::Left, 0.5, 3.0), 1.75 / 3.0, "by hand");
    }

    #[test]
    fn uniform_opacity_is_corrected_when_the_step_is_not_the_reference_length() {
        let grid = Grid { dims: [21, 21, 21], spacing: UNIT };
        let opacity = vec![0.25; grid.len()];
        for quadrature in Quadrature::CAST {
            for (step, reference) in [(2.0_f32, 1.0), (0.5, 1.0), (1.0, 3.0)] {
                let occlusion = Occlusion { step_mm: Some(step), ..settings(RaySet::R14, quadrature, 6.0) };
                let found = lao_at(&grid, &opacity, &occlusion, reference, [10, 10, 10]);
                let q = 0.75_f64.powf(f64::from(step) / reference);
                close(found, uniform(quadrature, q, 6.0 / f64::from(step)), quadrature.name());
            }
        }
    }

    /// The value is the same in mm whatever the unit of length.
    #[test]
    fn scaling_every_length_changes_nothing() {
        let grid = Grid { dims: [6, 5, 7], spacing: [1.0, 1.5, 2.0] };
        let opacity = crate::random::Random(3).opacities(grid.len());
        for quadrature in Quadrature::CAST {
            let one = lao(&grid, &opacity, &settings(RaySet::W26, quadrature, 4.0), 1.0);
            let larger = Grid { spacing: grid.spacing.map(|s| s * 4.0), ..grid };
            let four = lao(&larger, &opacity, &settings(RaySet::W26, quadrature, 16.0), 4.0);
            assert_eq!(one, four);
        }
    }

    /// Opaque half-space z ≥ 8, eye at distance 1 below it: the ray upwards keeps its first sample only.
    #[test]
    fn opaque_half_space_leaves_five_rays_of_six() {
        let grid = Grid { dims: [15, 15, 15], spacing: UNIT };
        let opacity: Vec<f32> =
            (0..grid.len()).map(|i| if grid.voxel(i)[2] >= 8 { 1.0 } else { 0.0 }).collect();
        let value =
            |quadrature| lao_at(&grid, &opacity, &settings(RaySet::R6, quadrature, 5.0), 1.0, [7, 7, 7]);
        close(value(Quadrature::Left), (5.0 + 1.0 / 5.0) / 6.0, "left");
        close(value(Quadrature::Cell), (5.0 + 0.5 / 5.0) / 6.0, "cell");
        // Half a step with q from ½ to 0: λ = 1 − ln ½. The next segment is opaque at both ends and adds nothing.
        let depth = 0.5 * (1.0 + 2.0_f64.ln());
        let up = 0.5 * (1.0 - (-depth).exp()) / depth;
        close(value(Quadrature::Segment), (5.0 + up / 4.5) / 6.0, "segment");
    }

    /// Opacity a in z ≥ 8 on all ray sets: the trilinear opacity at height h above the eye is a·clamp(h, 0, 1).
    #[test]
    fn half_space_darkens_each_ray_by_its_slope() {
        let grid = Grid { dims: [19, 19, 19], spacing: UNIT };
        let a = 0.4_f32;
        let opacity: Vec<f32> =
            (0..grid.len()).map(|i| if grid.voxel(i)[2] >= 10 { a } else { 0.0 }).collect();
        for rays in RaySet::ALL {
            let expected: f64 = rays
                .directions()
                .iter()
                .map(|&([_, _, slope], weight)| {
                    let (mut sum, mut t) = (0.0, 1.0);
                    for m in 1..=7 {
                        sum += t;
                        t *= 1.0 - f64::from(a) * (f64::from(m) * slope).clamp(0.0, 1.0);
                    }
                    weight * sum / 7.0
                })
                .sum();
            let found = lao_at(&grid, &opacity, &settings(rays, Quadrature::Left, 7.0), 1.0, [9, 9, 9]);
            close(found, expected, &rays.name());
        }
    }

    /// With six rays a single opaque voxel darkens exactly the voxels on its three lines, nearer than M steps; the
    /// ray that meets it at step d keeps d of its M terms.
    #[test]
    fn single_opaque_voxel_is_seen_along_its_lines_only() {
        let grid = Grid { dims: [17, 17, 17], spacing: UNIT };
        let mut opacity = vec![0.0; grid.len()];
        opacity[grid.index([8, 8, 8])] = 1.0;
        let values = lao(&grid, &opacity, &settings(RaySet::R6, Quadrature::Left, 6.0), 1.0);
        assert_eq!(values.iter().filter(|&&v| v < 1.0 - 1e-12).count(), 6 * 5);
        for (i, &value) in values.iter().enumerate() {
            let offset: Vec<i32> = grid.voxel(i).iter().map(|&c| c as i32 - 8).filter(|&c| c != 0).collect();
            let lit = match offset[..] {
                [d] if d.abs() <= 6 => 1.0 - (1.0 - f64::from(d.abs()) / 6.0) / 6.0,
                _ => 1.0,
            };
            close(value, lit, "single voxel");
        }
    }

    /// From four voxels on, no ray but the axis' own comes within a voxel of an opaque voxel on the axis: the
    /// flattest, (3,1,1), is a voxel beside the axis after its third step, at 2.7.
    #[test]
    fn single_opaque_voxel_costs_its_ray_weight_in_every_set() {
        let grid = Grid { dims: [17, 17, 17], spacing: UNIT };
        let mut opacity = vec![0.0; grid.len()];
        opacity[grid.index([8, 8, 8])] = 1.0;
        for rays in RaySet::ALL {
            let axis = rays.directions().iter().find(|d| d.0 == [1.0, 0.0, 0.0]).unwrap().1;
            for d in 4..=6_usize {
                for eye in
                    [[8 - d, 8, 8], [8 + d, 8, 8], [8, 8 - d, 8], [8, 8 + d, 8], [8, 8, 8 - d], [8, 8, 8 + d]]
                {
                    let found = lao_at(&grid, &opacity, &settings(rays, Quadrature::Left, 6.0), 1.0, eye);
                    close(found, 1.0 - axis * (1.0 - d as f64 / 6.0), &rays.name());
                }
            }
        }
    }

    /// Spacing (1, 1, 2), steps of 1 mm: along z every other sample lies halfway between voxels.
    #[test]
    fn steps_are_millimetres_on_every_axis() {
        let grid = Grid { dims: [17, 17, 17], spacing: [1.0, 1.0, 2.0] };
        let mut opacity = vec![0.0; grid.len()];
        opacity[grid.index([8, 8, 8])] = 1.0;
        let occlusion = settings(RaySet::R6, Quadrature::Left, 9.0);
        // 3 voxels = 6 mm away: opacity ½ at 5 mm, 1 at 6 mm.
        let found = lao_at(&grid, &opacity, &occlusion, 1.0, [8, 8, 5]);
        close(found, (5.0 + 5.5 / 9.0) / 6.0, "along z");
        let found = lao_at(&grid, &opacity, &occlusion, 1.0, [5, 8, 8]);
        close(found, (5.0 + 3.0 / 9.0) / 6.0, "along x");
    }

    /// Offset 0 moves the samples to the middle of the steps.
    #[test]
    fn offset_moves_every_sample() {
        let grid = Grid { dims: [17, 17, 17], spacing: UNIT };
        let mut opacity = vec![0.0; grid.len()];
        opacity[grid.index([8, 8, 8])] = 1.0;
        let at = |offset| {
            let occlusion =
                Occlusion { offset_mm: Some(offset), ..settings(RaySet::R6, Quadrature::Left, 8.0) };
            lao_at(&grid, &opacity, &occlusion, 1.0, [5, 8, 8])
        };
        // Samples at 2.5 and 3.5 mm meet opacity ½ each: 3 full terms, ½, then ¼ four times.
        close(at(0.0), (5.0 + (3.0 + 0.5 + 4.0 * 0.25) / 8.0) / 6.0, "offset 0");
        close(at(0.5), (5.0 + 3.0 / 8.0) / 6.0, "half a step is the default");
        close(at(1.5), (5.0 + 2.0 / 8.0) / 6.0, "one step further");
    }

    #[test]
    fn values_stay_between_zero_and_one_on_odd_shapes() {
        for dims in [[1, 1, 1], [1, 9, 1], [2, 1, 5], [4, 3, 6]] {
            let grid = Grid { dims, spacing: [0.3, 1.0, 2.5] };
            let opacity = crate::random::Random(11).opacities(grid.len());
            for rays in RaySet::ALL {
                for quadrature in Quadrature::CAST {
                    for offset in [None, Some(0.0), Some(0.7)] {
                        let occlusion = Occlusion { offset_mm: offset, ..settings(rays, quadrature, 2.0) };
                        for value in lao(&grid, &opacity, &occlusion, 0.5) {
                            assert!((0.0..=1.0 + 1e-12).contains(&value), "{dims:?}: {value}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn mean_extinction_is_the_mean_of_minus_log() {
        for (q0, q1) in [(0.2, 0.9), (0.9, 0.2), (1.0, 0.0), (0.5, 0.5001), (0.3, 0.3 * 1.0021), (0.7, 0.7)] {
            let n = 200_000;
            let brute: f64 =
                (0..n).map(|i| -(q0 + (q1 - q0) * (f64::from(i) + 0.5) / f64::from(n)).ln()).sum::<f64>()
                    / f64::from(n);
            assert!((mean_extinction(q0, q1) - brute).abs() < 1e-5, "{q0} {q1}");
        }
        assert_eq!(mean_extinction(1.0, 1.0), 0.0);
    }

    /// Opacity 1 that interpolation has rounded is opacity 1.
    #[test]
    fn rounding_of_opaque_samples_does_not_show() {
        for below in [0.0, 1e-16, 6e-8] {
            assert_eq!(segment(6, 1.0, |_| 1.0 - below), 0.0);
        }
    }

    /// A rule's value against the integral that it approximates, from the offset over the length that it normalises
    /// by, on a field that is smooth along the rays: printed order 1 for eq. (2), order 2 for the segment rule.
    #[test]
    fn segment_rule_converges_faster_than_the_printed_sum() {
        let grid = Grid { dims: [33, 3, 3], spacing: UNIT };
        // Varies along x slowly; lateral rays leave the volume at once, the same for every step.
        let opacity: Vec<f32> =
            (0..grid.len()).map(|i| 0.4 - 0.3 * (grid.voxel(i)[0] as f32 * 0.35).cos()).collect();
        let eye = [16, 1, 1];
        let offset = 0.5_f64;
        let error = |quadrature: Quadrature, step: f64| {
            let occlusion = Occlusion {
                offset_mm: Some(offset as f32),
                step_mm: Some(step as f32),
                ..settings(RaySet::R6, quadrature, 8.0)
            };
            let length = if quadrature == Quadrature::Segment { 8.0 - step / 2.0 } else { 8.0 };
            let integral: f64 = RaySet::R6
                .directions()
                .iter()
                .map(|&(v, weight)| {
                    let n = 20_000;
                    let h = length / f64::from(n);
                    let (mut depth, mut sum) = (0.0, 0.0);
                    for i in 0..n {
                        let s = offset + (f64::from(i) + 0.5) * h;
                        let at = std::array::from_fn(|a| eye[a] as f64 + s * v[a]);
                        let tau = -(1.0 - trilinear(&grid, &opacity, at)).ln();
                        sum += (-(depth + tau * h / 2.0)).exp() * h;
                        depth += tau * h;
                    }
                    weight * sum / length
                })
                .sum();
            (lao_at(&grid, &opacity, &occlusion, 1.0, eye) - integral).abs()
        };
        for step in [1.0, 0.5, 0.25] {
            let (left, segment) = (error(Quadrature::Left, step), error(Quadrature::Segment, step));
            assert!(segment < left / 4.0, "step {step}: {segment} against {left}");
        }
        let order = |quadrature| (error(quadrature, 0.5) / error(quadrature, 0.0625)).log2() / 3.0;
        let (left, segment) = (order(Quadrature::Left), order(Quadrature::Segment));
        assert!((left - 1.0).abs() < 0.3, "order of eq. (2): {left}");
        assert!(segment > 1.6, "order of the segment rule: {segment}");
    }
}
