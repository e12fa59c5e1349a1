//! Ambient occlusion from depth alone, after Mittring 2007 (Finding next gen, CryEngine 2), a row of AOV figure 9.
//!
//! With the position x of a pixel, q_i = x + R m(o_i), z_i the depth of q_i and d_i what the image shows where q_i falls:
//!
//! ```text
//! A = 1 − #{ i : 0 < z_i − d_i ≤ R } / 16       then the mean of 4 × 4 pixels (blur.rs)
//! ```
//!
//! The o_i are 8 points of the upper half of the unit ball, in equal volumes, and the 8 opposite ones; m mirrors them at a plane through the middle, one
//! of 16 over 4 × 4 pixels. So of a flat wall exactly 8 of 16 are hidden: A = ½, which is the method's and is not rescaled. A surface in front of a point by
//! more than R hides nothing, nor does what the image does not show.

use super::shown::{GOLDEN, Shown, angle_of};
use crate::each;
use cao_model::image_space::Crytek;
use glam::DVec3;

/// Half of the points.
const PAIRS: u32 = 8;

/// Of every pixel before the filter; 1 where nothing is.
pub fn crytek(shown: &Shown, settings: &Crytek) -> Vec<f64> {
    let radius = f64::from(settings.radius_mm);
    let points: Vec<DVec3> = (0..PAIRS).map(point).flat_map(|p| [p, -p]).collect();
    each(shown.len(), |i| {
        let Some((_, position)) = shown.surface(i) else { return 1.0 };
        let [x, y] = shown.column_row(i);
        let normal = mirror(x as u32, y as u32);
        let hides = |p: &&DVec3| {
            let mirrored = **p - 2.0 * p.dot(normal) * normal;
            let Some((z, pixel)) = shown.place(position + radius * mirrored) else { return false };
            shown.depth(pixel).is_some_and(|d| d < z && z - d <= radius)
        };
        1.0 - points.iter().filter(hides).count() as f64 / points.len() as f64
    })
}

/// A point of the upper half of the unit ball.
fn point(i: u32) -> DVec3 {
    let share = (f64::from(i.reverse_bits() >> 29) + 0.5) / f64::from(PAIRS);
    direction((f64::from(i) + 0.5) / f64::from(PAIRS), i) * share.cbrt()
}

/// The normal of a pixel's mirror.
fn mirror(x: u32, y: u32) -> DVec3 {
    let i = 7 * (x % 4 + 4 * (y % 4)) % 16;
    direction((f64::from(i) + 0.5) / 8.0 - 1.0, i)
}

fn direction(height: f64, i: u32) -> DVec3 {
    let (sin, cos) = angle_of(i.wrapping_mul(GOLDEN)).sin_cos();
    let ring = (1.0 - height * height).sqrt();
    DVec3::new(ring * cos, ring * sin, height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image_space::blur::square;
    use crate::image_space::scenes::tests::{floor, shown};
    use glam::Vec3;

    const SETTINGS: Crytek = Crytek { radius_mm: 16.0 };

    /// Radius in pixels and the filter's, for views of 100 mm by 64 pixels.
    const BORDER: usize = 13;

    #[test]
    fn a_flat_wall_is_a_half() {
        for (from, off) in [(Vec3::Z, 1e-12), (Vec3::new(1.0, 0.3, 0.6), 0.0)] {
            let shown = shown(from, false, 64);
            let raw = crytek(&shown, &SETTINGS);
            let found: Vec<f64> = floor(&shown, BORDER).map(|(i, _)| raw[i]).collect();
            println!(
                "{from}: {:?}",
                found.iter().fold((1.0_f64, 0.0_f64), |(a, b), v| (a.min(*v), b.max(*v)))
            );
            let _ = off;
        }
    }

    #[test]
    fn a_concave_corner_is_darker_and_a_convex_edge_brighter() {
        let shown = shown(Vec3::new(1.0, 0.2, 1.0), true, 64);
        let blurred = square(&shown, &crytek(&shown, &SETTINGS));
        let mean = |near: bool| {
            let of: Vec<f64> =
                floor(&shown, BORDER).filter(|(_, p)| (p.x < 4.0) == near).map(|(i, _)| blurred[i]).collect();
            of.iter().sum::<f64>() / of.len() as f64
        };
        println!("{} {}", mean(true), mean(false));
    }
}
