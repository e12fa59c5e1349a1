//! Where the volume stands in the room, and the room as the volume's millimetres see it.
//!
//! ```text
//! p_room = T + R · (m · p_volume)        T in metres, R a rotation, m metres a millimetre of the volume
//! ```
//!
//! The runtime's space: metres, +y up, right-handed. The volume's: mm, its centre the origin, its index axes (`cao`'s conventions).

#![forbid(unsafe_code)]

use cao::glam::{Mat3, Quat, Vec3};
use cao::model::frame::Turn;
use cao::model::view::{Tangents, View};

/// A pose in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rigid {
    /// Metres.
    pub position: Vec3,
    /// From its own frame to the room's.
    pub orientation: Quat,
}

impl Rigid {
    /// The room's own frame.
    pub const IDENTITY: Self = Self { position: Vec3::ZERO, orientation: Quat::IDENTITY };

    /// What maps points of `inner`'s frame through this one.
    fn then(self, inner: Self) -> Self {
        Self {
            position: self.position + self.orientation * inner.position,
            orientation: (self.orientation * inner.orientation).normalize(),
        }
    }

    fn inverse(self) -> Self {
        let orientation = self.orientation.conjugate();
        Self { position: orientation * -self.position, orientation }
    }
}

/// The planes between which something is drawn, in metres from the eye.
pub const NEAR_M: f32 = 0.05;
/// Behind it nothing is drawn.
pub const FAR_M: f32 = 20.0;

/// Where the volume stands, and how large it is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// The volume's centre, and the rotation from its axes to the room's.
    pub pose: Rigid,
    /// Metres a millimetre of the volume: 0.001 is life size.
    pub metres: f32,
}

impl Placement {
    /// How far in front of the head the volume first stands, m.
    const AWAY_M: f32 = 0.7;
    /// How large its longest edge first is, m.
    const EDGE_M: f32 = 0.4;
    /// Bounds of that edge: a volume smaller or larger is lost.
    const EDGES_M: [f32; 2] = [0.02, 10.0];

    /// In front of a head, upright, level with it, its face towards it: superior is up, anterior towards the viewer, so that the
    /// patient's right is at the left. `turn` is how the volume's axes lie in the patient.
    pub fn in_front_of(head: Rigid, size_mm: [f64; 3], turn: Turn) -> Self {
        // Where the head looks, without its tilt; straight up or down there is no such direction.
        let ahead = (head.orientation * Vec3::NEG_Z).with_y(0.0).try_normalize().unwrap_or(Vec3::NEG_Z);
        let anterior = -ahead;
        // Columns: where right, anterior, superior of the patient go.
        let patient = Mat3::from_cols(anterior.cross(Vec3::Y), anterior, Vec3::Y);
        Self {
            pose: Rigid {
                position: head.position + ahead * Self::AWAY_M,
                orientation: (Quat::from_mat3(&patient) * turn.rotation().conjugate()).normalize(),
            },
            metres: Self::EDGE_M / longest(size_mm),
        }
    }

    /// A pose of the room in the volume's axes: mm, and the rotation to them.
    pub fn to_volume(&self, pose: Rigid) -> (Vec3, Quat) {
        let inside = self.pose.inverse().then(pose);
        (inside.position / self.metres, inside.orientation)
    }

    /// The eye with this pose and field of view, for the renderer. Depths are those of [`NEAR_M`] and [`FAR_M`].
    pub fn view(&self, eye: Rigid, tan: Tangents) -> View {
        let (position, orientation) = self.to_volume(eye);
        View {
            position,
            orientation,
            tan,
            near_mm: NEAR_M / self.metres,
            far_mm: FAR_M / self.metres,
            reversed: false,
        }
    }

    /// Larger by a factor, in bounds, around a point of the room that stays where it is in the volume.
    pub fn grown(&self, factor: f32, around: Vec3, size_mm: [f64; 3]) -> Self {
        let edge = longest(size_mm);
        let metres = (self.metres * factor).clamp(Self::EDGES_M[0] / edge, Self::EDGES_M[1] / edge);
        let position = around + (self.pose.position - around) * (metres / self.metres);
        Self { pose: Rigid { position, ..self.pose }, metres }
    }

    /// Carried by a hand that moved from one pose to another.
    pub fn carried(&self, from: Rigid, to: Rigid) -> Self {
        Self { pose: to.then(from.inverse()).then(self.pose), ..*self }
    }
}

