//! From clusters to ambient factors (docs/histograms.md): `A_c = 1 − Σ_j α_j LH_cj`, LH in 32767ths, α_j the opacity of bin j in a smallest
//! spacing, `1 − (1 − opacity(least + (most − least) j / 63))^e`, e = smallest spacing / reference length.

use cao_kernels::histogram::{BINS, WHOLE_SHARE};
use cao_model::transfer::TransferFunction;

/// The ambient factor of a cluster, of values from `least` to `most`.
pub fn factor(centre: &[u32], transfer: &TransferFunction, [least, most]: [f32; 2], exponent: f64) -> f64 {
    let alpha = |j: usize| {
        let t = j as f32 / (BINS - 1) as f32;
        let value = if j as u32 == BINS - 1 { most } else { least * (1.0 - t) + most * t };
        1.0 - (1.0 - f64::from(transfer.opacity_at(value))).powf(exponent)
    };
    let hidden: f64 = centre.iter().enumerate().map(|(j, share)| f64::from(*share) * alpha(j)).sum();
    (1.0 - hidden / f64::from(WHOLE_SHARE)).clamp(0.0, 1.0)
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
}
