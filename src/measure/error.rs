//! Errors of an ambient volume or an image against a reference (measure.md §2).
//!
//! Only voxels that a renderer can sample count: see [`counting`]. Structural similarity is in [`super::ssim`], FLIP in
//! [`super::flip`].

use cao_twin::Grid;

/// How far values are from their reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Values that counted; where it is 0 all errors are NaN.
    pub count: usize,
    /// √ of the mean squared error.
    pub rmse: f64,
    /// Largest |found − reference|; NaN if any value is.
    pub max: f64,
    /// Mean of found − reference: above 0 is too bright.
    pub bias: f64,
    /// Mean of (found − reference)².
    pub mse: f64,
}

/// Errors of the values that count; all slices have the same order and length.
///
/// # Panics
/// If the lengths differ.
pub fn errors(found: &[f32], reference: &[f32], counts: &[bool]) -> Errors {
    errors_of(pairs(found, reference, counts))
}

/// Errors of values (found, reference).
fn errors_of(pairs: impl Iterator<Item = (f64, f64)>) -> Errors {
    let (mut count, mut sum, mut squares, mut max) = (0_usize, 0.0, 0.0, 0.0_f64);
    for (found, reference) in pairs {
        let difference = found - reference;
        count += 1;
        sum += difference;
        squares += difference * difference;
        // `f64::max` would drop a NaN.
        max = if difference.is_nan() || difference.abs() > max { difference.abs() } else { max };
    }
    let n = count as f64;
    let mse = squares / n;
    let max = if mse.is_nan() { f64::NAN } else { max };
    Errors { count, rmse: mse.sqrt(), max, bias: sum / n, mse }
}

fn pairs<'a>(
    found: &'a [f32],
    reference: &'a [f32],
    counts: &'a [bool],
) -> impl Iterator<Item = (f64, f64)> + Clone + 'a {
    assert_eq!(
        (found.len(), counts.len()),
        (reference.len(), reference.len()),
        "lengths of what is compared"
    );
    let all = found.iter().zip(reference).zip(counts);
    all.filter(|(_, counts)| **counts).map(|((f, r), _)| (f64::from(*f), f64::from(*r)))
}

/// `slope · found + intercept`, the best guess of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// Change of the reference with the value found.
    pub slope: f64,
    /// Value of the reference where 0 is found.
    pub intercept: f64,
}

/// "Shape error": what is left of the errors when brightness and contrast of the values found are fitted to the reference
/// by least squares. For methods with another tone, beside [`errors`].
///
/// # Panics
/// If the lengths differ.
pub fn shape_errors(found: &[f32], reference: &[f32], counts: &[bool]) -> (Errors, Affine) {
    let pairs = pairs(found, reference, counts);
    let n = pairs.clone().count() as f64;
    let mean = |of: fn((f64, f64)) -> f64| pairs.clone().map(of).sum::<f64>() / n;
    let (mean_f, mean_r) = (mean(|p| p.0), mean(|p| p.1));
    let (mut variance, mut covariance) = (0.0, 0.0);
    for (f, r) in pairs.clone() {
        variance += (f - mean_f) * (f - mean_f);
        covariance += (f - mean_f) * (r - mean_r);
    }
    // Values that are all the same say nothing of the reference but its mean.
    let slope = if variance == 0.0 { 0.0 } else { covariance / variance };
    let fit = Affine { slope, intercept: mean_r - slope * mean_f };
    (errors_of(pairs.map(|(f, r)| (fit.slope * f + fit.intercept, r))), fit)
}

/// Which voxels a sample with opacity can interpolate: those with opacity, or with a neighbour that has some (faces, edges
/// and corners). x fastest.
pub fn counting(grid: &Grid, opacity: &[f32]) -> Vec<bool> {
    let mut near: Vec<bool> = opacity.iter().map(|a| *a > 0.0).collect();
    let mut stride = 1;
    for n in grid.dims {
        let wider = (0..near.len()).map(|i| {
            let at = i / stride % n;
            near[i] || (at > 0 && near[i - stride]) || (at + 1 < n && near[i + stride])
        });
        near = wider.collect();
        stride *= n;
    }
    near
}

/// An image of 8-bit accessibility, 0 = fully occluded … 255 = unobstructed; rows from the top.
#[derive(Clone, Copy)]
pub struct Accessibility<'a> {
    /// Pixels along x.
    pub width: usize,
    /// `width` values a row.
    pub pixels: &'a [u8],
}

