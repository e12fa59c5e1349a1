//! Local histograms (docs/histograms.md), from the definition, after Ropinski et al., Interactive volume rendering with dynamic ambient
//! occlusion and color bleeding, 2008.
//!
//! ```text
//! bin(x) = round(63 (V(x) − least) / (most − least))                  of all values; 0 where there is one value only
//! LH_j(x) = Σ_{0 < |d| ≤ R, bin(x + d) = j} |d|⁻² / Σ_{0 < |d| ≤ R} |d|⁻²     |d| in smallest spacings, R 12 at most
//! ```
//!
//! in 32767ths, |d|⁻² in 65536ths. What lies outside the volume is in no bin.

use crate::Grid;
use cao_kernels::histogram::{BINS, WHOLE_SHARE};

/// The bin of each voxel.
pub fn bins(values: &[f32]) -> Vec<usize> {
    let (least, most) =
        values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, m), v| (l.min(*v), m.max(*v)));
    let width = f64::from(most) - f64::from(least);
    let last = f64::from(BINS - 1);
    let of = |v: &f32| (last * (f64::from(*v) - f64::from(least)) / width).round() as usize;
    values.iter().map(|v| if width > 0.0 { of(v) } else { 0 }).collect()
}

/// The histogram around a voxel, of these bins.
pub fn histogram(grid: &Grid, bins: &[usize], radius_mm: f32, voxel: [usize; 3]) -> Vec<u32> {
    let (ratios, smallest) = (grid.ratios(), f64::from(grid.min_spacing() as f32));
    let radius = (f64::from(radius_mm) / smallest).min(12.0);
    let edge = (radius * (1.0 + 1e-5)).floor() as i64;
    let (mut shares, mut sum) = (vec![0_u32; BINS as usize], 0_u32);
    for z in -edge..=edge {
        for y in -edge..=edge {
            for x in -edge..=edge {
                let d = [x, y, z];
                let squared: f64 = (0..3).map(|i| (d[i] as f64 * ratios[i]).powi(2)).sum();
                if squared == 0.0 || squared > radius * radius * (1.0 + 1e-5) {
                    continue;
                }
                let weight = (65536.0 / squared).round() as u32;
                sum += weight;
                let place: [i64; 3] = std::array::from_fn(|i| voxel[i] as i64 + d[i]);
                if (0..3).all(|i| place[i] >= 0 && place[i] < grid.dims[i] as i64) {
                    shares[bins[grid.index(place.map(|c| c as usize))]] += weight;
                }
            }
        }
    }
    let of = |share: u32| f64::from(share) * f64::from(WHOLE_SHARE) / f64::from(sum);
    shares.into_iter().map(|share| if sum > 0 { of(share).round() as u32 } else { 0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uniform_values_are_one_bin_and_a_half_space_two() {
        let grid = Grid { dims: [25; 3], spacing: [1.0; 3] };
        let even = histogram(&grid, &bins(&vec![7.0; grid.len()]), 20.0, [12; 3]);
        assert_eq!((even[0], even.iter().sum::<u32>()), (WHOLE_SHARE, WHOLE_SHARE));
        let half: Vec<f32> = (0..grid.len()).map(|i| f32::from(u8::from(grid.voxel(i)[2] <= 12))).collect();
        let found = histogram(&grid, &bins(&half), 12.0, [12; 3]);
        let share = |j: usize| f64::from(found[j]) / f64::from(WHOLE_SHARE);
        // The first solid layer: 0.4359 stays free.
        assert!((share(0) - 0.4359).abs() < 1e-4, "{}", share(0));
        assert!((share(0) + share(63) - 1.0).abs() < 1e-4);
        // At a corner most of the ball is outside.
        let corner = histogram(&grid, &bins(&vec![7.0; grid.len()]), 12.0, [0; 3]);
        assert!((1..WHOLE_SHARE / 4).contains(&corner[0]), "{}", corner[0]);
        assert_eq!(histogram(&grid, &bins(&half), 0.9, [12; 3]), vec![0; 64]);
    }
}
