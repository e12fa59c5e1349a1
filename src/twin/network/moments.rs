//! Mean and biased variance of each channel (DVAO eq. (2)): Σ x / n, Σ (x − mean)² / n over its n voxels.

use super::Tensor;

/// Of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    /// Σ x / n.
    pub mean: f64,
    /// Σ (x − mean)² / n.
    pub variance: f64,
}

/// What is added to a variance, so that a constant is divided by something.
pub const EPSILON: f64 = 1e-5;

impl Moments {
    /// Those that leave values as they are.
    pub const NONE: Self = Self { mean: 0.0, variance: 1.0 - EPSILON };

    /// The normalised value.
    pub fn normal(&self, value: f32) -> f32 {
        ((f64::from(value) - self.mean) / (self.variance + EPSILON).sqrt()) as f32
    }
}

/// Of every channel.
pub fn moments(input: &Tensor) -> Vec<Moments> {
    let n = input.voxels() as f64;
    let of = |values: &[f32]| {
        let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
        let variance = values.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / n;
        Moments { mean, variance }
    };
    input.channels().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_becomes_zero_and_two_values_plus_and_minus_one() {
        let input = Tensor { dims: [2, 1, 2], values: vec![7.0, 7.0, 7.0, 7.0, 1.0, 5.0, 5.0, 1.0] };
        let [constant, two] = moments(&input)[..] else { panic!("two channels") };
        assert_eq!(
            (constant, two),
            (Moments { mean: 7.0, variance: 0.0 }, Moments { mean: 3.0, variance: 4.0 })
        );
        assert_eq!(constant.normal(7.0), 0.0);
        let one = 2.0 / 4.00001_f64.sqrt();
        assert_eq!([1.0, 5.0].map(|v| two.normal(v)), [-one as f32, one as f32]);
        assert_eq!([-3.5, 0.0, 0.1].map(|v| Moments::NONE.normal(v)), [-3.5, 0.0, 0.1]);
    }

    /// Sums of f16 end at 65504, those of f32 lose a mean far from 0.
    #[test]
    fn many_large_values_that_hardly_differ_keep_their_variance() {
        let values = (0..32 * 32 * 32).map(|i| 4096.0 + (i % 2) as f32 / 64.0).collect();
        let [found] = moments(&Tensor { dims: [32; 3], values })[..] else { panic!("one channel") };
        assert!(
            (found.mean - (4096.0 + 1.0 / 128.0)).abs() < 1e-9
                && (found.variance * 16384.0 - 1.0).abs() < 1e-6,
            "{found:?}"
        );
    }
}
