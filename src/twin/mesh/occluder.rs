//! Ambient occlusion of a point by a polygon (AOV §4) and the falloff of a triangle's volume (§5.1), relative to the point.
//!
//! `AO = −(1/2π) Σ_i θ_i n·m_i`, `m_i = S(p_i × p_j)`, `θ_i = atan2(|p_i × p_j|, p_i·p_j)`, over the polygon clipped to n·p ≥ 0: eq. 12 and 19
//! with the sign of polygons that face the point, and without the acos that loses small angles.

use cao_model::surface::Triangle;
use glam::{DMat3, DVec3};
use std::f64::consts::TAU;

/// A polygon's part above the plane through the origin across `normal`.
pub fn clipped(polygon: &[DVec3], normal: DVec3) -> Vec<DVec3> {
    let mut above = Vec::new();
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (from, to) = (normal.dot(p), normal.dot(q));
        if from >= 0.0 {
            above.push(p);
        }
        if (from >= 0.0) != (to >= 0.0) {
            above.push(p + (q - p) * (from / (from - to)));
        }
    }
    above
}

/// Occlusion of the origin, whose surface has this normal, by a plane polygon that faces it: clockwise as seen from there.
pub fn occlusion(polygon: &[DVec3], normal: DVec3) -> f64 {
    let above = clipped(polygon, normal);
    let term = |i: usize| {
        let (p, q) = (above[i], above[(i + 1) % above.len()]);
        let across = p.cross(q);
        let sine = across.length();
        if sine > 0.0 { sine.atan2(p.dot(q)) * normal.dot(across) / sine } else { 0.0 }
    };
    (-(0..above.len()).map(term).sum::<f64>() / TAU).max(0.0)
}

/// How far volumes reach.
#[derive(Clone, Copy, Debug)]
pub struct Volume {
    /// δ in mm.
    pub delta: f64,
    /// Whether their corners are clamped (§5.2), so that none is cut by a box.
    pub clamped: bool,
}

/// The length that extension vectors are clamped to, in δ (§5.2).
const CLAMP: f64 = 2.0;

/// Corners that stick out of a volume farther than this, in δ, make it a sliver's, which ends with the box of its triangle.
const MOST_MITRE: f64 = 4.0;

/// What lies in front of a face by less than this, in mm, is the face itself: places come from rays in f32.
const NOTHING: f64 = 1e-3;

/// Whether the origin is over the base of a clamped volume: extension vectors by eq. 28.
fn in_clamped(corners: [DVec3; 3], inward: [DVec3; 3], face: DVec3, delta: f64) -> bool {
    let base = [0, 1, 2].map(|i| {
        let planes = DMat3::from_cols(inward[i], inward[(i + 2) % 3], -face).transpose();
        let extension = planes.inverse() * DVec3::new(-delta, -delta, 0.0);
        corners[i] + extension.clamp_length_max(CLAMP * delta)
    });
    (0..3).all(|i| {
        let (from, to) = (base[i], base[(i + 1) % 3]);
        from.dot(face.cross(to - from)) <= 0.0
    })
}

/// g of eq. 24, without ᾱ, of a triangle that faces the origin: the product with the distance from the face, which the printed one ends before.
fn falloff(corners: [DVec3; 3], Volume { delta, clamped }: Volume) -> f64 {
    let [a, b, c] = corners;
    let face = (b - a).cross(c - a).normalize();
    let height = -a.dot(face);
    if height <= NOTHING || height >= delta {
        return 0.0;
    }
    let edges = [(a, b), (b, c), (c, a)];
    let inward = edges.map(|(from, to)| face.cross((to - from).normalize()));
    if clamped && !in_clamped(corners, inward, face, delta) {
        return 0.0;
    }
    let sharp = |i: usize| 1.0 / (0.5 * (1.0 + inward[i].dot(inward[(i + 2) % 3]))).sqrt();
    if !clamped && (0..3).any(|i| sharp(i) > MOST_MITRE) {
        let longest = |x: DVec3, y: DVec3| if y.length() > x.length() { y } else { x };
        let along = edges.map(|(from, to)| to - from).into_iter().fold(DVec3::ZERO, longest).normalize();
        for axis in [along, face.cross(along)] {
            let places = corners.map(|p| p.dot(axis));
            let low = places.into_iter().fold(f64::INFINITY, f64::min);
            let high = places.into_iter().fold(f64::NEG_INFINITY, f64::max);
            if low > delta || high < -delta {
                return 0.0;
            }
        }
    }
    let near: f64 =
        corners.iter().zip(inward).map(|(p, m)| (1.0 - p.dot(m) / delta).clamp(0.0, 1.0)).product();
    near * (1.0 - height / delta)
}

/// A triangle's faces as a place sees them, relative to it, and g of eq. 24, the product with ᾱ: of one with two sides one faces it, whose g is the other's 0.
fn faces(triangle: &Triangle, two_sided: bool, place: DVec3, volume: Volume) -> [([DVec3; 3], f64); 2] {
    let [a, b, c] = triangle.corners.map(|corner| corner.as_dvec3() - place);
    let of = |corners, there: bool| {
        let falloff = if there { falloff(corners, volume) } else { 0.0 };
        (corners, f64::from(triangle.opacity) * falloff)
    };
    [of([a, b, c], true), of([a, c, b], two_sided)]
}

