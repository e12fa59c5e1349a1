//! Prominent values of a volume: the peaks of its histogram by persistence (DVAO §3.1 centres trapezoids on peaks).
//!
//! In: values and their range. Out: places of the peaks, 0 … 1 of the range, the most persistent first. A peak's persistence is how far one
//! must go down from it to reach a higher one; of the logarithm of counts, so that small structures count beside air. Cost: a pass over the
//! values.

/// Bins, as the paper's program has them.
pub const BINS: usize = 1000;

/// Half the width of the mean that smooths the histogram, in bins: values of 8 bits are four bins apart.
const SMOOTH: usize = 5;

/// A factor of at least e^0.2 between a peak and the pass to a higher one.
const LEAST: f64 = 0.2;

/// The peaks of these values; `range` is their smallest and largest.
pub fn peaks(values: &[f32], [low, high]: [f32; 2]) -> Vec<f64> {
    let mut bins = vec![0.0_f64; BINS];
    let per_value = BINS as f32 / (high - low).max(f32::MIN_POSITIVE);
    for value in values.iter().filter(|value| value.is_finite()) {
        bins[(((value - low) * per_value) as usize).min(BINS - 1)] += 1.0;
    }
    let smooth: Vec<f64> = smoothed(&smoothed(&bins)).into_iter().map(f64::ln_1p).collect();
    let centre = |bin: usize| (bin as f64 + 0.5) / BINS as f64;
    let found = persistent(&smooth).into_iter().filter(|(_, persistence)| *persistence >= LEAST);
    found.map(|(bin, _)| centre(bin)).collect()
}

/// Mean of the bins around each; fewer at the ends.
fn smoothed(bins: &[f64]) -> Vec<f64> {
    let mean = |i: usize| {
        let around = &bins[i.saturating_sub(SMOOTH)..(i + SMOOTH + 1).min(bins.len())];
        around.iter().sum::<f64>() / around.len() as f64
    };
    (0..bins.len()).map(mean).collect()
}

/// Maxima and their persistence, the largest first: bins come down from the highest, and where two hills meet the lower one ends.
fn persistent(heights: &[f64]) -> Vec<(usize, f64)> {
    let mut order: Vec<usize> = (0..heights.len()).collect();
    order.sort_by(|a, b| heights[*b].total_cmp(&heights[*a]));
    // The summit of the hill that a bin belongs to, at the ends of each hill.
    let mut summit: Vec<Option<usize>> = vec![None; heights.len()];
    let mut ended: Vec<(usize, f64)> = Vec::new();
    let mut hills: Vec<usize> = (0..heights.len()).collect();
    fn top(hills: &[usize], mut bin: usize) -> usize {
        while hills[bin] != bin {
            bin = hills[bin];
        }
        bin
    }
    for bin in order {
        let beside = |at: Option<usize>| at.and_then(|at| *summit.get(at)?).map(|at| top(&hills, at));
        let (left, right) = (beside(bin.checked_sub(1)), beside(Some(bin + 1)));
        summit[bin] = Some(match (left, right) {
            (None, None) => bin,
            (Some(one), None) | (None, Some(one)) => one,
            (Some(one), Some(other)) => {
                let (high, low) = if heights[one] >= heights[other] { (one, other) } else { (other, one) };
                if low != high {
                    ended.push((low, heights[low] - heights[bin]));
                    hills[low] = high;
                }
                high
            }
        });
    }
    if let Some(highest) = summit.first().copied().flatten().map(|at| top(&hills, at)) {
        ended.push((highest, heights[highest]));
    }
    ended.sort_by(|a, b| b.1.total_cmp(&a.1));
    ended
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hills_end_where_they_meet_a_higher_one() {
        //           0    1    2    3    4    5    6
        let found = persistent(&[1.0, 5.0, 2.0, 4.0, 0.5, 3.0, 3.0]);
        assert_eq!(found, [(1, 5.0), (5, 2.5), (3, 2.0)].map(|(at, p)| (at, p)));
        assert_eq!(persistent(&[]), []);
    }

    #[test]
    fn two_values_are_two_peaks_and_those_between_none() {
        let mut values = vec![20.0; 5000];
        values.extend(vec![80.0; 300]);
        values.extend((0..100).map(|v| v as f32));
        let found = peaks(&values, [0.0, 100.0]);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0] - 0.2).abs() < 0.01 && (found[1] - 0.8).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn neighbouring_values_of_8_bits_are_one_peak() {
        // A bell of 8-bit values leaves three of four bins empty.
        let values: Vec<f32> = (0..=255)
            .flat_map(|v| {
                vec![v as f32; (2000.0 * f64::exp(-(f64::from(v) - 120.0).powi(2) / 800.0)) as usize]
            })
            .collect();
        assert_eq!(peaks(&values, [0.0, 255.0]).len(), 1);
    }
}
