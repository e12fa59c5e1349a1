//! The frame of a picture, and the rotation between it and a volume.
//!
//! Clips, eyes and light are drawn on the index axes of a volume. Where a file states how its grid lies in the patient, and
//! the grid is oblique, a rotation is left between those axes and the patient's. It is applied to clips, eyes and light
//! before they reach a renderer, which knows nothing of it.

use crate::clip::{Clip, Pose};
use crate::light::AmbientLight;
use crate::look::{LightFrom, Look};
use crate::view::StereoRig;
use crate::volume::{Space, Volume};
use crate::{Error, Result};
use glam::{DMat3, DQuat, DVec3, EulerRot, Quat, Vec3};

/// What the axes x, y, z of clips, eyes and light are. The origin is the volume's centre, the unit mm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Frame {
    /// Right, anterior, superior of the patient; of a volume that states no patient frame, its index axes.
    #[default]
    Patient,
    /// The index axes in the order of the file, even where they are left-handed and the picture is a mirror image.
    Index,
}

impl Frame {
    /// `patient` or `index`.
    ///
    /// # Errors
    /// [`Error::Config`] for another name.
    pub fn parse(name: &str) -> Result<Self> {
        match name {
            "patient" => Ok(Self::Patient),
            "index" => Ok(Self::Index),
            _ => Err(Error::refused("frame", format!("\"{name}\"; expected patient or index"))),
        }
    }

    /// The volume in the order in which this frame has it drawn, and how clips, eyes and light get onto its axes.
    ///
    /// # Errors
    /// As [`Volume::into_canonical`].
    pub fn arrange(self, volume: Volume) -> Result<(Volume, Turn)> {
        Ok(match self {
            Self::Patient => {
                let volume = volume.into_canonical()?;
                let turn = Turn::into_axes_of(&volume);
                (volume, turn)
            }
            Self::Index => (volume.into_stored()?, Turn::NONE),
        })
    }
}

/// A rotation from a frame to the axes of a volume, both with their origin at its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn(DQuat);

/// Rotations by less, in radians, are what f32 leaves of none: 0.01 mm in a metre.
const NO_ANGLE: f64 = 1e-5;

impl Turn {
    /// None at all.
    pub const NONE: Self = Self(DQuat::IDENTITY);

    /// From the patient to the axes of this volume; none where the volume states no patient frame, or has left-handed axes
    /// ([`Volume::into_canonical`] makes them right-handed).
    pub fn into_axes_of(volume: &Volume) -> Self {
        let axes = DMat3::from_cols_array_2d(&volume.directions);
        if volume.space == Space::Unknown || axes.determinant() <= 0.0 {
            return Self::NONE;
        }
        let turn = DQuat::from_mat3(&axes).normalize().conjugate();
        if turn.is_finite() && turn.angle_between(DQuat::IDENTITY) > NO_ANGLE {
            Self(turn)
        } else {
            Self::NONE
        }
    }

    /// Its angle in degrees: how oblique the volume is.
    pub fn degrees(self) -> f64 {
        self.0.angle_between(DQuat::IDENTITY).to_degrees()
    }

    /// The rotation, for what an engine has of its own: eyes (position and orientation), directions.
    pub fn rotation(self) -> Quat {
        self.0.as_quat()
    }