/// AOV eq. (31), "8-bit variance": the mean squared error of log† T and, by half, of log† of its two derivatives, with
/// log† t = sign t · ln(|t| + 1) (eq. (32)).
///
/// The paper leaves open how derivatives are taken, here differences of neighbouring pixels, each mean over the pairs
/// that there are; and the base of the logarithm, here e.
///
/// # Panics
/// If the images differ in size.
pub fn aov_error(found: Accessibility, reference: Accessibility) -> f64 {
    let width = reference.width;
    assert_eq!((found.width, found.pixels.len()), (width, reference.pixels.len()), "sizes of images");
    let height = reference.pixels.len() / width.max(1);
    let value = |image: &Accessibility, x: usize, y: usize| f64::from(image.pixels[y * width + x]);
    let mse = |columns: usize, rows: usize, of: &dyn Fn(&Accessibility, usize, usize) -> f64| {
        let mut sum = 0.0;
        for y in 0..rows {
            for x in 0..columns {
                let difference = signed_log(of(&found, x, y)) - signed_log(of(&reference, x, y));
                sum += difference * difference;
            }
        }
        // One row or column has no derivative across, and no error in it.
        if columns * rows == 0 { 0.0 } else { sum / (columns * rows) as f64 }
    };
    let along_x = |i: &Accessibility, x: usize, y: usize| value(i, x + 1, y) - value(i, x, y);
    let along_y = |i: &Accessibility, x: usize, y: usize| value(i, x, y + 1) - value(i, x, y);
    mse(width, height, &value)
        + 0.5
            * (mse(width.saturating_sub(1), height, &along_x)
                + mse(width, height.saturating_sub(1), &along_y))
}

