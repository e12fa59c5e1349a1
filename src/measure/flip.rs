//! LDR-FLIP: how visible the difference of two pictures is when they take turns on a screen (Andersson et al., FLIP: A
//! Difference Evaluator for Alternating Images, HPG 2020; constants are the paper's).
//!
//! Per pixel, ΔE = ΔE_c^(1 − ΔE_f) in 0 … 1. ΔE_c compares colours after a filter for what the eye resolves, in L*a*b* with
//! Hunt's adjustment and the HyAB distance (§4.1); ΔE_f compares how strong edges and points are in the luminance (§4.2).

use cao_formats::Picture;
use glam::{DMat3, DVec3};

/// Pixels per degree of sight of the paper's default: a screen of 0.7 m and 3840 pixels, seen from 0.7 m.
pub const PIXELS_PER_DEGREE: f64 = 67.020_643_276_582_26;

/// Difference at each pixel, rows from the top: 0 invisible, 1 the largest there is.
#[derive(Clone, Debug)]
pub struct Flip {
    /// Pixels.
    pub map: Vec<f64>,
    /// Their mean, the number to quote.
    pub mean: f64,
}

/// Three channels of an image; which ones depends on the place.
type Channels = [Vec<f64>; 3];

/// FLIP of two pictures at a viewing distance.
///
/// # Panics
/// If the pictures differ in size.
pub fn flip(found: &Picture, reference: &Picture, pixels_per_degree: f64) -> Flip {
    assert_eq!((found.width, found.height), (reference.width, reference.height), "sizes of pictures");
    let [f, r] = [found, reference].map(|p| Side::new(p, pixels_per_degree));
    let largest = hyab(hunt([0.0, 1.0, 0.0]), hunt([0.0, 0.0, 1.0])).powf(COLOUR_POWER);
    let map: Vec<f64> = (0..found.pixels.len())
        .map(|i| {
            let colour = compressed(hyab(f.lab[i], r.lab[i]).powf(COLOUR_POWER), largest);
            let feature = (f.edges[i] - r.edges[i]).abs().max((f.points[i] - r.points[i]).abs());
            colour.powf(1.0 - (feature / 2.0_f64.sqrt()).powf(FEATURE_POWER))
        })
        .collect();
    let mean = map.iter().sum::<f64>() / map.len() as f64;
    Flip { map, mean }
}

/// q_c, power of the colour difference.
const COLOUR_POWER: f64 = 0.7;
/// q_f, power of the feature difference.
const FEATURE_POWER: f64 = 0.5;
/// w, width of an edge in degrees.
const EDGE_DEGREES: f64 = 0.082;

/// The largest differences are squeezed: what is below 0.4 of the largest fills 0 … 0.95.
fn compressed(difference: f64, largest: f64) -> f64 {
    let (knee, below) = (0.4 * largest, 0.95);
    if difference < knee {
        difference * below / knee
    } else {
        below + (difference - knee) / (largest - knee) * (1.0 - below)
    }
}

/// What one picture brings to the comparison.
struct Side {
    lab: Vec<[f64; 3]>,
    edges: Vec<f64>,
    points: Vec<f64>,
}

