//! Eyes: pose and field-of-view tangents as OpenXR gives them, the stereo rig of a scene file, and the insets of displays with
//! four views.

use crate::{Error, Result};
use glam::{Mat3, Mat4, Quat, Vec2, Vec3, Vec4};

/// Signed tangents of the four half-angles of an asymmetric field of view: left < right, down < up
/// (`tan(XrFovf)`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tangents {
    /// Left edge, usually negative.
    pub left: f32,
    /// Right edge.
    pub right: f32,
    /// Upper edge.
    pub up: f32,
    /// Lower edge, usually negative.
    pub down: f32,
}

/// One eye. Looks down −z of its frame, +y is up, +x is right; world is the volume's millimetre frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Position of the eye in mm.
    pub position: Vec3,
    /// Rotation from the eye's frame to the world.
    pub orientation: Quat,
    /// Field of view.
    pub tan: Tangents,
    /// Distance in mm of the plane of depth 0; nothing nearer is drawn.
    pub near_mm: f32,
    /// Distance in mm of the plane of depth 1, beyond which nothing is drawn; infinite where there is none.
    pub far_mm: f32,
    /// Depth falls from 1 at `near_mm` to 0 at `far_mm`, as engines have it whose depth is a float.
    pub reversed: bool,
}

impl View {
    /// Most views that are drawn at once: two eyes, and an inset for each.
    pub const MAX: usize = 4;

    /// The inset of this view around the middle of its field of view: the same pose, `share` (0 … 1) of the extent of each
    /// tangent, so that its pixels are `1 / share` times as dense.
    ///
    /// # Errors
    /// [`Error::Config`] for a share that leaves nothing or is larger than the view.
    pub fn inset(&self, share: f32) -> Result<Self> {
        if !(share > 0.0 && share <= 1.0) {
            return Err(Error::Config {
                what: "inset".into(),
                problem: format!("{share} of the field of view; expected 0 < share <= 1"),
            });
        }
        let t = self.tan;
        let within = |a: f32, b: f32| {
            let (middle, half) = (0.5 * (a + b), 0.5 * share * (b - a));
            (middle - half, middle + half)
        };
        let ((left, right), (down, up)) = (within(t.left, t.right), within(t.down, t.up));
        Ok(Self { tan: Tangents { left, right, up, down }, ..*self })
    }

    /// Refuses fields of view, planes and poses that no projection has.
    pub fn check(&self) -> Result<()> {
        let t = self.tan;
        let finite = [t.left, t.right, t.up, t.down, self.near_mm].iter().all(|v| v.is_finite());
        let refuse = |what: &str, problem: String| Err(Error::Config { what: what.into(), problem });
        if !finite || t.left >= t.right || t.down >= t.up {
            return refuse(
                "field of view",
                format!("{t:?}; expected finite tangents, left < right, down < up"),
            );
        }
        if !(self.near_mm > 0.0 && self.far_mm > self.near_mm) {
            let planes = format!("near {} mm, far {} mm; expected 0 < near < far", self.near_mm, self.far_mm);
            return refuse("clip planes", planes);
        }
        if !self.position.is_finite() || !self.orientation.is_finite() || !self.orientation.is_normalized() {
            return refuse("eye pose", "expected a finite position and a unit quaternion".into());
        }
        Ok(())
    }

    /// World → eye frame.
    pub fn view_matrix(&self) -> Mat4 {
        Mat4::from_rotation_translation(self.orientation, self.position).inverse()
    }

    /// Two numbers `[a, b]`: the depth of what is t mm away along the view axis is `a + b/t`.
    pub fn depth_terms(&self) -> [f32; 2] {
        let (n, f) = (self.near_mm, self.far_mm);
        // Quotients that are right where f is infinite.
        let (share, product) = (n / (f - n), n / (1.0 - n / f));
        if self.reversed { [-share, product] } else { [1.0 + share, -product] }
    }

    /// Depth of what is nowhere: 1, or 0 where depth is reversed.
    pub fn depth_of_nothing(&self) -> f32 {
        if self.reversed { 0.0 } else { 1.0 }
    }

