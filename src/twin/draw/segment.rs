//! A segment of a ray between two samples, through which the value is linear: with a transfer function of linear pieces its opacity and
//! colour have a closed form.
//!
//! Along a piece where opacity goes from a to b the optical depth of a reference length is the mean of −ln(1 − x) over [a, b],
//! (u ln u − v ln v)/(v − u) + 1 with u = 1 − a and v = 1 − b. Light of an even stretch of depth τ leaves, on average, at
//! 1/τ − e^−τ/(1 − e^−τ) of its length; where opacity rises or falls, later or earlier by (b − a)/6(a + b) of it if little is stopped.

use cao_kernels::raycast as kernel;
use cao_model::transfer::TransferFunction;
use glam::{DVec3, Vec3};

/// What a segment adds in front of black.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// The share of light that it stops.
    pub alpha: f64,
    /// That share of its colours, unlit and linear.
    pub colour: DVec3,
    /// Share of its length at which its light leaves, on average.
    pub centre: f64,
}

/// From one value to another, `length` reference lengths apart.
pub fn segment(transfer: &TransferFunction, from: f32, to: f32, length: f64) -> Segment {
    let (low, high) = (from.min(to), from.max(to));
    let whole = f64::from(to) - f64::from(from);
    // Shares of the segment at which it passes a control point, each with the opacities on its two sides, in order.
    let mut ends = vec![(0.0, transfer.opacity_at(from), from)];
    let mut passed: Vec<usize> = (0..transfer.opacity.len())
        .filter(|&i| low < transfer.opacity[i][0] && transfer.opacity[i][0] <= high)
        .collect();
    if whole < 0.0 {
        passed.reverse();
    }
    for i in passed {
        let [value, opacity] = transfer.opacity[i];
        ends.push(((f64::from(value) - f64::from(from)) / whole, opacity, value));
    }
    ends.push((1.0, transfer.opacity_at(to), to));
    let (mut open, mut colour, mut centre) = (1.0, DVec3::ZERO, 0.0);
    for pair in ends.windows(2) {
        let [(begun, a, near), (done, b, far)] = [pair[0], pair[1]];
        if done <= begun || a.max(b) <= 0.0 {
            continue;
        }
        let depth = length * (done - begun) * mean_depth(f64::from(a), f64::from(b));
        let passes = (-depth).exp();
        let share = open * (1.0 - passes);
        let even = match depth {
            _ if depth < 1e-4 => 0.5,
            f64::INFINITY => 0.0,
            _ => 1.0 / depth - passes / (1.0 - passes),
        };
        let within = even + passes * f64::from(b - a) / (6.0 * f64::from(a + b));
        let tint = transfer.colour_at(near + within as f32 * (far - near));
        colour += share * Vec3::from_array(tint).as_dvec3();
        centre += share * (begun + within * (done - begun));
        open *= passes;
    }
    let alpha = 1.0 - open;
    Segment { alpha, colour, centre: if alpha > 0.0 { centre / alpha } else { 0.5 } }
}

/// Mean of −ln(1 − x) over [a, b].
fn mean_depth(a: f64, b: f64) -> f64 {
    let (u, v) = (1.0 - a, 1.0 - b);
    let weighed = |x: f64| if x > 0.0 { x * x.ln() } else { 0.0 };
    // Where it has lost half of its digits, the middle has as many.
    if (v - u).abs() <= 1e-6 * u.max(v) {
        return -(0.5 * (u + v)).ln();
    }
    1.0 + (weighed(u) - weighed(v)) / (v - u)
}