impl Side {
    fn new(picture: &Picture, ppd: f64) -> Self {
        let size = [picture.width as usize, picture.height as usize];
        let opponent = channels(picture.pixels.iter().map(|p| opponent(xyz(p.map(linear)))));
        // Sensitivity of each channel to contrast: Σ a·√(π/b)·exp(−π²d²/b) over distances d in degrees.
        let sensitivity: [&[[f64; 2]]; 3] =
            [&[[1.0, 0.0047]], &[[1.0, 0.0053]], &[[34.1, 0.04], [13.5, 0.025]]];
        let pi = std::f64::consts::PI;
        let reach = (3.0 * (0.04 / (2.0 * pi * pi)).sqrt() * ppd).ceil() as usize;
        let [y, cx, cz] = std::array::from_fn(|c| {
            let terms = sensitivity[c].iter().map(|&[a, b]| {
                let bell = kernel(reach, |x| (-pi * pi * (x / ppd).powi(2) / b).exp());
                (a * (pi / b).sqrt(), bell)
            });
            let terms: Vec<(f64, Vec<f64>)> = terms.collect();
            let total: f64 = terms.iter().map(|(a, bell)| a * bell.iter().sum::<f64>().powi(2)).sum();
            let mut sum = vec![0.0; opponent[c].len()];
            for (a, bell) in terms {
                let blurred = filter(&opponent[c], size, &bell, &bell);
                sum.iter_mut().zip(blurred).for_each(|(sum, b)| *sum += a / total * b);
            }
            sum
        });
        let seen = |i: usize| rgb(from_opponent([y[i], cx[i], cz[i]])).map(|c| c.clamp(0.0, 1.0));

        let luminance: Vec<f64> = opponent[0].iter().map(|y| (y + 16.0) / 116.0).collect();
        let sigma = 0.5 * EDGE_DEGREES * ppd;
        let reach = (3.0 * sigma).ceil() as usize;
        let gauss = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
        let bell = balanced(kernel(reach, gauss));
        let slope = balanced(kernel(reach, |x| -x * gauss(x)));
        let curve = balanced(kernel(reach, |x| (x * x / (sigma * sigma) - 1.0) * gauss(x)));
        let strength = |along: &[f64]| -> Vec<f64> {
            let (x, y) = (filter(&luminance, size, along, &bell), filter(&luminance, size, &bell, along));
            x.iter().zip(y).map(|(x, y)| x.hypot(y)).collect()
        };
        Self {
            lab: (0..y.len()).map(|i| hunt(seen(i))).collect(),
            edges: strength(&slope),
            points: strength(&curve),
        }
    }
}

fn channels(pixels: impl Iterator<Item = [f64; 3]>) -> Channels {
    let mut channels = Channels::default();
    for pixel in pixels {
        channels.iter_mut().zip(pixel).for_each(|(channel, value)| channel.push(value));
    }
    channels
}

/// Values of a function at −reach … reach pixels.
fn kernel(reach: usize, of: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..=2 * reach).map(|i| of(i as f64 - reach as f64)).collect()
}

/// Positive weights sum to 1, negative ones to −1.
fn balanced(kernel: Vec<f64>) -> Vec<f64> {
    let positive: f64 = kernel.iter().filter(|w| **w > 0.0).sum();
    let negative: f64 = -kernel.iter().filter(|w| **w < 0.0).sum::<f64>();
    kernel.into_iter().map(|w| if w < 0.0 { w / negative } else { w / positive }).collect()
}

/// Filters along x and along y; outside, the image continues with its edge.
fn filter(image: &[f64], [width, height]: [usize; 2], along_x: &[f64], along_y: &[f64]) -> Vec<f64> {
    let pass = |image: &[f64], weights: &[f64], vertical: bool| -> Vec<f64> {
        let (reach, size) = (weights.len() / 2, if vertical { height } else { width });
        let at = |x: usize, y: usize| {
            let centre = if vertical { y } else { x };
            let weighted = weights.iter().enumerate().map(|(k, weight)| {
                let place = (centre + k).saturating_sub(reach).min(size - 1);
                weight * if vertical { image[place * width + x] } else { image[y * width + place] }
            });
            weighted.sum::<f64>()
        };
        (0..width * height).map(|i| at(i % width, i / width)).collect()
    };
    pass(&pass(image, along_x, false), along_y, true)
}

