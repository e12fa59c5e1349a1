//! From clusters to ambient factors (docs/histograms.md): `A_c = 1 − Σ_j α_j LH_cj`, LH in 32767ths, α_j the opacity of bin j in a smallest
//! spacing, `1 − (1 − opacity(least + (most − least) j / 63))^e`, e = smallest spacing / reference length.
//!
//! With colour bleeding b it has red, green and blue: `A_c + b C_c`, where `C_c = Σ_j α_j rgb_j LH_cj` is what the neighbourhood would show of
//! its colours in full light, rgb_j the colour of bin j.

use cao_kernels::histogram::{BINS, WHOLE_SHARE};
use cao_model::transfer::TransferFunction;

/// The value of a bin, of those from `least` to `most`.
fn value([least, most]: [f32; 2], bin: usize) -> f32 {
    let t = bin as f32 / (BINS - 1) as f32;
    if bin as u32 == BINS - 1 { most } else { least * (1.0 - t) + most * t }
}

/// The sum over the bins of what is opaque, each as `of` weighs its value.
fn hidden(
    centre: &[u32],
    transfer: &TransferFunction,
    range: [f32; 2],
    exponent: f64,
    of: impl Fn(f32) -> f64,
) -> f64 {
    let bin = |(j, share): (usize, &u32)| {
        let value = value(range, j);
        let alpha = 1.0 - (1.0 - f64::from(transfer.opacity_at(value))).powf(exponent);
        f64::from(*share) / f64::from(WHOLE_SHARE) * alpha * of(value)
    };
    centre.iter().enumerate().map(bin).sum()
}

/// The ambient factor of a cluster, of values from `least` to `most`.
pub fn factor(centre: &[u32], transfer: &TransferFunction, range: [f32; 2], exponent: f64) -> f64 {
    (1.0 - hidden(centre, transfer, range, exponent, |_| 1.0)).clamp(0.0, 1.0)
}

/// The same in red, green and blue, with colour bleeding.
pub fn coloured(
    centre: &[u32],
    transfer: &TransferFunction,
    range: [f32; 2],
    exponent: f64,
    bleeding: f64,
) -> [f64; 3] {
    std::array::from_fn(|c| {
        let colour = |value| f64::from(transfer.colour_at(value)[c]);
        let lent = bleeding * hidden(centre, transfer, range, exponent, colour);
        (1.0 - hidden(centre, transfer, range, exponent, |_| 1.0) + lent).clamp(0.0, 1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_histogram_of_one_value_lets_through_what_that_value_does() {
        let points = vec![[0.0, 0.0], [100.0, 0.5]];
        let transfer = TransferFunction::new(points, vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap();
        let mut centre = vec![0; BINS as usize];
        centre[63] = WHOLE_SHARE;
        assert_eq!(factor(&centre, &transfer, [0.0, 100.0], 1.0), 0.5);
        assert_eq!(factor(&centre, &transfer, [0.0, 100.0], 2.0), 0.25);
        centre.rotate_left(63);
        assert_eq!(factor(&centre, &transfer, [0.0, 100.0], 1.0), 1.0);
    }

    /// Uniform matter of opacity a and colour c around a place: `1 − a + b a c`. White matter that gives everything back hides nothing, nothing
    /// around a place hides nothing.
    #[test]
    fn matter_lends_its_colour_as_far_as_it_hides() {
        let colour = vec![[0.0, 0.8, 0.2, 0.0], [100.0, 1.0, 1.0, 1.0]];
        let transfer = TransferFunction::new(vec![[0.0, 0.5], [100.0, 0.25]], colour, None).unwrap();
        let of = |shares: [u32; 2], exponent, bleeding| {
            let mut centre = vec![0; BINS as usize];
            (centre[0], centre[63]) = (shares[0], shares[1]);
            coloured(&centre, &transfer, [0.0, 100.0], exponent, bleeding)
        };
        let near = |found: [f64; 3], expected: [f64; 3]| {
            assert!((0..3).all(|c| (found[c] - expected[c]).abs() < 1e-6), "{found:?} {expected:?}");
        };
        let whole = WHOLE_SHARE;
        near(of([whole, 0], 1.0, 1.0), [0.9, 0.6, 0.5]);
        near(of([whole, 0], 1.0, 0.5), [0.7, 0.55, 0.5]);
        near(of([whole, 0], 2.0, 1.0), [0.85, 0.4, 0.25]);
        near(of([whole, 0], 1.0, 0.0), [0.5; 3]);
        near(of([0, whole], 1.0, 1.0), [1.0; 3]);
        near(of([0, whole], 1.0, 0.0), [0.75; 3]);
        near(of([0, 0], 1.0, 1.0), [1.0; 3]);
    }
}
