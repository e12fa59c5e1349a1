//! Geometry from depths: what pixels show of a picture that has no normals.
//!
//! With a and b of the view's planes the view depth is `t = b / (depth − a)`. The change of position along the row is the shorter of the differences to the
//! two neighbours, for the other may cross an edge; along the column likewise; the normal is across both, towards the eye. What has no neighbours along
//! one of them faces the eye.

use super::shown::Shown;
use cao_model::view::View;
use glam::DVec3;

/// What a depth image shows: rows from the top.
pub fn first_hit(view: &View, size: [usize; 2], depth: &[f32]) -> Shown {
    let [a, b] = view.depth_terms().map(f64::from);
    let nothing = view.depth_of_nothing();
    let there = |d: f32| if view.reversed { d > nothing } else { d < nothing };
    let depths = depth.iter().map(|&d| there(d).then(|| (DVec3::ZERO, b / (f64::from(d) - a))));
    let flat = Shown::from_pixels(view, size, depths.collect());
    let pixels = (0..flat.len()).map(|i| {
        let (_, here) = flat.surface(i)?;
        let [x, y] = flat.column_row(i).map(|c| c as i64);
        let along = |dx: i64, dy: i64| {
            let at = |x, y| flat.pixel(x, y).and_then(|j| flat.surface(j)).map(|(_, place)| place);
            let ahead = at(x + dx, y + dy).map(|p| p - here);
            let behind = at(x - dx, y - dy).map(|p| here - p);
            match (ahead, behind) {
                (Some(a), Some(b)) => Some(if a.length() <= b.length() { a } else { b }),
                (a, b) => a.or(b),
            }
        };
        let away = here - view.position.as_dvec3();
        let across = along(1, 0).zip(along(0, 1)).and_then(|(u, v)| u.cross(v).try_normalize());
        let normal = across.unwrap_or(-away.normalize());
        Some((if normal.dot(away) > 0.0 { -normal } else { normal }, flat.depth(i)?))
    });
    Shown::from_pixels(view, size, pixels.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image_space::scenes::tests::{floor, view_from};
    use crate::image_space::scenes::{corner, nearest};
    use glam::Vec3;

    /// Normals are what f32 depths leave of them: 1e-7 of 2 … 1e5 mm of planes, in pixels of 0.8 mm at 500 mm.
    const ROUNDING: f64 = 0.02;

    #[test]
    fn depths_of_a_corner_have_its_normals_whichever_way_depth_goes() {
        for reversed in [false, true] {
            let view = View {
                near_mm: 50.0,
                far_mm: 2000.0,
                reversed,
                ..view_from(Vec3::new(400.0, 90.0, 300.0), 5.0)
            };
            let exact = Shown::of(&view, [48; 2], nearest(&corner(60.0, true)));
            let [a, b] = view.depth_terms();
            let depth: Vec<f32> = (0..exact.len())
                .map(|i| exact.depth(i).map_or(view.depth_of_nothing(), |t| a + b / t as f32))
                .collect();
            let found = first_hit(&view, exact.size, &depth);
            let mut seen = 0;
            for (i, position) in floor(&exact, 2) {
                let (normal, place) = found.surface(i).unwrap();
                assert!((place - position).length() < ROUNDING, "{place} {position}");
                // Farther from the edge than a pixel.
                if position.x > 2.0 {
                    assert!(normal.distance(DVec3::Z) < ROUNDING, "{reversed} {position}: {normal}");
                    seen += 1;
                }
            }
            assert!(seen > 200, "{seen}");
        }
    }

    #[test]
    fn a_pixel_alone_faces_the_eye_and_nothing_is_nothing() {
        let view = view_from(Vec3::new(0.0, 0.0, 100.0), 30.0);
        let mut depth = [1.0; 9];
        assert!((0..9).all(|i| first_hit(&view, [3; 2], &depth).depth(i).is_none()));
        depth[4] = 0.99;
        let (normal, _) = first_hit(&view, [3; 2], &depth).surface(4).unwrap();
        assert!(normal.distance(DVec3::Z) < 1e-6, "{normal}");
    }
}