/// Intensity of an 8-bit sRGB value (IEC 61966-2-1).
fn linear(stored: u8) -> f64 {
    let c = f64::from(stored) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Linear sRGB to XYZ under D65, exact quotients of the primaries.
const TO_XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

fn xyz(rgb: [f64; 3]) -> [f64; 3] {
    TO_XYZ.map(|row| row.iter().zip(rgb).map(|(m, c)| m * c).sum())
}

fn rgb(xyz: [f64; 3]) -> [f64; 3] {
    (DMat3::from_cols_array_2d(&TO_XYZ).transpose().inverse() * DVec3::from_array(xyz)).to_array()
}

/// XYZ relative to white.
fn relative(xyz: [f64; 3]) -> [f64; 3] {
    let white = self::xyz([1.0; 3]);
    std::array::from_fn(|i| xyz[i] / white[i])
}

/// YC_xC_z, linear in XYZ: luminance, red against green, blue against yellow.
fn opponent(xyz: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = relative(xyz);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn from_opponent([luminance, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (luminance + 16.0) / 116.0;
    let white = xyz([1.0; 3]);
    [(y + cx / 500.0) * white[0], y * white[1], (y - cz / 200.0) * white[2]]
}

/// L*a*b* of linear sRGB, a* and b* fading with the lightness as Hunt found.
fn hunt(rgb: [f64; 3]) -> [f64; 3] {
    let delta: f64 = 6.0 / 29.0;
    let [x, y, z] = relative(xyz(rgb))
        .map(|t| if t > delta.powi(3) { t.cbrt() } else { t / (3.0 * delta * delta) + 4.0 / 29.0 });
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// City-block in lightness, Euclidean in colour.
fn hyab(p: [f64; 3], q: [f64; 3]) -> f64 {
    (p[0] - q[0]).abs() + (p[1] - q[1]).hypot(p[2] - q[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The authors' program works in f32, ours in f64.
    const ROUNDING: f64 = 1e-4;

    fn picture(width: u32, height: u32, of: fn(u32, u32) -> [u32; 3]) -> Picture {
        let pixel = |i| of(i % width, i / width).map(|c| (c % 256) as u8);
        Picture { width, height, pixels: (0..width * height).map(pixel).collect() }
    }

    fn close(found: f64, expected: f64, what: &str) {
        assert!((found - expected).abs() < ROUNDING, "{what}: {found}, expected {expected}");
    }

    /// Even pictures have no features, so that ΔE = ΔE_c. Green and blue are as far apart as the measure goes: 1. Black and
    /// white differ by 100 in lightness, which is beyond the knee.
    #[test]
    fn even_pictures_by_hand() {
        let even = |c: fn(u32, u32) -> [u32; 3]| picture(9, 7, c);
        let (black, white) = (even(|_, _| [0; 3]), even(|_, _| [255; 3]));
        let (green, blue) = (even(|_, _| [0, 255, 0]), even(|_, _| [0, 0, 255]));
        close(flip(&green, &blue, PIXELS_PER_DEGREE).mean, 1.0, "green and blue");
        let largest = hyab(hunt([0.0, 1.0, 0.0]), hunt([0.0, 0.0, 1.0])).powf(0.7);
        let share = 100_f64.powf(0.7) / largest;
        let expected = 0.95 + 0.05 * (share - 0.4) / 0.6;
        close(expected, 0.967_396, "black and white in the authors' program");
        let difference = flip(&black, &white, PIXELS_PER_DEGREE);
        assert!(difference.map.iter().all(|d| (d - expected).abs() < 1e-9));
        assert_eq!(flip(&white, &white, PIXELS_PER_DEGREE).mean, 0.0);
    }

    /// Against the authors' program, flip-evaluator 1.7, on the same pictures: mean, largest, at (20, 15).
    #[test]
    fn textures_as_the_authors_program_has_them() {
        let size = |of| picture(40, 30, of);
        let ramp = size(|x, y| [x * 6, y * 8, x * 7 + y * 3]);
        let noise = size(|x, y| [x * 37 + y * 91, x * 13 + y * 57, x * 71 + y * 29]);
        let flat = size(|_, _| [100; 3]);
        let dot = size(|x, y| if (x, y) == (20, 15) { [255; 3] } else { [100; 3] });
        let grey = size(|_, _| [128; 3]);
        let black = size(|_, _| [0; 3]);
        let far = 67.0206;
        for (reference, found, ppd, mean, largest, one) in [
            (&grey, &black, far, 0.933_894, 0.933_897, 0.933_897),
            (&ramp, &noise, far, 0.837_174, 0.982_702, 0.586_688),
            (&ramp, &noise, 20.0, 0.901_892, 0.991_854, 0.824_056),
            (&ramp, &grey, far, 0.813_440, 0.977_444, 0.607_798),
            (&flat, &dot, far, 0.004_655, 0.468_655, 0.468_655),
            (&flat, &dot, 20.0, 0.001_566, 0.982_592, 0.982_592),
        ] {
            let flip = flip(found, reference, ppd);
            close(flip.mean, mean, "mean");
            close(flip.map.iter().copied().fold(0.0, f64::max), largest, "largest");
            close(flip.map[15 * 40 + 20], one, "one pixel");
        }
        // Which picture is the reference makes no difference; where things are does.
        let (there, back) = (flip(&ramp, &noise, far), flip(&noise, &ramp, far));
        assert_eq!(there.mean, back.mean);
        let moved = size(|x, y| if (x, y) == (30, 15) { [255; 3] } else { [100; 3] });
        assert!(flip(&moved, &dot, far).mean > flip(&flat, &dot, far).mean);
    }
}