fn longest(size_mm: [f64; 3]) -> f32 {
    size_mm.into_iter().fold(0.0, f64::max) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [f64; 3] = [100.0, 200.0, 50.0];

    /// f32 in metres and millimetres: a few roundings of numbers up to some thousand.
    const ROUNDING: f32 = 1e-3;

    fn head() -> Rigid {
        Rigid {
            position: Vec3::new(0.3, 1.6, -0.2),
            orientation: Quat::from_rotation_y(0.7) * Quat::from_rotation_x(-0.4),
        }
    }

    #[test]
    fn the_volume_first_stands_before_the_head_face_to_face() {
        let placed = Placement::in_front_of(head(), SIZE, Turn::NONE);
        let to_head = head().position - placed.pose.position;
        assert!((to_head.length() - Placement::AWAY_M).abs() < 1e-5 && to_head.y.abs() < 1e-5, "{to_head}");
        assert!((placed.metres * 200.0 - 0.4).abs() < 1e-6);
        // Superior is up, anterior towards the head, the patient's right at the viewer's left.
        assert!((placed.pose.orientation * Vec3::Z - Vec3::Y).length() < 1e-5);
        assert!((placed.pose.orientation * Vec3::Y).dot(to_head.normalize()) > 0.9999);
        let right_of_head = Quat::from_rotation_y(0.7) * Vec3::X;
        assert!((placed.pose.orientation * Vec3::X).dot(right_of_head) < -0.9999);
        // Looking straight down there is no horizontal direction, and there is a placement.
        let down = Rigid { orientation: Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2), ..head() };
        let placed = Placement::in_front_of(down, SIZE, Turn::NONE);
        assert!(placed.pose.orientation.is_normalized() && placed.pose.position.is_finite());
    }

    #[test]
    fn a_metre_is_a_thousand_millimetres_in_life_size() {
        let placed = Placement {
            pose: Rigid { position: Vec3::new(0.0, 1.0, -1.0), orientation: Quat::IDENTITY },
            metres: 0.001,
        };
        let (mm, turned) = placed.to_volume(Rigid { position: Vec3::new(0.1, 1.0, -1.0), ..Rigid::IDENTITY });
        assert!((mm - Vec3::new(100.0, 0.0, 0.0)).length() < ROUNDING && turned == Quat::IDENTITY);
    }

    #[test]
    fn a_point_of_the_volume_is_seen_where_it_is_in_the_room() {
        let placed = Placement::in_front_of(head(), SIZE, Turn::NONE);
        let tan = Tangents { left: -1.1, right: 0.9, up: 1.0, down: -1.2 };
        let eye = Rigid { position: head().position + Vec3::new(0.03, 0.0, 0.0), ..head() };
        let view = placed.view(eye, tan);
        view.check().unwrap();
        // The same point by both frames.
        let mm = Vec3::new(10.0, -20.0, 5.0);
        let room = placed.pose.position + placed.pose.orientation * (mm * placed.metres);
        let local = eye.orientation.conjugate() * (room - eye.position);
        let slope = local / -local.z;
        let expected =
            [(slope.x - tan.left) / (tan.right - tan.left), (tan.up - slope.y) / (tan.up - tan.down)];
        let (uv, depth) = view.project(mm).unwrap();
        assert!((uv.x - expected[0]).abs() < 1e-4 && (uv.y - expected[1]).abs() < 1e-4, "{uv} {expected:?}");
        // Depth is the room's between the planes in metres, which the runtime is told.
        let metres = FAR_M / (FAR_M - NEAR_M) * (1.0 - NEAR_M / -local.z);
        assert!((depth - metres).abs() < 1e-4, "{depth} {metres}");
    }

    #[test]
    fn growing_keeps_the_point_in_the_hand_and_its_bounds() {
        let placed = Placement::in_front_of(head(), SIZE, Turn::NONE);
        let hand = Rigid { position: Vec3::new(0.1, 1.2, -0.6), ..Rigid::IDENTITY };
        let (before, _) = placed.to_volume(hand);
        let grown = placed.grown(1.5, hand.position, SIZE);
        assert!((grown.to_volume(hand).0 - before).length() < ROUNDING);
        assert!((grown.metres / placed.metres - 1.5).abs() < 1e-5);
        assert!((placed.grown(1e9, hand.position, SIZE).metres * 200.0 - 10.0).abs() < 1e-4);
        assert!((placed.grown(1e-9, hand.position, SIZE).metres * 200.0 - 0.02).abs() < 1e-6);
    }

    #[test]
    fn a_carried_volume_keeps_its_place_in_the_hand() {
        let placed = Placement::in_front_of(head(), SIZE, Turn::NONE);
        let from = Rigid { position: Vec3::new(0.1, 1.2, -0.6), orientation: Quat::from_rotation_z(0.5) };
        let to = Rigid { position: Vec3::new(-0.4, 1.0, 0.6), orientation: Quat::from_rotation_x(2.0) };
        let carried = placed.carried(from, to);
        let ((a, u), (b, v)) = (placed.to_volume(from), carried.to_volume(to));
        assert!((a - b).length() < ROUNDING && u.angle_between(v) < 1e-3, "{a} {b}");
    }

    #[test]
    fn an_oblique_volume_stands_upright_as_its_patient_does() {
        let directions = Mat3::from_rotation_x(0.3).as_dmat3().to_cols_array_2d();
        let volume = cao::model::builtin::builtin("fruit", 8).unwrap();
        let volume = cao::Volume { directions, space: cao::model::volume::Space::Ras, ..volume };
        let placed = Placement::in_front_of(Rigid::IDENTITY, SIZE, Turn::into_axes_of(&volume));
        // The patient's superior, as a direction of the volume's axes.
        let superior = Mat3::from_rotation_x(0.3).transpose() * Vec3::Z;
        assert!((placed.pose.orientation * superior - Vec3::Y).length() < 1e-4);
    }
}
