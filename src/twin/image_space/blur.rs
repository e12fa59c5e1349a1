//! Filters of accessibility in the image.
//!
//! `square`: the mean of 4 × 4 pixels, columns and rows −2 … 1 from the pixel, those in the image; what shows nothing counts as 1 (Mittring 2007: each of
//! Crytek's 16 mirrors once).
//!
//! `bilateral`: along the row, then along the column, over k = −K … K pixels that show something,
//!
//! ```text
//! w_k = exp(−2 k²/K²) · exp(−(n·Δp_k)² / 2(R/10)²) · max(0, n·n_k)^8
//! ```
//!
//! with Δp_k to the other's position: the distance to the pixel's tangent plane, not of depths, so that slopes are one surface.

use super::shown::Shown;
use crate::each;
use cao_model::image_space::Hbao;

/// Of a pixel that shows nothing.
const OPEN: f64 = 1.0;

/// The mean of 4 × 4 pixels.
pub fn square(shown: &Shown, values: &[f64]) -> Vec<f64> {
    each(shown.len(), |i| {
        if shown.depth(i).is_none() {
            return OPEN;
        }
        let [x, y] = shown.column_row(i).map(|c| c as i64);
        let around = (-2..2).flat_map(|dy| (-2..2).map(move |dx| (x + dx, y + dy)));
        let found: Vec<f64> = around.filter_map(|(x, y)| shown.pixel(x, y)).map(|j| values[j]).collect();
        found.iter().sum::<f64>() / found.len() as f64
    })
}

/// The joint bilateral filter along rows, then columns.
pub fn bilateral(shown: &Shown, settings: &Hbao, values: &[f64]) -> Vec<f64> {
    let rows = along(shown, settings, values, [1, 0]);
    along(shown, settings, &rows, [0, 1])
}

fn along(shown: &Shown, settings: &Hbao, values: &[f64], [dx, dy]: [i64; 2]) -> Vec<f64> {
    let reach = i64::from(settings.reach);
    let thickness = f64::from(settings.radius_mm) / 10.0;
    each(shown.len(), |i| {
        let Some((normal, position)) = shown.surface(i) else { return OPEN };
        let [x, y] = shown.column_row(i).map(|c| c as i64);
        let (mut sum, mut weights) = (values[i], 1.0);
        for k in (-reach..=reach).filter(|k| *k != 0) {
            let Some(j) = shown.pixel(x + k * dx, y + k * dy) else { continue };
            let Some((other, there)) = shown.surface(j) else { continue };
            let off = normal.dot(there - position) / thickness;
            let share = k as f64 / reach as f64;
            let weight = (-2.0 * share * share - 0.5 * off * off).exp() * normal.dot(other).max(0.0).powi(8);
            sum += weight * values[j];
            weights += weight;
        }
        sum / weights
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image_space::scenes::tests::shown;
    use glam::Vec3;

    const SETTINGS: Hbao = Hbao { radius_mm: 16.0, directions: 16, bias_deg: 30.0, falloff: true, reach: 7 };

    #[test]
    fn filters_keep_constants_and_one_of_them_keeps_edges() {
        let shown = shown(Vec3::new(1.0, 0.0, 1.0), true, 32);
        let constant = vec![0.25; shown.len()];
        for found in [square(&shown, &constant), bilateral(&shown, &SETTINGS, &constant)] {
            assert!(found.iter().all(|v| (v - 0.25).abs() < 1e-12));
        }
        // Floor and wall each of one value: nothing goes from one to the other, whose normals are across.
        let of: Vec<f64> = (0..shown.len()).map(|i| shown.surface(i).unwrap().0.z.round()).collect();
        assert!(of.contains(&0.0) && of.contains(&1.0));
        let kept = |found: &[f64]| found.iter().zip(&of).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(kept(&bilateral(&shown, &SETTINGS, &of)) && !kept(&square(&shown, &of)));
    }

    #[test]
    fn what_shows_nothing_is_open() {
        let nothing =
            Shown::of(&crate::image_space::scenes::tests::view_from(Vec3::X, 30.0), [5, 4], |_, _| None);
        for found in [square(&nothing, &[0.5; 20]), bilateral(&nothing, &SETTINGS, &[0.5; 20])] {
            assert_eq!(found, [1.0; 20]);
        }
    }
}
