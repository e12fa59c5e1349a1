//! The SIMD code that the sweep's kernels are compared with computes what it should: every window, evaluated directly.

use cao_measure::random::Random;
use cao_model::occlusion::RaySet;
use cao_simd::{Line, Rule, Vectors, lines, sweep};

/// Rounding of f32 through a window, with λ from logarithms and exponentials of a few units in the last place; the largest
/// seen is 2e-7.
const ROUNDING: f64 = 1e-6;

/// Mean over W segments from a voxel along v and along −v, each weighted, in f64 from the equations.
fn direct(dims: [usize; 3], q: &[f32], lines: &[Line], rule: Rule) -> Vec<f64> {
    let at = |p: [i64; 3]| {
        let inside = (0..3).all(|a| (0..dims[a] as i64).contains(&p[a]));
        if inside {
            f64::from(q[(p[2] as usize * dims[1] + p[1] as usize) * dims[0] + p[0] as usize])
        } else {
            1.0
        }
    };
    let pair = |q0: f64, q1: f64, length: f64| {
        if rule == Rule::Left {
            return (q1.powf(length), 1.0);
        }
        if q0.max(q1) < 1e-6 {
            return (0.0, 0.0);
        }
        let entropy = |q: f64| if q > 0.0 { q * q.ln() } else { 0.0 };
        let (mean, half) = (0.5 * (q0 + q1), 0.5 * (q1 - q0));
        let lambda = if half.abs() < 1e-3 * mean {
            (half / mean).powi(2) / 6.0 - mean.ln()
        } else {
            1.0 - (entropy(q1) - entropy(q0)) / (q1 - q0)
        };
        let x = length * lambda;
        ((-x).exp(), if x > 0.0 { -(-x).exp_m1() / x } else { 1.0 })
    };
    (0..q.len())
        .map(|i| {
            let x = [i % dims[0], i / dims[0] % dims[1], i / (dims[0] * dims[1])].map(|c| c as i64);
            let mut ambient = 0.0;
            for line in lines {
                for sign in [1, -1] {
                    let place =
                        |m: usize| at(std::array::from_fn(|a| x[a] + m as i64 * sign * i64::from(line.v[a])));
                    let (mut t, mut s) = (1.0, 0.0);
                    for m in 0..line.window {
                        let (pt, ps) = pair(place(m), place(m + 1), line.length.into());
                        s += t * ps;
                        t *= pt;
                    }
                    ambient += f64::from(line.weight) * s / line.window as f64;
                }
            }
            ambient
        })
        .collect()
}

/// Clear, opaque, nearly equal and random neighbours.
fn clearness(random: &mut Random, count: usize) -> Vec<f32> {
    (0..count)
        .map(|_| match random.below(6) {
            0 | 1 => 1.0,
            2 => 0.0,
            3 => random.between(0.6, 0.601),
            _ => random.between(0.0, 1.0),
        })
        .collect()
}

fn length(v: [i32; 3]) -> f32 {
    let spacing = [1.0, 0.8, 1.7];
    (0..3).map(|a| (v[a] as f32 * spacing[a]).powi(2)).sum::<f32>().sqrt()
}

#[test]
fn every_window_has_the_value_of_its_direct_evaluation() {
    let mut random = Random::new(4);
    let rays = RaySet::W26.directions();
    for dims in [[1, 1, 1], [5, 1, 1], [1, 6, 3], [19, 7, 5], [16, 16, 16], [33, 20, 37], [3, 40, 18]] {
        let q = clearness(&mut random, dims.iter().product());
        for rule in [Rule::Left, Rule::Segment] {
            for window in [1, 2, 7, 16, 50] {
                // Windows that differ from direction to direction, as a radius in mm asks for.
                let lines = lines(&rays, length, |v| 1 + window / v.iter().filter(|c| **c != 0).count());
                let expected = direct(dims, &q, &lines, rule);
                let ways = Vectors::available().into_iter().map(|vectors| (vectors, 1));
                for (vectors, threads) in ways.chain([(Vectors::Target, 3)]) {
                    let found = sweep(dims, &q, &lines, rule, vectors, threads);
                    for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
                        let error = (f64::from(*found) - expected).abs();
                        assert!(
                            error < ROUNDING,
                            "{rule:?} {vectors:?} W={window} {dims:?} voxel {i}, {threads} threads: {found}, expected {expected}"
                        );
                    }
                }
            }
        }
    }
    // The comparison sees more than the rounding: one segment more in a window is told apart.
    let (dims, q) = ([9, 9, 9], clearness(&mut random, 729));
    let short = sweep(dims, &q, &lines(&rays, length, |_| 4), Rule::Segment, Vectors::Target, 1);
    let long = direct(dims, &q, &lines(&rays, length, |_| 5), Rule::Segment);
    assert!(short.iter().zip(&long).any(|(a, b)| (f64::from(*a) - b).abs() > 100.0 * ROUNDING));
}

/// One direction at a time, so that no error hides behind the other weights: a lone opaque voxel darkens its line only.
#[test]
fn a_lone_voxel_darkens_its_line_only() {
    let dims = [17, 18, 19];
    let mut q = vec![1.0; dims.iter().product()];
    let centre = [8_i32, 9, 10];
    let index = |p: [i32; 3]| ((p[2] * 18 + p[1]) * 17 + p[0]) as usize;
    q[index(centre)] = 0.0;
    for v in RaySet::R26.directions().iter().map(|ray| ray.0) {
        let pair = [v, v.map(|c| -c)].map(|v| (v, 0.5));
        let found = sweep(dims, &q, &lines(&pair, |_| 1.0, |_| 4), Rule::Left, Vectors::Target, 2);
        let dark: Vec<usize> = (0..q.len()).filter(|i| found[*i] < 1.0).collect();
        let mut expected: Vec<usize> = (-3..=3)
            .filter(|m| *m != 0)
            .map(|m| index(std::array::from_fn(|a| centre[a] + m * v[a])))
            .collect();
        expected.sort_unstable();
        assert_eq!(dark, expected, "{v:?}");
        // One of two rays keeps its first term of four.
        let beside = found[index(std::array::from_fn(|a| centre[a] + v[a]))];
        assert!((beside - (0.5 + 0.5 * 0.25)).abs() < 1e-6, "{v:?}: {beside}");
    }
}
