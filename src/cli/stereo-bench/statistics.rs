//! Percentiles of measured times.

/// The smallest of the values that at least `percent` of them do not exceed (nearest rank): always a value that was measured. NaN
/// for none.
pub fn percentile(values: &[f64], percent: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (percent / 100.0 * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.clamp(1, sorted.len().max(1)) - 1).copied().unwrap_or(f64::NAN)
}

/// The 50th percentile.
pub fn median(values: &[f64]) -> f64 {
    percentile(values, 50.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_values_that_were_measured() {
        let values: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        assert_eq!(
            [0.0, 50.0, 95.0, 99.0, 100.0].map(|p| percentile(&values, p)),
            [1.0, 100.0, 190.0, 198.0, 200.0]
        );
        assert_eq!([50.0, 95.0, 99.0].map(|p| percentile(&[3.0, 1.0, 2.0], p)), [2.0, 3.0, 3.0]);
        assert_eq!(median(&[5.0]), 5.0);
        assert!(median(&[]).is_nan());
    }
}
