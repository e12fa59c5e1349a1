//! The place from which what is visible fills the picture, exactly.
//!
//! With the side and the field of view given, an edge of the picture is a plane through the head whose direction is known. So all that
//! is asked of the scene is how far it reaches along the normals of these planes, its support function `h(d) = max d·p`.
//!
//! Let `r`, `u`, `k` be right, up and back of the head, `T` the target, `D` its distance from the head, and `κ = (p − T)·k` how much nearer
//! than the target a point `p` is. It is in the middle share `f` of a picture of half-width `t` and half-height `t′` (tangents) if
//!
//! ```text
//! ±(p − T)·r + κ f t  ≤ D f t          ±(p − T)·u + κ f t′ ≤ D f t′
//! ```
//!
//! The maximum over the scene of each is a support. Left and right touch where `T·r` is half the difference of theirs, and then
//! `D = sum / (2 f t)`; the larger distance of the two pairs counts, and the other pair has the same room on both sides, at its points'
//! own depths. `T·k` is the middle of nearest and farthest.
//!
//! The eyes' distance `b` is comfortable: a point `κ` nearer than the target has a disparity of `b / (D − κ) − b / D` against it, which
//! is largest for the nearest. `b` is the largest that keeps that to one degree, and at most 1/15 of `D`. An eye sees a point half of
//! that beside where the head would, 1.4 % of a picture with 35 degrees across: nothing is cut off, and what fills 85 % of the head's
//! picture fills 82 to 88 % of each eye's.

use crate::error::quoted;
use crate::view::{Side, StereoRig};
use crate::{Error, Result};
use glam::Vec3;

/// What the eyes' place follows from where the user names none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fit {
    /// What is visible, after clips.
    #[default]
    Visible,
    /// The volume's box, whatever is in it.
    Box,
}

impl Fit {
    /// `visible` or `box`.
    ///
    /// # Errors
    /// [`Error::Config`] for another name.
    pub fn parse(name: &str) -> Result<Self> {
        match name {
            "visible" => Ok(Self::Visible),
            "box" => Ok(Self::Box),
            _ => Err(Error::refused("fit", format!("{}; expected visible or box", quoted(name)))),
        }
    }
}

/// A side, a picture, and what the user wants of the eyes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fitting {
    /// Side in degrees about +z, from −y.
    pub azimuth_deg: f32,
    /// Height in degrees above the xy plane.
    pub elevation_deg: f32,
    /// Vertical field of view in degrees; `None` is [`StereoRig::FOV_DEG`] across the shorter side.
    pub fov_deg: Option<f32>,
    /// Width / height of the picture.
    pub aspect: f32,
    /// Distance from the target in mm; `None` is that from which the picture is filled.
    pub distance_mm: Option<f32>,
    /// Distance between the eyes in mm; `None` is comfortable where the distance from the target is ours too, and else 1/15 of it.
    pub ipd_mm: Option<f32>,
    /// Distance in mm of the plane without parallax; `None` is the target's. It moves whole pictures, which are fitted without it.
    pub screen_mm: Option<f32>,
}

impl Fitting {
    /// Share of the picture, along the direction in which it is tighter, that what is visible fills: with parallax and what a voxel at an
    /// edge is drawn wider or narrower, 80 to 90 %.
    pub const FILL: f32 = 0.85;

    /// Largest disparity of anything visible in degrees, against the plane of the target: what eyes fuse without effort.
    pub const DISPARITY_DEG: f32 = 1.0;

    /// Widest vertical field of view in degrees that a narrow picture makes.
    const WIDEST_DEG: f32 = 120.0;

