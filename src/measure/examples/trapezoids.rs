//! Random transfer functions (DVAO §3.1): 1 to 5 trapezoids, each around a peak of the histogram.
//!
//! ```text
//! top    ~ U(0.1, 0.9)      bottom ~ U(0.1, top)              opacity
//! outer  ~ U(0.01, 0.1)     inner  ~ U(0.01, outer)           shares of the range of values
//!
//!         top      ___
//!                 /   \           inner: the width of the top
//!         bottom /     \          outer: the width of the bottom
//!               |       |
//!         0 ____|       |____     walls: 0.01 wide
//! ```
//!
//! No two overlap, and none touches the smallest or largest value, so that air is clear.

use crate::random::Random;

/// Width of the walls on either side, as the paper's program has them.
const WALL: f64 = 0.01;
/// Least and most of heights and widths (DVAO §3.1).
const HEIGHTS: [f32; 2] = [0.1, 0.9];
const WIDTHS: [f32; 2] = [0.01, 0.1];
/// Most trapezoids.
const MOST: u64 = 5;
/// Tries to find widths that fit at a peak.
const TRIES: usize = 8;

/// One hill of opacity over values, which run from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trapezoid {
    /// Its middle.
    pub centre: f64,
    /// Width of the bottom, without the walls.
    pub outer: f64,
    /// Width of the top.
    pub inner: f64,
    /// Opacity at both ends of the bottom.
    pub bottom: f64,
    /// Opacity of the top.
    pub top: f64,
}

impl Trapezoid {
    fn random(random: &mut Random, centre: f64) -> Self {
        let top = random.between(HEIGHTS[0], HEIGHTS[1]);
        let bottom = random.between(HEIGHTS[0], top);
        let outer = random.between(WIDTHS[0], WIDTHS[1]);
        let inner = random.between(WIDTHS[0], outer);
        Self { centre, outer: outer.into(), inner: inner.into(), bottom: bottom.into(), top: top.into() }
    }

    /// Half its width, walls included.
    fn half(&self) -> f64 {
        0.5 * self.outer + WALL
    }

    fn within(&self) -> bool {
        self.centre - self.half() > 0.0 && self.centre + self.half() < 1.0
    }

    fn clear_of(&self, other: &Self) -> bool {
        (self.centre - other.centre).abs() > self.half() + other.half()
    }

    /// Its corners: value and opacity.
    pub fn points(&self) -> [[f64; 2]; 6] {
        let (wall, outer, inner) = (self.half(), 0.5 * self.outer, 0.5 * self.inner);
        let at = |offset: f64, opacity: f64| [self.centre + offset, opacity];
        [
            at(-wall, 0.0),
            at(-outer, self.bottom),
            at(-inner, self.top),
            at(inner, self.top),
            at(outer, self.bottom),
            at(wall, 0.0),
        ]
    }

    /// Opacity of a value.
    pub fn opacity(&self, value: f64) -> f64 {
        let d = (value - self.centre).abs();
        let (wall, outer, inner) = (self.half(), 0.5 * self.outer, 0.5 * self.inner);
        match d {
            _ if d <= inner => self.top,
            _ if d <= outer => self.bottom + (self.top - self.bottom) * (outer - d) / (outer - inner),
            _ if d < wall => self.bottom * (wall - d) / WALL,
            _ => 0.0,
        }
    }
}

/// A random transfer function for values with these peaks, ascending; empty where no trapezoid fits at any.
pub fn transfer(random: &mut Random, peaks: &[f64]) -> Vec<Trapezoid> {
    let wanted = 1 + random.below(MOST) as usize;
    let mut left = peaks.to_vec();
    let mut found: Vec<Trapezoid> = Vec::new();
    while found.len() < wanted && !left.is_empty() {
        let peak = left.swap_remove(random.below(left.len() as u64) as usize);
        let mut tries = (0..TRIES).map(|_| Trapezoid::random(random, peak));
        found.extend(tries.find(|new| new.within() && found.iter().all(|old| new.clear_of(old))));
    }
    found.sort_by(|a, b| a.centre.total_cmp(&b.centre));
    found
}

/// Opacity of a value, 0 to 1.
pub fn opacity(transfer: &[Trapezoid], value: f64) -> f64 {
    transfer.iter().map(|hill| hill.opacity(value)).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trapezoids_keep_their_rules() {
        let mut random = Random::new(5);
        let peaks = [0.01, 0.15, 0.3, 0.33, 0.45, 0.6, 0.75, 0.9, 0.999];
        let mut counts = [0; 6];
        for _ in 0..500 {
            let found = transfer(&mut random, &peaks);
            counts[found.len()] += 1;
            for (i, hill) in found.iter().enumerate() {
                assert!(peaks.contains(&hill.centre));
                assert!(0.1 <= hill.bottom && hill.bottom <= hill.top && hill.top < 0.9, "{hill:?}");
                assert!(
                    0.01 <= hill.inner as f32 && hill.inner <= hill.outer && hill.outer < 0.1 + 1e-6,
                    "{hill:?}"
                );
                let points = hill.points();
                assert!(points[0][0] > 0.0 && points[5][0] < 1.0, "touches an extreme: {hill:?}");
                assert!(points.windows(2).all(|pair| pair[0][0] <= pair[1][0]));
                assert!(found.get(i + 1).is_none_or(|next| points[5][0] < next.points()[0][0]), "{found:?}");
            }
            assert_eq!((opacity(&found, 0.0), opacity(&found, 1.0)), (0.0, 0.0));
        }
        assert!(counts[0] == 0 && counts[1..].iter().all(|n| *n > 0), "{counts:?}");
        assert_eq!(transfer(&mut random, &[]), []);
    }

    #[test]
    fn opacity_goes_through_the_corners() {
        let hill = Trapezoid { centre: 0.5, outer: 0.1, inner: 0.04, bottom: 0.2, top: 0.8 };
        for [value, expected] in hill.points() {
            assert!((hill.opacity(value) - expected).abs() < 1e-9, "{value}");
        }
        for (value, expected) in [(0.5, 0.8), (0.535, 0.5), (0.555, 0.1), (0.57, 0.0)] {
            assert!((hill.opacity(value) - expected).abs() < 1e-9, "{value}");
        }
    }
}