    /// Eye frame → Vulkan clip space: y down, depth 0 at `near_mm`, 1 at `far_mm`, or reversed.
    pub fn projection(&self) -> Mat4 {
        let Tangents { left, right, up, down } = self.tan;
        let [a, b] = self.depth_terms();
        let (w, h) = (right - left, up - down);
        Mat4::from_cols(
            Vec4::new(2.0 / w, 0.0, 0.0, 0.0),
            Vec4::new(0.0, -2.0 / h, 0.0, 0.0),
            Vec4::new((right + left) / w, -(up + down) / h, -a, -1.0),
            Vec4::new(0.0, 0.0, b, 0.0),
        )
    }

    /// World → Vulkan clip space.
    pub fn view_projection(&self) -> Mat4 {
        self.projection() * self.view_matrix()
    }

    /// Ray through image coordinates `uv`, 0 … 1 each, origin at the top left: (eye position, direction whose
    /// component along the view axis is 1, so that its parameter is the depth in mm).
    pub fn ray(&self, uv: Vec2) -> (Vec3, Vec3) {
        let t = self.tan;
        let x = t.left + (t.right - t.left) * uv.x;
        let y = t.up + (t.down - t.up) * uv.y;
        (self.position, self.orientation * Vec3::new(x, y, -1.0))
    }

    /// Image coordinates, 0 … 1 each, and Vulkan depth of a world point; `None` behind the eye.
    pub fn project(&self, world: Vec3) -> Option<(Vec2, f32)> {
        let clip = self.view_projection() * world.extend(1.0);
        (clip.w > 0.0).then(|| (Vec2::new(clip.x / clip.w, clip.y / clip.w) * 0.5 + 0.5, clip.z / clip.w))
    }
}

/// Two eyes on a head that looks at a point, with parallel view axes and a shifted field of view each, so that the
/// screen plane has no parallax.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StereoRig {
    /// Midpoint between the eyes in mm.
    pub position: Vec3,
    /// Point that the head looks at in mm.
    pub target: Vec3,
    /// Approximate up direction.
    pub up: Vec3,
    /// Distance between the eyes in mm; 0 gives equal eyes.
    pub ipd_mm: f32,
    /// Vertical field of view in degrees.
    pub fov_deg: f32,
    /// Distance in mm of the plane without parallax; `None` is the distance to the target.
    pub screen_mm: Option<f32>,
}

/// The axes of a head that looks from a side.
pub(crate) struct Side {
    /// Away from what it looks at.
    pub back: Vec3,
    /// To its right.
    pub right: Vec3,
    /// Towards the upper edge of its picture.
    pub above: Vec3,
    /// Approximately that, along an axis.
    pub up: Vec3,
}

impl Side {
    /// From the given azimuth (about +z, from −y) and elevation in degrees.
    pub fn of(azimuth_deg: f32, elevation_deg: f32) -> Self {
        let (a, e) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
        let back = Vec3::new(a.sin() * e.cos(), -a.cos() * e.cos(), e.sin());
        let up = if elevation_deg.abs() > 89.0 { Vec3::Y } else { Vec3::Z };
        let right = up.cross(back).normalize();
        Self { back, right, above: back.cross(right), up }
    }
}

impl StereoRig {
    /// Vertical field of view in degrees where nobody asks for another.
    pub const FOV_DEG: f32 = 35.0;

    /// A comfortable distance of the eyes, as a share of that to what they look at.
    pub const PARALLAX: f32 = 1.0 / 15.0;

    /// A rig from whose place a volume of this size in mm just fits into a square picture, seen from the given azimuth
    /// (about +z, from −y) and elevation in degrees. The eyes' distance is 1/15 of the viewing distance, a comfortable parallax. To frame
    /// what is visible of it instead: [`Fitting`](crate::fit::Fitting).
    pub fn framing(size_mm: [f64; 3], azimuth_deg: f32, elevation_deg: f32) -> Self {
        let fov_deg = Self::FOV_DEG;
        let Side { back: from, right, above, up } = Side::of(azimuth_deg, elevation_deg);
        // Each corner of the volume asks for its distance; a twentieth is left free around them for the parallax.
        let half = Vec3::from_array(size_mm.map(|s| 0.5 * s as f32));
        let slope = (0.5 * fov_deg).to_radians().tan() / 1.05;
        let fit = |corner: u32| {
            let sign = |bit: u32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let p = half * Vec3::new(sign(0), sign(1), sign(2));
            p.dot(from) + p.dot(right).abs().max(p.dot(above).abs()) / slope
        };
        let distance = (0..8).map(fit).fold(0.0, f32::max);
        Self {
            position: from * distance,
            target: Vec3::ZERO,
            up,
            ipd_mm: distance * Self::PARALLAX,
            fov_deg,
            screen_mm: None,
        }
    }