    /// The rig. `reach` tells how far what is visible reaches along each of six directions, in mm from the origin; `None` where
    /// nothing is visible, and then there is no rig.
    pub fn rig<E>(
        &self,
        mut reach: impl FnMut(&[Vec3]) -> Result<Option<Vec<f32>>, E>,
    ) -> Result<Option<StereoRig>, E> {
        let Side { back, right, above, up } = Side::of(self.azimuth_deg, self.elevation_deg);
        let fov_deg = self.fov();
        let high = Self::FILL * (0.5 * fov_deg).to_radians().tan();
        let wide = high * self.aspect;
        let ways =
            [back * wide - right, back * wide + right, back * high - above, back * high + above, back, -back];
        let Some(found) = reach(&ways)? else { return Ok(None) };
        let [left, right_most, low, top, near, far] = std::array::from_fn(|i| found[i]);
        // Middles and halves of what two opposite edges hold between them.
        let depth = 0.5 * (near - far);
        let half = [left + right_most - 2.0 * depth * wide, low + top - 2.0 * depth * high, near + far]
            .map(|sum| 0.5 * sum);
        let target = right * (0.5 * (right_most - left)) + above * (0.5 * (top - low)) + back * depth;
        let distance = self.distance_mm.unwrap_or((half[0] / wide).max(half[1] / high));
        Ok(Some(StereoRig {
            position: target + back * distance,
            target,
            up,
            ipd_mm: self.ipd_mm.unwrap_or(distance * self.parallax(distance, half[2])),
            fov_deg,
            screen_mm: self.screen_mm,
        }))
    }

    fn fov(&self) -> f32 {
        self.fov_deg.unwrap_or_else(|| {
            let shorter = (0.5 * StereoRig::FOV_DEG).to_radians().tan();
            let fov = 2.0 * (shorter / self.aspect.min(1.0)).atan().to_degrees();
            fov.min(Self::WIDEST_DEG)
        })
    }

