//! Converged ambient occlusion (measure.md §1), the truth that every method is measured against.
//!
//! From a point x, over directions ω spread evenly over the sphere, with τ = −ln(1 − a)/ℓ of the trilinear opacity a, which is
//! 0 outside the volume:
//!
//! ```text
//! ambient  A(x) = 1/4π ∫ L(ω) dω 1/(R − o) ∫_o^R exp(−∫_o^s τ) ds                 L: light from ω, its mean 1
//! literal  A(x) = 1/4π ∫ L(ω) dω 1/M Σ_m Π_{i<m} (1 − a_i)^(Δ/ℓ)        CAO eq. (2) and (3) with ever more rays
//! end      A(x) = 1/4π ∫ L(ω) dω Π_i (1 − a_i)^(Δ/ℓ)                      DVAO eq. (1) as programmed: a ray stops below 0.01
//! ```
//!
//! The ambient integral takes τ as constant over each step h, at its middle: a step of depth t = hτ adds
//! h·T·(1 − e^−t)/t and leaves T·e^−t, second order in h. Where 1 − a is below [`OPAQUE`] it is 0.

use crate::cast::lao::{OPAQUE, mean_transmittance};
use crate::{Grid, each, trilinear};
use cao_model::occlusion::{Integral, Rule};

/// Ambient value at each position (index coordinates), 0 = fully occluded … 1 = unobstructed. `opacity` is V_o, per
/// `reference_mm`.
///
/// # Panics
/// With coloured light, or light from nowhere.
pub fn reference(
    grid: &Grid,
    opacity: &[f32],
    integral: &Integral,
    reference_mm: f64,
    positions: &[[f64; 3]],
) -> Vec<f64> {
    let directions = integral.lit_directions().expect("light of one colour");
    let ray = |at: [f64; 3], direction: &[f64; 3]| {
        let opacity_at = |m: u32| {
            let s = integral.first_mm + f64::from(m) * integral.step_mm;
            let position = std::array::from_fn(|i| at[i] + s * direction[i] / grid.spacing[i]);
            trilinear(grid, opacity, position)
        };
        along(integral, integral.step_mm / reference_mm, opacity_at)
    };
    each(positions.len(), |i| {
        if integral.samples == 0 || integral.directions == 0 {
            return 1.0;
        }
        directions.iter().map(|(d, light)| light * ray(positions[i], d)).sum::<f64>()
            / directions.len() as f64
    })
}

