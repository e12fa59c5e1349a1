//! Converged ambient occlusion (measure.md §1), the truth that every method is measured against.
//!
//! From a point x, over directions ω spread evenly over the sphere, with τ = −ln(1 − a)/ℓ of the trilinear opacity a, which is
//! 0 outside the volume:
//!
//! ```text
//! ambient  A(x) = 1/4π ∫ dω 1/(R − o) ∫_o^R exp(−∫_o^s τ) ds
//! literal  A(x) = 1/4π ∫ dω 1/M Σ_m Π_{i<m} (1 − a_i)^(Δ/ℓ)        CAO eq. (2) and (3) with ever more rays
//! ```
//!
//! The ambient integral takes τ as constant over each step h, at its middle: a step of depth t = hτ adds
//! h·T·(1 − e^−t)/t and leaves T·e^−t, second order in h. Where 1 − a is below [`OPAQUE`] it is 0.

use super::lao::{OPAQUE, mean_transmittance};
use super::{Grid, each, trilinear};
use crate::occlusion::{Integral, Rule, fibonacci};

/// Ambient value at each position (index coordinates), 0 = fully occluded … 1 = unobstructed. `opacity` is V_o, per
/// `reference_mm`.
pub fn reference(
    grid: &Grid,
    opacity: &[f32],
    integral: &Integral,
    reference_mm: f64,
    positions: &[[f64; 3]],
) -> Vec<f64> {
    let directions = fibonacci(integral.directions);
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
        directions.iter().map(|d| ray(positions[i], d)).sum::<f64>() / f64::from(integral.directions)
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
        };
        transmittance *= (-depth).exp();
        if transmittance == 0.0 {
            break;
        }
    }
    sum / f64::from(integral.samples)
}
