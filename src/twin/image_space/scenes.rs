//! Scenes with answers that are known: parallelograms, met by rays exactly.

use glam::DVec3;

/// A parallelogram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    /// A corner in mm.
    pub corner: DVec3,
    /// From there to its two neighbours.
    pub sides: [DVec3; 2],
}

impl Sheet {
    /// Around a middle, so far to each side along two ways.
    pub fn around(middle: DVec3, half: [DVec3; 2]) -> Self {
        Self { corner: middle - half[0] - half[1], sides: half.map(|side| 2.0 * side) }
    }

    /// Its unit normal.
    pub fn normal(&self) -> DVec3 {
        self.sides[0].cross(self.sides[1]).normalize()
    }

    /// How far along a ray it is, in lengths of the direction.
    pub fn hit(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let [a, b] = self.sides;
        let normal = a.cross(b);
        let t = normal.dot(self.corner - origin) / normal.dot(direction);
        let from = origin + t * direction - self.corner;
        let whole = normal.length_squared();
        let u = from.cross(b).dot(normal) / whole;
        let v = a.cross(from).dot(normal) / whole;
        let inside = |share: f64| (0.0..=1.0).contains(&share);
        (t > 0.0 && inside(u) && inside(v)).then_some(t)
    }
}

/// The nearest of some sheets along a ray, and its normal.
pub fn nearest(sheets: &[Sheet]) -> impl Fn(DVec3, DVec3) -> Option<(f64, DVec3)> {
    move |origin, direction| {
        let hits = sheets.iter().filter_map(|s| s.hit(origin, direction).map(|t| (t, s.normal())));
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// A floor z = 0, x > 0, and if asked for a wall x = 0, z > 0, both so far to each side.
pub fn corner(far: f64, wall: bool) -> Vec<Sheet> {
    let [x, y, z] = DVec3::AXES.map(|axis| far * axis);
    let floor =
        Sheet { corner: if wall { -y } else { -x - y }, sides: [if wall { x } else { 2.0 * x }, 2.0 * y] };
    let upright = Sheet { corner: -y, sides: [2.0 * y, z] };
    if wall { vec![floor, upright] } else { vec![floor] }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::image_space::shown::Shown;
    use cao_model::view::{StereoRig, View};
    use glam::Vec3;

    /// A view of the origin from a place.
    pub fn view_from(position: Vec3, fov_deg: f32) -> View {
        let up = if position.x == 0.0 { Vec3::Y } else { Vec3::Z };
        let rig = StereoRig { position, target: Vec3::ZERO, up, ipd_mm: 0.0, fov_deg, screen_mm: None };
        rig.views(1.0, 1.0, 1e5).unwrap()[0]
    }

    /// The corner, or its floor alone, from so far along a direction, some 100 mm wide.
    pub fn shown(from: Vec3, wall: bool, pixels: usize) -> Shown {
        let view = view_from(2000.0 * from.normalize(), 2.8);
        Shown::of(&view, [pixels; 2], nearest(&corner(1000.0, wall)))
    }

    /// Pixels of the floor at least so many from the border.
    pub fn floor(shown: &Shown, border: usize) -> impl Iterator<Item = (usize, DVec3)> {
        (0..shown.len()).filter_map(move |i| {
            let [x, y] = shown.column_row(i);
            let inside = |at: usize, of: usize| at >= border && at + border < of;
            let (normal, position) = shown.surface(i)?;
            let is = normal.z > 0.99 && inside(x, shown.size[0]) && inside(y, shown.size[1]);
            is.then_some((i, position))
        })
    }

    #[test]
    fn rays_meet_sheets_where_they_are() {
        let sheet = Sheet::around(DVec3::new(0.0, 0.0, 2.0), [2.0 * DVec3::X, DVec3::new(0.0, 1.0, 1.0)]);
        let hit = |x, y| sheet.hit(DVec3::new(x, y, 0.0), DVec3::Z);
        assert_eq!(
            [hit(0.0, 0.0), hit(1.9, 0.5), hit(2.1, 0.0), hit(0.0, 1.1)],
            [Some(2.0), Some(2.5), None, None]
        );
        assert_eq!(sheet.hit(DVec3::ZERO, -DVec3::Z), None);
        let both = nearest(&[sheet, Sheet::around(DVec3::Z, [DVec3::X, DVec3::Y])])(DVec3::ZERO, DVec3::Z);
        assert_eq!(both, Some((1.0, DVec3::Z)));
    }

    #[test]
    fn places_and_positions_are_inverse() {
        let shown = shown(Vec3::new(1.0, -0.4, 0.8), true, 24);
        for i in 0..shown.len() {
            let (_, position) = shown.surface(i).unwrap();
            let (depth, pixel) = shown.place(position).unwrap();
            assert_eq!(pixel, i);
            assert!((depth - shown.depth(i).unwrap()).abs() < 1e-9);
        }
        // Behind the eye is nowhere.
        assert_eq!(shown.place(DVec3::new(4000.0, -1600.0, 3200.0)), None);
    }
}