/// Value of one ray; `ratio` is a step in reference lengths.
fn along(integral: &Integral, ratio: f64, opacity_at: impl Fn(u32) -> f64) -> f64 {
    let (mut sum, mut transmittance) = (0.0, 1.0);
    for m in 0..integral.samples {
        let q = 1.0 - opacity_at(m);
        let depth = if q < OPAQUE { f64::INFINITY } else { -ratio * q.min(1.0).ln() };
        sum += match integral.rule {
            Rule::Ambient => transmittance * mean_transmittance(depth),
            Rule::Literal => transmittance,
            Rule::End => 0.0,
        };
        transmittance *= (-depth).exp();
        let stops = integral.rule == Rule::End && transmittance < f64::from(Integral::STOP);
        if transmittance == 0.0 || stops {
            break;
        }
    }
    match integral.rule {
        Rule::End => transmittance,
        Rule::Ambient | Rule::Literal => sum / f64::from(integral.samples),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use cao_model::light::AmbientLight;

    fn close(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() < tolerance, "{found}, expected {expected}");
    }

    const BLOCK: Grid = Grid { dims: [17; 3], spacing: [1.0; 3] };

    #[test]
    fn nothing_around_and_no_radius_leave_a_point_unobstructed() {
        for grid in [BLOCK, Grid { dims: [1, 4, 2], spacing: [1.0, 0.5, 3.0] }] {
            let rays = Integral::ambient(5.0, 0.5, 4, 50, grid.min_spacing());
            close(reference(&grid, &vec![0.0; grid.len()], &rays, 1.0, &[[0.0; 3]])[0], 1.0, 1e-12);
            let solid = vec![1.0; grid.len()];
            for none in [
                Integral::ambient(0.5, 0.5, 4, 50, 1.0),
                Integral::ambient(0.0, 0.0, 4, 50, 1.0),
                Integral::literal(0.0, 50, 1.0),
            ] {
                assert_eq!(reference(&grid, &solid, &none, 1.0, &[[0.0; 3]]), [1.0]);
            }
        }
    }

    /// τ = −ln(1 − a)/ℓ everywhere: A = (1 − e^−x)/x with x = τ(R − o), whatever the steps; eq. (2) is a geometric series.
    #[test]
    fn even_opacity_has_its_closed_form() {
        for (a, reference_mm) in [(0.01_f32, 1.0), (0.3, 1.0), (0.3, 2.5), (0.9, 0.4)] {
            let opacity = vec![a; BLOCK.len()];
            let tau = -(1.0 - f64::from(a)).ln() / reference_mm;
            let x = tau * (7.0 - 0.5);
            let rays = Integral::ambient(7.0, 0.5, 3, 20, 1.0);
            close(
                reference(&BLOCK, &opacity, &rays, reference_mm, &[[8.0; 3]])[0],
                (1.0 - (-x).exp()) / x,
                1e-7,
            );
            let (q, rays) = ((-tau).exp(), Integral::literal(7.0, 20, 1.0));
            let series = (1.0 - q.powi(7)) / (1.0 - q) / 7.0;
            close(reference(&BLOCK, &opacity, &rays, reference_mm, &[[8.0; 3]])[0], series, 1e-7);
            // Twelve samples of half a voxel; a ray stops behind the first that leaves less than a hundredth.
            let left = |count: i32| (-0.5 * tau * f64::from(count)).exp();
            let stopped = (1..=12).find(|count| left(*count) < 0.01).unwrap_or(12);
            let rays = Integral::end(6.0, 20, 1.0);
            close(reference(&BLOCK, &opacity, &rays, reference_mm, &[[8.0; 3]])[0], left(stopped), 1e-7);
        }
    }

    /// An opaque wall at distance d: rays at an angle of cosine u > d/R go on for d/u, so that with R − o = L
    /// A = 1 − ½ ∫ (R − d/u)/L du = 1 − (R − d − d ln(R/d))/(2L).
    #[test]
    fn opaque_wall_has_its_closed_form() {
        let opacity: Vec<f32> =
            (0..BLOCK.len()).map(|i| if BLOCK.voxel(i)[0] >= 12 { 1.0 } else { 0.0 }).collect();
        let (r, o) = (7.5, 0.5);
        // Of a reference length so short, all that is not clear is opaque: from index 11 on.
        for x in [8.0, 9.25, 5.0] {
            let d: f64 = 11.0 - x;
            let expected = 1.0 - (r - d - d * (r / d).ln()) / (2.0 * (r - o));
            let found = |steps| {
                let rays = Integral::ambient(r, o, steps, 4000, 1.0);
                reference(&BLOCK, &opacity, &rays, 1e-4, &[[x, 8.0, 8.0]])[0]
            };
            // A ray ends up to half a step before or behind the wall.
            close(found(8), expected, 0.5 / 8.0 / (r - o) + 1e-3);
            close(found(64), expected, 0.5 / 64.0 / (r - o) + 1e-3);
        }
    }

    /// In a sky's light from behind the wall, of which 2u du comes at cosines of u, A = 1 − 2 ∫ u (R − d/u)/L du = 1 − (R − d)²/(RL); in one from
    /// the other side all of it.
    #[test]
    fn an_opaque_wall_in_front_of_a_sky_has_its_closed_form() {
        let opacity: Vec<f32> =
            (0..BLOCK.len()).map(|i| if BLOCK.voxel(i)[0] >= 12 { 1.0 } else { 0.0 }).collect();
        let (r, o, d) = (7.5, 0.5, 3.0);
        let found = |x| {
            let light = AmbientLight::Sky([x, 0.0, 0.0]);
            let rays = Integral { light, ..Integral::ambient(r, o, 64, 4000, 1.0) };
            reference(&BLOCK, &opacity, &rays, 1e-4, &[[8.0; 3]])[0]
        };
        close(found(1.0), 1.0 - (r - d) * (r - d) / (r * (r - o)), 0.5 / 64.0 / (r - o) + 2e-3);
        close(found(-3.0), 1.0, 1e-12);
    }

    /// One ray through opacity linear from 0.1 to 0.8 over 8 mm: halving the step quarters the error.
    #[test]
    fn steps_are_of_second_order() {
        let value = |steps: u32| {
            let ray = Integral { directions: 1, ..Integral::ambient(8.0, 0.0, steps, 1, 1.0) };
            along(&ray, ray.step_mm, |m| 0.1 + 0.7 / 8.0 * (ray.first_mm + f64::from(m) * ray.step_mm))
        };
        let truth = value(4096);
        let errors = [2, 4, 8, 16].map(|steps| (value(steps) - truth).abs());
        assert!(errors[0] > 1e-6);
        errors.windows(2).for_each(|e| close(e[0] / e[1], 4.0, 0.1));
    }

    #[test]
    fn opaque_and_random_volumes_stay_within_bounds() {
        let grid = Grid { dims: [5, 6, 7], spacing: [1.0, 0.5, 2.0] };
        let mut random = Random(3);
        let blocks: Vec<f32> = (0..grid.len()).map(|_| random.unit().round()).collect();
        for opacity in [vec![1.0; grid.len()], blocks, random.opacities(grid.len())] {
            let points: Vec<[f64; 3]> = (0..grid.len()).map(|i| grid.voxel(i).map(|c| c as f64)).collect();
            for rays in [Integral::ambient(4.0, 0.25, 8, 30, 0.5), Integral::literal(4.0, 30, 0.5)] {
                let found = reference(&grid, &opacity, &rays, 0.5, &points);
                assert!(found.iter().all(|a| (0.0..=1.0).contains(a)));
            }
        }
        // In the middle of a solid nothing comes in from beyond the first step.
        let solid = vec![1.0; BLOCK.len()];
        let deep = |rays| reference(&BLOCK, &solid, &rays, 1.0, &[[8.0; 3]])[0];
        assert_eq!(deep(Integral::ambient(5.0, 0.5, 8, 30, 1.0)), 0.0);
        close(deep(Integral::literal(5.0, 30, 1.0)), 0.2, 1e-12);
    }

    /// Twice the spacing, radius, offset and reference length see the same.
    #[test]
    fn lengths_are_millimetres() {
        let mut random = Random(9);
        let grid = Grid { dims: [6, 5, 4], spacing: [1.0, 1.5, 0.8] };
        let opacity = random.opacities(grid.len());
        let point = [[2.0, 3.0, 1.0]];
        let rays = Integral::ambient(4.0, 0.4, 4, 40, 0.8);
        let once = reference(&grid, &opacity, &rays, 1.0, &point)[0];
        let twice = Grid { spacing: grid.spacing.map(|s| 2.0 * s), ..grid };
        let rays = Integral::ambient(8.0, 0.8, 4, 40, 1.6);
        close(reference(&twice, &opacity, &rays, 2.0, &point)[0], once, 1e-12);
        assert!((reference(&twice, &opacity, &rays, 1.0, &point)[0] - once).abs() > 1e-3);
    }
}