    /// Left and right eye for images of this aspect (width / height).
    pub fn views(&self, aspect: f32, near_mm: f32, far_mm: f32) -> Result<[View; 2]> {
        let refuse = |what: &str, problem: String| Err(Error::Config { what: what.into(), problem });
        let ahead = self.target - self.position;
        let Some(back) = (-ahead).try_normalize() else {
            return refuse(
                "stereo.target",
                format!(
                    "{} is the eyes' own place {}, or as good as that; expected another point, nearer than 1e18 mm",
                    self.target, self.position
                ),
            );
        };
        if !(self.ipd_mm >= 0.0 && self.ipd_mm.is_finite()) {
            return refuse("stereo.ipd_mm", format!("{}; expected a length >= 0 mm", self.ipd_mm));
        }
        if !(self.fov_deg > 0.0 && self.fov_deg < 179.0) {
            return refuse("stereo.fov_deg", format!("{}; expected 0 < fov < 179 degrees", self.fov_deg));
        }
        let screen = self.screen_mm.unwrap_or(ahead.length());
        if !(screen > 0.0 && screen.is_finite()) {
            return refuse("stereo.screen_mm", format!("{screen}; expected a length > 0 mm"));
        }
        let right = self.up.normalize_or_zero().cross(back);
        if right.length() < 1e-4 {
            return refuse("stereo.up", format!("{} is the viewing direction; expected another", self.up));
        }
        let right = right.normalize();
        let orientation = Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back)).normalize();
        let up = (0.5 * self.fov_deg).to_radians().tan();
        let eye = |side: f32| {
            let shift = -side * 0.5 * self.ipd_mm / screen;
            let view = View {
                position: self.position + right * (side * 0.5 * self.ipd_mm),
                orientation,
                tan: Tangents { left: -up * aspect + shift, right: up * aspect + shift, up, down: -up },
                near_mm,
                far_mm,
                reversed: false,
            };
            view.check().map(|()| view)
        };
        Ok([eye(-1.0)?, eye(1.0)?])
    }
}

