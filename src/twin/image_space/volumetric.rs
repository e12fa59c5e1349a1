//! Volumetric ambient occlusion, after Szirmay-Kalos and others 2009, rows of AOV figure 9.
//!
//! The ball of diameter R, r = R/2, touches the surface at x from outside: its middle is c = x + n r. Lines along the view axis cross it through a disc of
//! samples at r √((i + ½)/N), each turned by the golden angle from the one before, the first by a hash of the pixel. With the half chord
//! h_i = r √(1 − (i + ½)/N), c_z the depth of the middle and d_i what the image shows where the chord's middle falls:
//!
//! ```text
//! A = Σ max(0, min(d_i, c_z + h_i) − (c_z − h_i)) / Σ 2 h_i
//! ```
//!
//! What the image does not show hides nothing. A plane is 1. A wall at distance s < r takes a cap of height g = r − s: A = 1 − g² (3r − g) / 4r³.

use super::shown::{GOLDEN, Shown, angle_of, hash};
use crate::each;
use cao_model::image_space::Volumetric;

/// Of every pixel; 1 where nothing is.
pub fn volumetric(shown: &Shown, settings: &Volumetric) -> Vec<f64> {
    let radius = 0.5 * f64::from(settings.radius_mm);
    let [right, down, _] = shown.axes();
    each(shown.len(), |i| {
        let Some((normal, position)) = shown.surface(i) else { return 1.0 };
        let middle = position + radius * normal;
        let turn = hash(i as u32);
        let (mut free, mut whole) = (0.0, 0.0);
        for k in 0..settings.samples {
            let area = (f64::from(k) + 0.5) / f64::from(settings.samples);
            let (sin, cos) = angle_of(k.wrapping_mul(GOLDEN).wrapping_add(turn)).sin_cos();
            let off = radius * area.sqrt();
            let half = radius * (1.0 - area).sqrt();
            let at = shown.place(middle + off * cos * right + off * sin * down);
            let to_surface = at.and_then(|(z, pixel)| shown.depth(pixel).map(|d| d - (z - half)));
            free += to_surface.map_or(2.0 * half, |way| way.clamp(0.0, 2.0 * half));
            whole += 2.0 * half;
        }
        free / whole
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image_space::scenes::tests::{floor, shown};
    use glam::Vec3;

    const SETTINGS: Volumetric = Volumetric { radius_mm: 32.0, samples: 256 };

    /// Aslant a pixel of 2 mm shows a depth that its neighbour line does not have: a few lines near the touching point end before the ball does.
    const ASLANT: f64 = 0.003;

    #[test]
    fn a_plane_is_open() {
        for (from, off) in [(Vec3::Z, 1e-12), (Vec3::new(1.0, 0.3, 0.6), ASLANT)] {
            let shown = shown(from, false, 48);
            let found = volumetric(&shown, &SETTINGS);
            let worst = floor(&shown, 0).map(|(i, _)| 1.0 - found[i]).fold(0.0, f64::max);
            assert!(worst < off, "{from}: {worst}");
        }
    }

    /// 256 lines, of which those of the rim end in one pixel or the next.
    const SAMPLED: f64 = 0.006;

    #[test]
    fn a_wall_takes_a_cap_of_the_ball() {
        let r = 0.5 * f64::from(SETTINGS.radius_mm);
        let cap = |s: f64| {
            let g = (r - s).max(0.0);
            1.0 - g * g * (3.0 * r - g) / (4.0 * r * r * r)
        };
        for (share, printed) in [(0.1, 0.648), (0.25, 0.84375), (0.4, 0.972)] {
            assert!((cap(2.0 * r * share) - printed).abs() < 1e-12);
        }
        let shown = shown(Vec3::new(1.0, 0.0, 1.0), true, 64);
        let found = volumetric(&shown, &SETTINGS);
        let mut near = [false; 3];
        for (i, position) in floor(&shown, 12) {
            let expected = cap(position.x);
            assert!((found[i] - expected).abs() < SAMPLED, "{}: {} {expected}", position.x, found[i]);
            for (near, share) in near.iter_mut().zip([0.1, 0.25, 0.4]) {
                *near |= (position.x / (2.0 * r) - share).abs() < 0.05;
            }
        }
        assert_eq!(near, [true; 3], "the image shows floor at the three distances");
    }
}
