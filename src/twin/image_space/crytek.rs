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

    fn over(values: &[f64], of: impl Iterator<Item = (usize, DVec3)>) -> [f64; 3] {
        let found: Vec<f64> = of.map(|(i, _)| values[i]).collect();
        assert!(found.len() > 50);
        let bound = |of: fn(f64, f64) -> f64, from| found.iter().copied().fold(from, of);
        [bound(f64::min, 1.0), found.iter().sum::<f64>() / found.len() as f64, bound(f64::max, 0.0)]
    }

    /// Exactly: of two opposite points one is hidden. Seen aslant the deeper of them are more than R behind what the image shows, and open.
    #[test]
    fn a_flat_wall_is_a_half_and_brighter_aslant() {
        let frontal = shown(Vec3::Z, false, 64);
        assert_eq!(over(&crytek(&frontal, &SETTINGS), floor(&frontal, BORDER)), [0.5; 3]);
        let aslant = shown(Vec3::new(1.0, 0.3, 0.6), false, 64);
        let [least, mean, _] = over(&crytek(&aslant, &SETTINGS), floor(&aslant, BORDER));
        assert!(least >= 0.5 && (0.6..0.7).contains(&mean), "{least} {mean}");
    }

    #[test]
    fn a_concave_corner_is_darker_and_a_convex_edge_brighter() {
        let concave = shown(Vec3::new(1.0, 0.2, 1.0), true, 64);
        let blurred = square(&concave, &crytek(&concave, &SETTINGS));
        let at =
            |near: bool| over(&blurred, floor(&concave, BORDER).filter(move |(_, p)| (p.x < 4.0) == near))[1];
        assert!(at(true) < at(false) - 0.1, "{} {}", at(true), at(false));
        // The same corner from outside is an edge.
        let convex = shown(Vec3::new(-1.0, 0.2, -1.0), true, 64);
        let blurred = square(&convex, &crytek(&convex, &SETTINGS));
        let near = (0..convex.len()).filter_map(|i| Some((i, convex.surface(i)?.1)));
        let near = near.filter(|(_, p)| p.x < 4.0 && p.z < 4.0 && p.y.abs() < 25.0);
        assert!(over(&blurred, near)[1] > at(false) + 0.1);
    }

    #[test]
    fn mirrors_are_sixteen_and_points_fill_the_ball() {
        let mirrors: Vec<DVec3> = (0..16).map(|i| mirror(i % 4, i / 4)).collect();
        for (i, a) in mirrors.iter().enumerate() {
            assert!((a.length() - 1.0).abs() < 1e-12 && mirrors[..i].iter().all(|b| a.distance(*b) > 0.3));
        }
        assert_eq!(mirror(5, 6), mirror(1, 2));
        // The mean of |p|³ is ½ where points are in equal volumes.
        let cubes = (0..PAIRS).map(|i| point(i).length().powi(3)).sum::<f64>();
        assert!((cubes / f64::from(PAIRS) - 0.5).abs() < 1e-12);
    }
}