/// The four views of a display with an inset for each eye, in OpenXR's order (`XR_VARJO_quad_views`; in OpenXR 1.1
/// `XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO_WITH_FOVEATED_INSET`): left and right of `eyes`, then the inset of the left and of the
/// right. The insets take `share` of the field of view along each direction ([`View::inset`]).
///
/// # Errors
/// As [`View::inset`].
pub fn with_insets(eyes: [View; 2], share: f32) -> Result<[View; 4]> {
    let [left, right] = eyes;
    Ok([left, right, left.inset(share)?, right.inset(share)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rig() -> StereoRig {
        StereoRig::framing([100.0, 120.0, 80.0], 30.0, 20.0)
    }

    #[test]
    fn rays_and_projection_are_inverse() {
        for view in rig().views(1.2, 1.0, 1000.0).unwrap() {
            for uv in [Vec2::new(0.1, 0.2), Vec2::new(0.5, 0.5), Vec2::new(0.9, 0.7)] {
                let (origin, direction) = view.ray(uv);
                let (back, depth) = view.project(origin + direction * 200.0).unwrap();
                assert!((back - uv).length() < 1e-5);
                let expected = 1000.0 / 999.0 * (1.0 - 1.0 / 200.0);
                assert!((depth - expected).abs() < 1e-5, "{depth} {expected}");
            }
        }
    }

    #[test]
    fn depth_is_zero_at_near_and_one_at_far() {
        let view = rig().views(1.0, 2.0, 500.0).unwrap()[0];
        for (distance, depth) in [(2.0, 0.0), (500.0, 1.0)] {
            let (origin, direction) = view.ray(Vec2::splat(0.5));
            // Positions of a few hundred mm carry 3e-5 mm of f32 rounding, halved by the depth's slope at 2 mm.
            assert!((view.project(origin + direction * distance).unwrap().1 - depth).abs() < 5e-5);
        }
    }

    #[test]
    fn the_target_has_no_parallax_and_nearer_points_do() {
        let rig = rig();
        let [left, right] = rig.views(1.0, 1.0, 1000.0).unwrap();
        let at = |p: Vec3| (left.project(p).unwrap().0, right.project(p).unwrap().0);
        let (l, r) = at(rig.target);
        assert!((l - r).length() < 1e-5 && (l - Vec2::splat(0.5)).length() < 1e-5);
        let (l, r) = at(rig.target + (rig.position - rig.target) * 0.3);
        assert!(l.x > r.x + 1e-3, "a near point lies further right in the left eye");
    }

    #[test]
    fn framing_shows_all_corners_and_wastes_no_room() {
        for (azimuth, elevation) in [(0.0, 0.0), (30.0, 25.0), (200.0, -70.0), (10.0, 90.0)] {
            let size = [256.0, 200.0, 90.0];
            let rig = StereoRig { ipd_mm: 0.0, ..StereoRig::framing(size, azimuth, elevation) };
            let view = rig.views(1.0, 1.0, 1e5).unwrap()[0];
            let mut widest = 0.0_f32;
            for corner in 0..8 {
                let sign = |bit: u32| if corner >> bit & 1 == 1 { 0.5 } else { -0.5 };
                let p = Vec3::new(sign(0), sign(1), sign(2)) * Vec3::from_array(size.map(|s| s as f32));
                widest = widest.max((view.project(p).unwrap().0 - 0.5).abs().max_element());
            }
            assert!((0.47..0.48).contains(&widest), "{azimuth} {elevation}: {widest}");
        }
    }

    #[test]
    fn image_top_left_is_left_and_up() {
        let view = rig().views(1.0, 1.0, 1000.0).unwrap()[0];
        let (_, direction) = view.ray(Vec2::ZERO);
        let local = view.orientation.inverse() * direction;
        assert!(local.x < 0.0 && local.y > 0.0 && (local.z + 1.0).abs() < 1e-5);
    }

    #[test]
    fn an_inset_shows_the_middle_of_its_view_larger() {
        let eyes = rig().views(1.2, 1.0, 1000.0).unwrap();
        let views = with_insets(eyes, 0.4).unwrap();
        assert_eq!(views[..2], eyes);
        for (inset, outer) in [(views[2], views[0]), (views[3], views[1])] {
            assert_eq!((inset.position, inset.orientation), (outer.position, outer.orientation));
            for uv in [Vec2::splat(0.5), Vec2::new(0.35, 0.62)] {
                let (origin, direction) = outer.ray(uv);
                let (found, _) = inset.project(origin + direction * 200.0).unwrap();
                assert!((found - (0.5 + (uv - 0.5) / 0.4)).length() < 1e-4, "{uv} {found}");
            }
        }
        assert_eq!(eyes[0].inset(1.0).unwrap().projection(), eyes[0].projection());
        for share in [0.0, -0.5, 1.5, f32::NAN] {
            assert!(eyes[0].inset(share).unwrap_err().to_string().starts_with("inset"), "{share}");
        }
    }

    #[test]
    fn impossible_rigs_are_refused_by_name() {
        let rig = rig();
        for (bad, name) in [
            (StereoRig { target: rig.position, ..rig }, "stereo.target"),
            (StereoRig { ipd_mm: -1.0, ..rig }, "stereo.ipd_mm"),
            (StereoRig { fov_deg: 180.0, ..rig }, "stereo.fov_deg"),
            (StereoRig { up: rig.position, ..rig }, "stereo.up"),
        ] {
            assert!(bad.views(1.0, 1.0, 10.0).unwrap_err().to_string().starts_with(name));
        }
    }
}
