//! Horizon-based ambient occlusion, after Bavoil and Sainz 2008 (Image-space horizon-based ambient occlusion), AOV figure 8.
//!
//! Angles are above the image plane through x. Along each of N directions u of the image, turned together by a hash of the pixel, the tangent of the
//! surface has the angle t, tan t = −n·u / n·b with b back to the eye. Six steps of R/6, moved by another hash, find what the image shows, at D from x:
//! r = |D|, sin h = D·b / r. A horizon starts at the tangent, raised by a bias, and each step that is above it raises it:
//!
//! ```text
//! A = 1 − 1/N Σ_u Σ_j W(r_j) (sin h_j − sin h_{j−1}),   h_0 = min(t + bias, 90°),   W(r) = 1 − r²/R², or 1
//! ```
//!
//! then a joint bilateral filter (blur.rs). A plane is 1. An infinite wall is ½ without falloff and bias, and 1 − ½ (1 − sin bias) seen along the normal of the
//! floor: what lies below the bias is lost.

use super::shown::{Shown, angle_of, hash};
use crate::each;
use cao_model::image_space::Hbao;

/// Steps along a direction.
const STEPS: u32 = 6;

/// Of every pixel before the filter; 1 where nothing is.
pub fn hbao(shown: &Shown, settings: &Hbao) -> Vec<f64> {
    let radius = f64::from(settings.radius_mm);
    let bias = f64::from(settings.bias_deg).to_radians();
    let [right, down, back] = shown.axes();
    each(shown.len(), |i| {
        let Some((normal, position)) = shown.surface(i) else { return 1.0 };
        let noise = hash(i as u32);
        let jitter = f64::from(hash(noise) >> 8) / f64::from(1 << 24);
        let mut sum = 0.0;
        for k in 0..settings.directions {
            let turn = k * (u32::MAX / settings.directions) + noise / settings.directions;
            let (sin, cos) = angle_of(turn).sin_cos();
            let along = cos * right + sin * down;
            let right_angle = std::f64::consts::FRAC_PI_2;
            let tangent = (-normal.dot(along)).atan2(normal.dot(back)).clamp(-right_angle, right_angle);
            let mut horizon = (tangent + bias).min(right_angle).sin();
            for step in 0..STEPS {
                let way = radius * (f64::from(step) + jitter) / f64::from(STEPS);
                let Some((_, pixel)) = shown.place(position + way * along) else { continue };
                let Some((_, there)) = shown.surface(pixel) else { continue };
                let to = there - position;
                let weight =
                    if settings.falloff { 1.0 - to.length_squared() / (radius * radius) } else { 1.0 };
                if pixel == i || weight <= 0.0 {
                    continue;
                }
                let sine = to.dot(back) / to.length();
                if sine > horizon {
                    sum += weight * (sine - horizon);
                    horizon = sine;
                }
            }
        }
        (1.0 - sum / f64::from(settings.directions)).clamp(0.0, 1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image_space::scenes::tests::{floor, shown};
    use glam::Vec3;

    const SETTINGS: Hbao = Hbao { radius_mm: 16.0, directions: 16, bias_deg: 30.0, falloff: true, reach: 0 };

    /// Aslant a step's pixel lies beside the direction, where the surface is nearer than along it; where that is near, by more than the bias.
    const ASLANT: f64 = 0.04;

    #[test]
    fn a_plane_is_open() {
        for (from, off) in [(Vec3::Z, 1e-12), (Vec3::new(1.0, 0.3, 0.6), ASLANT)] {
            let shown = shown(from, false, 64);
            let found = hbao(&shown, &SETTINGS);
            let worst = floor(&shown, 0).map(|(i, _)| 1.0 - found[i]).fold(0.0, f64::max);
            assert!(worst < off, "{from}: {worst}");
        }
    }

    /// A wall of 1000 mm seen from 2000 mm at less than 1 mm from it, in 32 directions.
    const INFINITE: f64 = 0.01;

    #[test]
    fn an_infinite_wall_is_a_half_without_falloff_and_bias() {
        for (from, bias_deg, expected) in [
            (Vec3::new(1.0, 0.0, 1.0), 0.0, 0.5),
            (Vec3::new(0.1, 0.0, 1.0), 0.0, 0.5),
            (Vec3::new(0.1, 0.0, 1.0), 30.0, 0.75),
        ] {
            let shown = shown(from, true, 128);
            let settings = Hbao { radius_mm: 45.0, directions: 32, bias_deg, falloff: false, reach: 0 };
            let found = hbao(&shown, &settings);
            let near: Vec<f64> =
                floor(&shown, 58).filter(|(_, p)| p.x < 1.0).map(|(i, _)| found[i]).collect();
            let mean = near.iter().sum::<f64>() / near.len() as f64;
            assert!((mean - expected).abs() < INFINITE, "{from} {bias_deg}: {mean} of {}", near.len());
            // With falloff only what is near counts.
            if bias_deg > 0.0 {
                let usual = hbao(&shown, &Hbao { falloff: true, ..settings });
                let (i, _) = floor(&shown, 58).find(|(_, p)| p.x < 1.0).unwrap();
                assert!(usual[i] > found[i] + 0.01);
            }
        }
    }
}