/// What a triangle contributes to the occlusion of a place: ᾱ times falloff times exact occlusion; of one with two sides the one that faces it.
pub fn contribution(
    triangle: &Triangle,
    two_sided: bool,
    place: DVec3,
    normal: DVec3,
    volume: Volume,
) -> f64 {
    let of = |(corners, g): ([DVec3; 3], f64)| if g > 0.0 { g * occlusion(&corners, normal) } else { 0.0 };
    faces(triangle, two_sided, place, volume).map(of).iter().sum()
}

/// Whether a place is in a triangle's volume: where g is above 0.
pub fn holds(triangle: &Triangle, two_sided: bool, place: DVec3, volume: Volume) -> bool {
    faces(triangle, two_sided, place, volume).iter().any(|(_, g)| *g > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Clockwise as seen from the origin below.
    fn square(half: f64, height: f64) -> [DVec3; 4] {
        [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
            .map(|(x, y)| DVec3::new(half * x, half * y, height))
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-6, "{found}, expected {expected}");
    }

    #[test]
    fn known_answers_of_polygons() {
        near(occlusion(&square(1.0, 1.0), DVec3::Z), 0.554_126_4);
        // A disc: r²/(r² + h²).
        let disc: Vec<DVec3> = (0..4000)
            .map(|i| {
                DVec3::new((-TAU * f64::from(i) / 4000.0).cos(), (-TAU * f64::from(i) / 4000.0).sin(), 0.5)
            })
            .collect();
        near(occlusion(&disc, DVec3::Z), 0.8);
        let triangle = [(0.3, -0.2, 0.5), (1.4, 0.6, 1.1), (-0.5, 0.9, 0.8)].map(DVec3::from);
        let either =
            occlusion(&triangle, DVec3::Z).max(occlusion(&[triangle[0], triangle[2], triangle[1]], DVec3::Z));
        near(either, 0.154_288);
        // From behind there is nothing.
        let mut turned = square(1.0, 1.0);
        turned.reverse();
        near(occlusion(&turned, DVec3::Z), 0.0);
    }

    #[test]
    fn a_wall_is_clipped_at_the_tangent_plane() {
        // A wall of height h at distance d, as wide as can be; half of it is under the plane.
        for (share, expected) in [(1.0, 0.146_446_6), (2.0, 0.276_393_2), (1e7, 0.5)] {
            let (far, top) = (1e7, share);
            let wall =
                [(1.0, -far, -5.0), (1.0, -far, top), (1.0, far, top), (1.0, far, -5.0)].map(DVec3::from);
            let found = occlusion(&wall, DVec3::Z);
            assert!((found - expected).abs() < 1e-5, "{found}, expected {expected}");
        }
    }

    #[test]
    fn inside_a_closed_box_everything_is_occluded() {
        let place = DVec3::new(0.3, -0.2, 0.1);
        for normal in [DVec3::Z, DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.48, 0.64, 0.6)] {
            let mut sum = 0.0;
            for axis in 0..3 {
                for side in [-1.0, 1.0] {
                    // The face towards the inside.
                    let corner = |s: f64, t: f64| {
                        let mut p = DVec3::ZERO;
                        (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, s, t);
                        p - place
                    };
                    let mut face =
                        [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
                    if side > 0.0 {
                        face.reverse();
                    }
                    sum += occlusion(&face, normal);
                }
            }
            near(sum, 1.0);
        }
    }

    #[test]
    fn falloff_goes_from_one_at_the_face_to_none_at_delta() {
        let at = |x: f64, h: f64| {
            let corners = [(-4.0, -4.0), (-4.0, 4.0), (4.0, 0.0)].map(|(a, b)| DVec3::new(a - x, b, h));
            falloff(corners, Volume { delta: 2.0, clamped: false })
        };
        near(at(0.0, 0.5), 0.75);
        near(at(0.0, 1.0), 0.5);
        // A millimetre beyond the edge x = -4: half of δ away.
        near(at(-5.0, 1.0), 0.25);
        assert_eq!((at(-6.0, 1.0), at(0.0, 2.0), at(0.0, -1.0), at(0.0, 1e-4)), (0.0, 0.0, 0.0, 0.0));
    }

    #[test]
    fn clamped_volumes_end_two_delta_from_corners_sharper_than_60_degrees() {
        // A corner at the origin of the plane, its edges 10 long, half its angle on either side of x; the place beyond it.
        let at = |angle: f64, beyond: f64, clamped| {
            let (sine, cosine) = (0.5 * angle.to_radians()).sin_cos();
            let corners = [(0.0, 0.0), (10.0 * cosine, 10.0 * sine), (10.0 * cosine, -10.0 * sine)];
            let corners = corners.map(|(x, y)| DVec3::new(x + beyond, y, 0.5));
            falloff(corners, Volume { delta: 1.0, clamped })
        };
        // How far corners reach: δ / sin of half the angle.
        for (angle, reach) in [(90.0, std::f64::consts::SQRT_2), (60.0, 2.0), (45.0, 2.613_126)] {
            for clamped in [false, true] {
                let end: f64 = if clamped { reach.min(CLAMP) } else { reach };
                let [within, beyond] = [0.999, 1.001].map(|share| at(angle, share * end, clamped));
                assert!(within > 0.0 && beyond == 0.0, "{angle}°, clamped {clamped}: {within}, {beyond}");
            }
        }
        // Where it is not cut nothing changes.
        assert_eq!(at(45.0, 1.9, true), at(45.0, 1.9, false));
    }
}