/// AOV eq. (32).
fn signed_log(t: f64) -> f64 {
    t.signum() * t.abs().ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-7, "{found} {expected}");
    }

    const REFERENCE: [f32; 5] = [0.5, 0.25, 1.0, 0.0, 9.0];
    const FOUND: [f32; 5] = [0.75, 0.25, 0.5, 0.25, 7.0];
    const COUNTS: [bool; 5] = [true, true, true, true, false];

    /// Differences ¼, 0, −½, ¼: squares 1/16, 0, 1/4, 1/16.
    #[test]
    fn errors_by_hand() {
        let e = errors(&FOUND, &REFERENCE, &COUNTS);
        assert_eq!(e, Errors { count: 4, rmse: (0.375_f64 / 4.0).sqrt(), max: 0.5, bias: 0.0, mse: 0.09375 });
        let brighter = REFERENCE.map(|r| r + 0.125);
        let e = errors(&brighter, &REFERENCE, &COUNTS);
        assert_eq!((e.rmse, e.max, e.bias, e.mse), (0.125, 0.125, 0.125, 0.015_625));
    }

    #[test]
    fn equal_values_have_no_error_and_changed_order_has() {
        let same = errors(&REFERENCE, &REFERENCE, &COUNTS);
        assert_eq!((same.rmse, same.max, same.bias, same.mse), (0.0, 0.0, 0.0, 0.0));
        let mut turned = REFERENCE;
        turned[..4].rotate_left(1);
        let other = errors(&turned, &REFERENCE, &COUNTS);
        // The same values elsewhere: no bias, but an error.
        assert!(other.rmse > 0.1 && other.max > 0.1);
        close(other.bias, 0.0);
    }

    #[test]
    fn nothing_compared_and_values_that_are_none_are_no_success() {
        let nothing = errors(&FOUND, &REFERENCE, &[false; 5]);
        assert!(nothing.count == 0 && nothing.rmse.is_nan() && nothing.bias.is_nan() && nothing.mse.is_nan());
        assert!(nothing.max.is_nan());
        for place in 0..3 {
            let mut broken = FOUND;
            broken[place] = f32::NAN;
            let e = errors(&broken, &REFERENCE, &COUNTS);
            assert!(e.max.is_nan() && e.rmse.is_nan());
        }
    }

    #[test]
    fn shape_errors_forgive_tone_and_nothing_else() {
        let toned = REFERENCE.map(|r| (r - 0.5) / 4.0);
        let (e, fit) = shape_errors(&toned, &REFERENCE, &COUNTS);
        close(fit.slope, 4.0);
        close(fit.intercept, 0.5);
        close(e.max, 0.0);
        assert!(errors(&toned, &REFERENCE, &COUNTS).rmse > 0.3);
        // By hand: found 0, 1, 2 of reference 0, 0, 3 has slope 3/2, intercept −½, residuals −½, 1, −½.
        let (e, fit) = shape_errors(&[0.0, 1.0, 2.0], &[0.0, 0.0, 3.0], &[true; 3]);
        assert_eq!(fit, Affine { slope: 1.5, intercept: -0.5 });
        assert_eq!((e.count, e.mse, e.max, e.bias), (3, 0.5, 1.0, 0.0));
        // Turned in order, no tone helps.
        let (e, _) = shape_errors(&[1.0, 2.0, 0.0], &[0.0, 0.0, 3.0], &[true; 3]);
        assert!(e.mse > 0.4);
        let (e, fit) = shape_errors(&[0.3; 3], &[0.0, 0.0, 3.0], &[true; 3]);
        assert_eq!((fit.slope, fit.intercept, e.mse), (0.0, 1.0, 2.0));
    }

    #[test]
    fn a_voxel_counts_with_its_neighbours_and_no_further() {
        let grid = Grid { dims: [5, 4, 3], spacing: [1.0; 3] };
        let mut opacity = vec![0.0; grid.len()];
        assert!(!counting(&grid, &opacity).contains(&true));
        opacity[grid.index([1, 2, 1])] = 1e-6;
        let counts = counting(&grid, &opacity);
        for (i, counts) in counts.iter().enumerate() {
            let [x, y, _] = grid.voxel(i);
            assert_eq!(*counts, x <= 2 && y >= 1, "{:?}", grid.voxel(i));
        }
    }

    /// One pixel of two by two is 7 instead of 3: ln 8 − ln 4 = ln 2 once in four values; of the two differences along x one
    /// is 4 instead of 0 (ln 5), and of the two along y.
    #[test]
    fn aov_error_by_hand() {
        let image = |pixels| Accessibility { width: 2, pixels };
        let (even, one) = ([3; 4], [3, 7, 3, 3]);
        let expected = 2_f64.ln().powi(2) / 4.0 + 0.5 * 2.0 * 5_f64.ln().powi(2) / 2.0;
        close(aov_error(image(&one), image(&even)), expected);
        assert_eq!(aov_error(image(&one), image(&one)), 0.0);
        assert!(aov_error(image(&[7, 3, 3, 3]), image(&one)) > 0.1);
        // A gradient of the other sign counts as the sum of both.
        let expected = 4_f64.ln().powi(2) * 2.0 / 2.0 + 0.5 * (2.0 * 4_f64.ln()).powi(2);
        let row = |pixels| Accessibility { width: 2, pixels };
        close(aov_error(row(&[0, 3]), row(&[3, 0])), expected);
        let single = |pixels| Accessibility { width: 1, pixels };
        close(aov_error(single(&[0]), single(&[255])), 256_f64.ln().powi(2));
    }

    /// What is left after the fit is what the methods' forms promise, computed in float64 outside of this program for another gyroid (R 16
    /// voxels, opacity 0.5): N-buffers 0.010, mip levels 0.029, cones along 14 directions 0.021 and along 26 of them 0.015. Raw errors of
    /// SPAO are those of its tone.
    #[test]
    fn forms_of_means_err_in_shape_as_they_promise() {
        use cao_model::occlusion::{Integral, Occlusion, RaySet};
        use cao_model::options::{Levels, Options};
        use cao_twin::{cones::cone::cones_at, measure::reference::reference, spao::product::Shells};

        const RADIUS: f64 = 16.0;
        let grid = Grid { dims: [64; 3], spacing: [1.0; 3] };
        let opacity: Vec<f32> = (0..grid.len())
            .map(|i| {
                let [x, y, z] = grid.voxel(i).map(|c| c as f64 * std::f64::consts::TAU / 32.0);
                let sheet = x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos();
                (0.5 * (1.0 - sheet.abs() / 0.4).max(0.0)) as f32
            })
            .collect();
        // Steps that share no factor with the volume's size come everywhere.
        let anywhere = (0..grid.len()).map(|i| grid.voxel(i * 104_729 % grid.len()));
        let voxels: Vec<_> = anywhere.filter(|voxel| opacity[grid.index(*voxel)] > 0.0).take(300).collect();
        let integral = Integral::ambient(RADIUS, 0.5, 2, 150, 1.0);
        let points: Vec<[f64; 3]> = voxels.iter().map(|v| v.map(|c| c as f64)).collect();
        let truth: Vec<f32> =
            reference(&grid, &opacity, &integral, 1.0, &points).into_iter().map(|v| v as f32).collect();
        let of = |values: Vec<f64>| {
            let values: Vec<f32> = values.into_iter().map(|v| v as f32).collect();
            let counts = vec![true; truth.len()];
            (shape_errors(&values, &truth, &counts).0.rmse, errors(&values, &truth, &counts).bias)
        };
        let spao = |levels| {
            let options = Options { levels, ..Options::DEFAULT };
            let shells = Shells::new(&grid, &opacity, RADIUS, &options, 1.0);
            of(voxels.iter().map(|v| shells.value(*v)).collect())
        };
        let cones = |rays| {
            let occlusion = Occlusion { rays, radius_mm: RADIUS as f32, ..Occlusion::paper(1.0) };
            of(cones_at(&grid, &opacity, &occlusion, &voxels))
        };
        let nbuffer = spao(Levels::Nbuffer);
        let mip = spao(Levels::Mip);
        let (one, three) = (spao(Levels::Mixed(1)), spao(Levels::Reversed(3)));
        let (few, many) = (cones(RaySet::W14), cones(RaySet::W26));
        let all =
            format!("{nbuffer:?} mip {mip:?} mixed:1 {one:?} reversed:3 {three:?} cones {few:?} {many:?}");
        assert!(nbuffer.0 < 0.02 && mip.0 > 1.5 * nbuffer.0 && mip.0 < 0.06, "{all}");
        assert!(one.0 > 1.3 * nbuffer.0 && three.0 < 1.3 * nbuffer.0, "{all}");
        assert!(many.0 < few.0 && few.0 < 0.04, "{all}");
    }
}