    /// Distance of the eyes as a share of the head's from the target, for a scene of which nothing is nearer than the target by more than
    /// `nearer`.
    fn parallax(&self, distance: f32, nearer: f32) -> f32 {
        if self.distance_mm.is_some() {
            return StereoRig::PARALLAX;
        }
        StereoRig::PARALLAX.min(Self::DISPARITY_DEG.to_radians() * (distance - nearer) / nearer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    /// Corners of two boxes beside each other, neither of them in the middle.
    fn points() -> Vec<Vec3> {
        let corner = |i: u32, at: Vec3, half: Vec3| {
            let sign = |bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            at + half * Vec3::new(sign(0), sign(1), sign(2))
        };
        (0..8)
            .flat_map(|i| {
                [
                    corner(i, Vec3::new(30.0, -12.0, 5.0), Vec3::new(10.0, 25.0, 6.0)),
                    corner(i, Vec3::new(10.0, 20.0, -15.0), Vec3::splat(4.0)),
                ]
            })
            .collect()
    }

    fn reach(points: &[Vec3], unit: f32) -> impl FnMut(&[Vec3]) -> Result<Option<Vec<f32>>, Infallible> {
        move |ways| {
            let along = |way: &Vec3| points.iter().map(|p| p.dot(*way) * unit).fold(f32::MIN, f32::max);
            Ok(Some(ways.iter().map(along).collect()))
        }
    }

    fn fitting(azimuth_deg: f32, elevation_deg: f32, aspect: f32) -> Fitting {
        let (distance_mm, ipd_mm, screen_mm) = (None, None, None);
        Fitting { azimuth_deg, elevation_deg, fov_deg: None, aspect, distance_mm, ipd_mm, screen_mm }
    }

    /// Lowest and highest image coordinate of points in a view, 0 … 1.
    fn rectangle(view: &crate::view::View, points: &[Vec3]) -> [glam::Vec2; 2] {
        let at = points.iter().map(|p| view.project(*p).unwrap().0);
        at.fold([glam::Vec2::MAX, glam::Vec2::MIN], |[low, high], p| [low.min(p), high.max(p)])
    }

    #[test]
    fn points_touch_the_edges_of_their_share_and_their_disparity_is_comfortable() {
        let points = points();
        for aspect in [1.0, 16.0 / 9.0, 9.0 / 16.0, 4.0] {
            for (azimuth, elevation) in [(0.0, 0.0), (30.0, 25.0), (-100.0, -60.0), (200.0, 90.0)] {
                let rig = fitting(azimuth, elevation, aspect).rig(reach(&points, 1.0)).unwrap().unwrap();
                let eyes = rig.views(aspect, 0.1, 1e4).unwrap();
                let [left, right] = eyes.each_ref().map(|eye| rectangle(eye, &points));
                let low = left[0].min(right[0]);
                let high = left[1].max(right[1]);
                let context = format!("{azimuth} {elevation} {aspect}: {low} {high}");
                // As the head sees it opposite edges are touched in the tighter direction, and the other is in the middle.
                let between = StereoRig { ipd_mm: 0.0, ..rig }.views(aspect, 0.1, 1e4).unwrap();
                let [low_between, high_between] = rectangle(&between[0], &points);
                let filled = (high_between - low_between).max_element();
                assert!((filled - Fitting::FILL).abs() < 1e-5, "{context}: {filled}");
                assert!(low_between.min_element() > 0.07499, "{context}");
                assert!(low.min_element() > 0.06 && high.max_element() < 0.94, "{context}");
                for eye in [left, right] {
                    let filled = (eye[1] - eye[0]).max_element();
                    assert!((0.82..0.88).contains(&filled), "{context}: {filled}");
                }
                let angle = |p: Vec3| {
                    let [a, b] = eyes.map(|eye| (p - eye.position).normalize());
                    a.cross(b).length().atan2(a.dot(b)).to_degrees()
                };
                let screen = angle(rig.target);
                let worst = points.iter().map(|p| (angle(*p) - screen).abs()).fold(0.0, f32::max);
                assert!(worst <= Fitting::DISPARITY_DEG, "{context}: {worst} degrees");
                // As far apart as that allows: at the picture's edges a disparity is less than that of its depth in the middle.
                let apart = rig.ipd_mm / (rig.position - rig.target).length();
                assert!(worst > 0.6 || apart > 0.999 / 15.0, "{context}: {worst} degrees, {apart}");
            }
        }
    }

    #[test]
    fn what_the_user_names_stays() {
        let given = Fitting { distance_mm: Some(300.0), ..fitting(90.0, 0.0, 1.0) };
        let rig = given.rig(reach(&points(), 1.0)).unwrap().unwrap();
        assert!((rig.position - rig.target - Vec3::X * 300.0).length() < 1e-3, "{rig:?}");
        assert!((rig.ipd_mm - 20.0).abs() < 1e-4, "{rig:?}");
        let given = Fitting { ipd_mm: Some(7.0), fov_deg: Some(60.0), ..fitting(90.0, 0.0, 1.0) };
        let rig = given.rig(reach(&points(), 1.0)).unwrap().unwrap();
        assert_eq!((rig.ipd_mm, rig.fov_deg), (7.0, 60.0));
        let [low, high] =
            rectangle(&StereoRig { ipd_mm: 0.0, ..rig }.views(1.0, 0.1, 1e4).unwrap()[0], &points());
        assert!(((high - low).max_element() - Fitting::FILL).abs() < 1e-5, "{low} {high}");
    }

    #[test]
    fn lengths_of_any_unit_give_the_same_place() {
        let one = fitting(30.0, 25.0, 1.3).rig(reach(&points(), 1.0)).unwrap().unwrap();
        for unit in [2.0_f32.powi(-29), 2.0_f32.powi(29)] {
            let rig = fitting(30.0, 25.0, 1.3).rig(reach(&points(), unit)).unwrap().unwrap();
            assert_eq!((rig.position / unit, rig.target / unit), (one.position, one.target));
            assert_eq!(rig.ipd_mm / unit, one.ipd_mm);
        }
        let nothing = |_: &[Vec3]| Ok::<_, Infallible>(None);
        assert_eq!(fitting(30.0, 25.0, 1.3).rig(nothing).unwrap(), None);
    }
}