    /// Extent in mm along the frame's axes of the box around a volume of this size.
    pub fn extent(self, size_mm: [f64; 3]) -> [f64; 3] {
        if self == Self::NONE {
            return size_mm;
        }
        let columns = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| (self.0.conjugate() * axis).abs());
        (columns[0] * size_mm[0] + columns[1] * size_mm[1] + columns[2] * size_mm[2]).to_array()
    }

    /// A point or a direction.
    pub fn vector(self, of: Vec3) -> Vec3 {
        if self == Self::NONE { of } else { (self.0 * of.as_dvec3()).as_vec3() }
    }

    /// A clip.
    pub fn clip(self, clip: &Clip) -> Clip {
        if self == Self::NONE {
            return clip.clone();
        }
        let [x, y, z] = clip.pose.rotate_deg.as_dvec3().to_array().map(f64::to_radians);
        let rotation = self.0 * DQuat::from_euler(EulerRot::ZYX, z, y, x);
        let (z, y, x) = rotation.to_euler(EulerRot::ZYX);
        let pose = Pose {
            translate_mm: self.vector(clip.pose.translate_mm),
            rotate_deg: DVec3::new(x, y, z).map(f64::to_degrees).as_vec3(),
            ..clip.pose
        };
        Clip { pose, ..clip.clone() }
    }

    /// Clips.
    pub fn clips(self, clips: &[Clip]) -> Vec<Clip> {
        clips.iter().map(|clip| self.clip(clip)).collect()
    }

    /// The eyes.
    pub fn rig(self, rig: &StereoRig) -> StereoRig {
        StereoRig {
            position: self.vector(rig.position),
            target: self.vector(rig.target),
            up: self.vector(rig.up),
            ..*rig
        }
    }

    /// The ambient light.
    pub fn ambient_light(self, light: &AmbientLight) -> AmbientLight {
        if self == Self::NONE { *light } else { light.turned(DMat3::from_quat(self.0)) }
    }

    /// The light; the head's is turned with the eyes.
    pub fn look(self, look: &Look) -> Look {
        match look.light_from {
            LightFrom::Head => *look,
            LightFrom::World => Look { light: self.vector(look.light), ..*look },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::Shape;
    use crate::values::Values;

    /// A volume whose index axes are those of `rotation`.
    fn oblique(rotation: DQuat) -> Volume {
        let directions = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| (rotation * axis).to_array());
        let volume = Volume::new([2, 3, 4], [1.0, 2.0, 3.0], Values::U8(vec![0; 24])).unwrap();
        Volume { space: Space::Ras, directions, ..volume }
    }

    #[test]
    fn a_turned_clip_hides_the_same_points_of_the_patient() {
        let mut state = 3_u32;
        let mut random = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1 << 24) as f32 * 2.0 - 1.0
        };
        let mut vector = || Vec3::new(random(), random(), random());
        for shape in Shape::ANALYTIC {
            for i in 0..50 {
                let rotation = DQuat::from_scaled_axis(vector().as_dvec3() * 3.0);
                let turn = Turn::into_axes_of(&oblique(rotation));
                // Every other one where angles about three axes are not unique.
                let y = if i % 2 == 0 { 90.0 } else { 180.0 * vector().x };
                let pose = Pose {
                    translate_mm: vector() * 3.0,
                    rotate_deg: vector().with_y(0.0) * 180.0 + Vec3::Y * y,
                    scale: vector() * 2.0 + 3.0,
                };
                let clip = Clip { pose, ..Clip::remove(shape.clone()) };
                let turned = turn.clip(&clip);
                for _ in 0..20 {
                    let patient = vector() * 8.0;
                    // Points so near to the surface that rounding decides are left out.
                    if clip.distance_to_hidden(patient).unwrap().abs() > 1e-3 {
                        assert_eq!(clip.hides(patient), turned.hides(turn.vector(patient)), "{pose:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn what_is_oblique_turns_back_and_what_is_not_stays_bit_for_bit() {
        let turn = Turn::into_axes_of(&oblique(DQuat::from_rotation_z(30_f64.to_radians())));
        assert!((turn.degrees() - 30.0).abs() < 1e-9);
        // The patient's right lies 30 degrees clockwise of the first index axis.
        let right = turn.vector(Vec3::X);
        assert!(right.distance(Vec3::new(30_f32.to_radians().cos(), -0.5, 0.0)) < 1e-6, "{right}");
        let [x, y, z] = turn.extent([2.0, 1.0, 5.0]);
        let (cos, sin) = (30_f64.to_radians().cos(), 0.5);
        let expected = DVec3::new(2.0 * cos + sin, 2.0 * sin + cos, 5.0);
        assert!(DVec3::new(x, y, z).distance(expected) < 1e-9, "{x} {y} {z}");

        for rotation in [DQuat::IDENTITY, DQuat::from_rotation_x(1e-6)] {
            assert_eq!(Turn::into_axes_of(&oblique(rotation)), Turn::NONE);
        }
        let unplaced = Volume { space: Space::Unknown, ..oblique(DQuat::from_rotation_z(1.0)) };
        assert_eq!(Turn::into_axes_of(&unplaced), Turn::NONE);
        let pose =
            Pose { translate_mm: Vec3::new(0.1, 0.2, 0.3), rotate_deg: Vec3::splat(0.7), ..Pose::default() };
        assert_eq!(Turn::NONE.clip(&Clip { pose, ..Clip::remove(Shape::Cone) }).pose, pose);
    }
}
