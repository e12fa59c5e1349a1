//! k-means of histograms in whole numbers (docs/histograms.md), from its definition.
//!
//! The first centres are one sample of each of equal parts of all, at `mixed(cluster)` in it. A round gives every sample the nearest centre,
//! of equally near ones the first, by the sum of squared differences; then each centre becomes the mean of its samples, rounded down, or,
//! without any, the sample at `mixed(cluster + clusters · (round + 1))`.

use crate::each;

/// A number of 32 bits that looks like chance (PCG, Jarzynski and Olano 2020).
pub fn mixed(seed: u32) -> u32 {
    let state = seed.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// The nearest centre.
pub fn nearest(histogram: &[u32], centres: &[Vec<u32>]) -> usize {
    let distance = |centre: &Vec<u32>| -> u64 {
        histogram.iter().zip(centre).map(|(a, b)| u64::from(a.abs_diff(*b)).pow(2)).sum()
    };
    (0..centres.len()).min_by_key(|&c| distance(&centres[c])).unwrap_or(0)
}

/// Centres of so many clusters after so many rounds.
pub fn clusters(samples: &[Vec<u32>], count: u32, rounds: u32) -> Vec<Vec<u32>> {
    let part = samples.len() / count as usize;
    let at = |seed: u32, of: usize| mixed(seed) as usize % of;
    let mut centres: Vec<Vec<u32>> =
        (0..count).map(|c| samples[c as usize * part + at(c, part)].clone()).collect();
    for round in 0..rounds {
        let labels = each(samples.len(), |i| nearest(&samples[i], &centres));
        for c in 0..count {
            let own: Vec<&Vec<u32>> =
                samples.iter().zip(&labels).filter(|(_, l)| **l == c as usize).map(|(s, _)| s).collect();
            centres[c as usize] = match own.len() as u64 {
                0 => samples[at(c + count * (round + 1), samples.len())].clone(),
                n => {
                    let sum = |j: usize| own.iter().map(|s| u64::from(s[j])).sum::<u64>();
                    (0..samples[0].len()).map(|j| (sum(j) / n) as u32).collect()
                }
            };
        }
    }
    centres
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two heaps are two clusters, and their means the centres.
    #[test]
    fn heaps_are_found() {
        let sample = |i: u32| if i < 40 { vec![100 + i % 3, 0] } else { vec![0, 300 + 2 * (i % 2)] };
        let samples: Vec<_> = (0..80).map(sample).collect();
        let centres = clusters(&samples, 2, 12);
        assert_eq!(centres, [vec![100, 0], vec![0, 301]]);
        assert_eq!((nearest(&[90, 5], &centres), nearest(&[0, 400], &centres)), (0, 1));
        // Equally near ones: the first.
        assert_eq!(nearest(&[1, 0], &[vec![0, 0], vec![2, 0]]), 0);
    }
}