/// Whether a step has to be halved, through which `open` of the light comes to the eye: its opacity is not that of its ends, because a surface is in it, and matters.
pub fn varies(
    transfer: &TransferFunction,
    found: &Segment,
    [from, to]: [f32; 2],
    length: f64,
    open: f64,
) -> bool {
    let most = f64::from(kernel::MOST_CHANGE);
    let like = |value: f32| 1.0 - (1.0 - f64::from(transfer.opacity_at(value))).powf(length);
    open * found.alpha > most && [from, to].iter().any(|&end| open * (like(end) - found.alpha).abs() > most)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn transfer(opacity: Vec<[f32; 2]>) -> TransferFunction {
        let colour = vec![[0.0, 0.1, 0.5, 0.9], [1.0, 0.9, 0.4, 0.2]];
        TransferFunction::new(opacity, colour, None).unwrap()
    }

    /// The same by many thin slices.
    fn sliced(transfer: &TransferFunction, from: f32, to: f32, length: f64) -> Segment {
        const SLICES: u32 = 200_000;
        let (mut open, mut colour, mut centre) = (1.0, DVec3::ZERO, 0.0);
        for i in 0..SLICES {
            let at = (f64::from(i) + 0.5) / f64::from(SLICES);
            let value = f64::from(from) + at * (f64::from(to) - f64::from(from));
            let passes =
                (1.0 - f64::from(transfer.opacity_at(value as f32))).powf(length / f64::from(SLICES));
            let share = open * (1.0 - passes);
            colour += share * Vec3::from_array(transfer.colour_at(value as f32)).as_dvec3();
            centre += share * at;
            open *= passes;
        }
        Segment { alpha: 1.0 - open, colour, centre: centre / (1.0 - open).max(1e-300) }
    }

    #[test]
    fn the_closed_form_is_the_limit_of_thin_slices() {
        let functions = [
            vec![[0.2, 0.0], [0.6, 0.8]],
            vec![[0.2, 0.0], [0.5, 0.0], [0.5, 0.7], [0.6, 0.7], [0.6, 0.0]],
            vec![[0.1, 0.02], [0.3, 1.0], [0.4, 1.0], [0.7, 0.1], [0.9, 0.3]],
            vec![[0.45, 0.0], [0.5, 0.9], [0.55, 0.0]],
        ];
        let (mut worst_colour, mut worst_centre) = (0.0_f64, 0.0_f64);
        for (n, points) in functions.into_iter().enumerate() {
            let transfer = transfer(points);
            for (from, to) in
                [(0.0, 1.0), (1.0, 0.0), (0.3, 0.55), (0.65, 0.52), (0.25, 0.26), (0.5, 0.5), (0.0, 0.1)]
            {
                for length in [0.02, 0.5, 3.0] {
                    let found = segment(&transfer, from, to, length);
                    let expected = sliced(&transfer, from, to, length);
                    let context = format!("{n}: {from} to {to}, {length}: {found:?} {expected:?}");
                    // A slice is either on one side of a step or on the other.
                    assert!((found.alpha - expected.alpha).abs() < 1e-4, "{context}");
                    worst_colour = worst_colour.max((found.colour - expected.colour).abs().max_element());
                    if found.alpha > 1e-3 {
                        worst_centre = worst_centre.max((found.centre - expected.centre).abs());
                    }
                }
            }
        }
        // A piece is lit and coloured at one place. The longest here are half a transfer function.
        assert!(worst_colour < 0.05 && worst_centre < 0.15, "{worst_colour} {worst_centre}");
    }

    #[test]
    fn a_peak_between_two_transparent_samples_shows() {
        let transfer = transfer(vec![[0.45, 0.0], [0.5, 0.9], [0.55, 0.0]]);
        let found = segment(&transfer, 0.0, 1.0, 1.0);
        assert!(found.alpha > 0.05 && (found.centre - 0.5).abs() < 0.01, "{found:?}");
        assert!(!varies(&transfer, &found, [0.0, 1.0], 1.0, 1.0), "{found:?}");
        let thick = segment(&transfer, 0.0, 1.0, 3.0);
        assert!(varies(&transfer, &thick, [0.0, 1.0], 3.0, 1.0), "{thick:?}");
        assert!(!varies(&transfer, &thick, [0.0, 1.0], 3.0, 0.1), "behind what stops nearly all");
    }

    #[test]
    fn what_is_opaque_stops_everything_where_it_begins() {
        let transfer = transfer(vec![[0.5, 0.0], [0.5, 1.0]]);
        let colour = Vec3::from_array(transfer.colour_at(0.5)).as_dvec3();
        assert_eq!(segment(&transfer, 0.25, 0.75, 1e-3), Segment { alpha: 1.0, colour, centre: 0.5 });
        assert_eq!(segment(&transfer, 0.75, 0.25, 1e-3).centre, 0.0);
        assert_eq!(segment(&transfer, 0.0, 0.4, 1e3).alpha, 0.0);
    }
}
