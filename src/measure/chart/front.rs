//! Medians, and the Pareto front of time and error.

/// Lower quartile, median and upper quartile, interpolated between neighbours; NaN of nothing.
pub fn quartiles(values: impl Iterator<Item = f64>) -> [f64; 3] {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    [0.25, 0.5, 0.75].map(|share| {
        let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
        let place = share * last as f64;
        let (low, part) = (place.floor() as usize, place.fract());
        sorted[low] + part * (sorted[(low + 1).min(last)] - sorted[low])
    })
}

/// The Pareto front of points (time, error), by index, from the fastest on: each is more accurate than all that are as fast
/// or faster. Points that are not finite are on no front.
pub fn front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> =
        (0..points.len()).filter(|i| points[*i].iter().all(|v| v.is_finite())).collect();
    order.sort_by(|a, b| {
        points[*a][0].total_cmp(&points[*b][0]).then(points[*a][1].total_cmp(&points[*b][1]))
    });
    let mut least = f64::INFINITY;
    order.retain(|i| {
        let better = points[*i][1] < least;
        least = least.min(points[*i][1]);
        better
    });
    order
}

/// Which points (quartiles of time, error) beat one of them beyond the noise of its times: no larger an error, and three quarters of their runs
/// faster than three quarters of its own.
pub fn beaten(points: &[([f64; 3], f64)], of: usize) -> Vec<usize> {
    let ([low, ..], error) = points[of];
    (0..points.len()).filter(|i| points[*i].0[2] < low && points[*i].1 <= error).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_by_hand() {
        assert_eq!(quartiles([3.0, 1.0, 2.0, 5.0, 4.0].into_iter()), [2.0, 3.0, 4.0]);
        assert_eq!(quartiles([1.0, 2.0].into_iter()), [1.25, 1.5, 1.75]);
        assert_eq!(quartiles([7.0].into_iter()), [7.0; 3]);
        assert!(quartiles(std::iter::empty()).iter().all(|q| q.is_nan()));
    }

    #[test]
    fn no_point_of_the_front_is_beaten_and_every_other_is() {
        let points =
            [[3.0, 0.1], [1.0, 0.5], [2.0, 0.6], [2.0, 0.2], [4.0, 0.1], [f64::NAN, 0.0], [1.0, 0.7]];
        let found = front(&points);
        assert_eq!(found, [1, 3, 0]);
        let beats = |a: [f64; 2], b: [f64; 2]| a[0] <= b[0] && a[1] <= b[1] && a != b;
        for (i, p) in points.iter().enumerate().filter(|(_, p)| p[0].is_finite()) {
            let beaten = found.iter().any(|f| beats(points[*f], *p));
            assert_eq!(beaten, !found.contains(&i), "{i}");
        }
    }

    #[test]
    fn what_is_within_the_noise_beats_nothing() {
        let point = |time: f64, error: f64| ([0.9 * time, time, 1.1 * time], error);
        let points = [point(1.0, 0.3), point(0.9, 0.3), point(0.8, 0.3), point(0.7, 0.4), point(0.7, 0.2)];
        // 0.99 and 0.88 against 0.9; the one that is more in error beats nothing at any speed.
        assert_eq!(beaten(&points, 0), [2, 4]);
        assert_eq!(beaten(&points, 4), [0; 0]);
    }
}
