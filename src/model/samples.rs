//! Where the samples of a pixel lie: the same places in every pixel, view and frame, so that nothing flickers and both eyes see the
//! same.
//!
//! The box filter takes a lattice of N points, `(a, a g mod 2N) / 2N` for `a` = 1 − N, 3 − N, …, N − 1: along each axis one point in every
//! Nth of the pixel, so that an upright or level edge covers its share to 1/2N. Of the numbers without a common factor with N, `g` is the
//! one that keeps the nearest two points farthest apart. The Gaussian one, σ = ½ pixel, cut off at 3σ, takes the places on each axis that leave as much weight below them.
//! With a point its mirror image is one too, so that the mean is the pixel's centre exactly. The first is the nearest to it.

use crate::{Error, Result};
use glam::Vec2;

/// Most samples of a pixel: 16 along each axis.
pub const MOST_SAMPLES: u32 = 256;

/// How samples weigh: all alike, and their places are distributed as the filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The pixel, evenly.
    #[default]
    Box,
    /// A bell, σ = ½ pixel, cut off at 1½: smoother edges, and softer.
    Gaussian,
}

impl Filter {
    /// All filters.
    pub const ALL: [Self; 2] = [Self::Box, Self::Gaussian];

    /// What users call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Gaussian => "gaussian",
        }
    }

    /// The filter of this name.
    ///
    /// # Errors
    /// [`Error::Config`] with the names there are.
    pub fn parse(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|filter| filter.name() == name).ok_or_else(|| {
            Error::refused("filter", format!("{}: expected box or gaussian", crate::error::quoted(name)))
        })
    }
}

/// Places of a pixel's samples, in pixels from its centre.
pub fn offsets(samples: u32, filter: Filter) -> Vec<Vec2> {
    let n = i64::from(samples.clamp(1, MOST_SAMPLES));
    let (g, quantiles) = (generator(n), (filter == Filter::Gaussian).then(Quantiles::new));
    let place = |a: i64| {
        let share = a as f64 / (2 * n) as f64;
        quantiles.as_ref().map_or(share, |quantiles| quantiles.of(share)) as f32
    };
    let mut places: Vec<Vec2> =
        (0..n).map(|i| 2 * i + 1 - n).map(|a| Vec2::new(place(a), place(wrapped(a * g, n)))).collect();
    places.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    places
}

/// The number that differs from `a` by a multiple of 2n and lies nearest to 0.
fn wrapped(a: i64, n: i64) -> i64 {
    (a + n).rem_euclid(2 * n) - n
}

fn generator(n: i64) -> i64 {
    let common = |mut a: i64, mut b: i64| {
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let nearest =
        |g: i64| (1..n).map(|i| [2 * i, 2 * i * g].map(|a| wrapped(a, n).pow(2)).iter().sum::<i64>()).min();
    let all = (1..n.max(2)).filter(|g| common(*g, n) == 1);
    // Of several the least.
    all.rev().max_by_key(|g| nearest(*g)).unwrap_or(1)
}

/// Where a share of a bell's weight lies between its middle and a place.
struct Quantiles {
    /// Weight between the middle and each place, [`Quantiles::STEP`] apart.
    weight: Vec<f64>,
}

impl Quantiles {
    const SIGMA: f64 = 0.5;
    /// Pixels; a thousandth of σ is far below what a pixel shows.
    const STEP: f64 = Self::SIGMA / 1000.0;
    const COUNT: usize = 3000;

    fn new() -> Self {
        let bell = |i: usize| (-0.5 * ((i as f64 + 0.5) * Self::STEP / Self::SIGMA).powi(2)).exp();
        let mut sum = 0.0;
        let sums = (0..Self::COUNT).map(|i| {
            sum += bell(i);
            sum
        });
        Self { weight: sums.collect() }
    }

    /// The place with a share −½ … ½ of all weight between it and the middle.
    fn of(&self, share: f64) -> f64 {
        let wanted = 2.0 * share.abs() * self.weight[Self::COUNT - 1];
        let i = self.weight.partition_point(|weight| *weight < wanted);
        let (below, above) = (if i == 0 { 0.0 } else { self.weight[i - 1] }, self.weight[i]);
        Self::STEP * (i as f64 + (wanted - below) / (above - below)) * if share < 0.0 { -1.0 } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sample_is_the_centre() {
        for filter in Filter::ALL {
            assert_eq!(offsets(1, filter), [Vec2::ZERO]);
        }
    }

    #[test]
    fn samples_mirror_each_other_about_the_centre() {
        for filter in Filter::ALL {
            for n in 1..=MOST_SAMPLES {
                let places = offsets(n, filter);
                assert_eq!(places.len(), n as usize);
                assert!(places.iter().all(|p| places.contains(&-*p)), "{filter:?} {n}");
                // Sums of f32 that cancel in pairs leave rounding only.
                let mean = places.iter().map(|p| p.as_dvec2()).sum::<glam::DVec2>();
                assert!(mean.length() < 1e-12, "{filter:?} {n}: {mean}");
                assert!(places.windows(2).all(|p| p[0].length_squared() <= p[1].length_squared()));
            }
        }
    }

    /// Along each axis, and along a slant, a share of the pixel has its share of the samples.
    #[test]
    fn a_box_is_even() {
        for n in 1..=MOST_SAMPLES {
            let places = offsets(n, Filter::Box);
            assert!(places.iter().all(|p| p.abs().max_element() < 0.5));
            for axis in 0..2 {
                let mut along: Vec<f32> = places.iter().map(|p| p[axis] + 0.5).collect();
                along.sort_by(f32::total_cmp);
                for (i, at) in along.iter().enumerate() {
                    assert!((at - (i as f32 + 0.5) / n as f32).abs() < 1e-6, "{n}: {along:?}");
                }
            }
        }
        // An edge through a corner at 45° leaves half of the pixel on each side; a diagonal of points would be on neither.
        let below =
            |n| offsets(n, Filter::Box).iter().filter(|p| p.x + p.y < -0.25).count() as f32 / n as f32;
        for n in [16, 64, 256] {
            // Area of the corner that x + y < −¼ cuts off: (¾)²/2.
            assert!((below(n) - 0.281_25).abs() < 1.0 / (n as f32).sqrt() / 2.0, "{n}: {}", below(n));
        }
    }

    /// Variance of a bell of σ = ½ cut off at 3σ: 0.9733 σ² on each axis.
    #[test]
    fn a_gaussian_has_its_width() {
        let places = offsets(256, Filter::Gaussian);
        assert!(places.iter().all(|p| p.abs().max_element() <= 1.5));
        for axis in 0..2 {
            let variance = places.iter().map(|p| p[axis] * p[axis]).sum::<f32>() / 256.0;
            assert!((variance - 0.9733 * 0.25).abs() < 0.005, "{variance}");
            let within = places.iter().filter(|p| p[axis].abs() < 0.5).count() as f32 / 256.0;
            // 68.27 % of 99.73 %.
            assert!((within - 0.6846).abs() < 0.01, "{within}");
        }
    }

    #[test]
    fn filters_have_names() {
        for filter in Filter::ALL {
            assert_eq!(Filter::parse(filter.name()), Ok(filter));
        }
        let error = Filter::parse("tent").unwrap_err().to_string();
        assert!(error.contains("tent") && error.contains("box or gaussian"), "{error}");
    }
}
