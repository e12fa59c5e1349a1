//! What hands do to the volume and to the clip, frame by frame; knows no runtime.
//!
//! In: for each hand where its grip is, and trigger, squeeze and thumbstick. Out: where the volume stands, and the clip.
//!
//! | of the hand that holds the clip | does |
//! |---|---|
//! | pose of the grip | is the clip's |
//! | trigger pulled | the next shape; by the other hand: that one holds the clip from now on |
//! | thumbstick up, down | the clip grows, shrinks |
//! | **of either hand** | |
//! | grip held | carries the volume |
//! | thumbstick, while it is held | the volume grows, shrinks around the hand |

#![forbid(unsafe_code)]

use crate::placement::{Placement, Rigid};
use cao::glam::{EulerRot, Quat, Vec3};
use cao::{Clip, Pose, Shape};

/// One hand in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hand {
    /// Where the grip is in the room; `None` while it is not tracked.
    pub grip: Option<Rigid>,
    /// 0 … 1.
    pub trigger: f32,
    /// 0 … 1.
    pub squeeze: f32,
    /// −1 … 1, up is positive.
    pub stick: f32,
}

/// An analogue value as a button. It is pressed above one value and released below another, so that a finger that trembles on the
/// threshold presses once.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Button {
    down: bool,
}

impl Button {
    const PRESS: f32 = 0.6;
    const RELEASE: f32 = 0.4;

    /// Whether it is pressed with this value and was not before.
    fn pressed(&mut self, value: f32) -> bool {
        let before = self.down;
        self.down = value > if before { Self::RELEASE } else { Self::PRESS };
        self.down && !before
    }
}

/// Frames in which the rehearsed hand makes the clip larger, eight times: from a hand at rest it reaches into what is before the head.
const GROWING: u64 = 42;
/// Frames in which it pulls the trigger.
const PULLS: [u64; 2] = [60, 80];

/// Seconds between two frames of a rehearsal, however long they took: it is the same everywhere.
pub const REHEARSED_S: f32 = 0.05;

/// What the right hand does in a check, where no finger moves: it makes the clip larger, then goes through shapes. Its place is the
/// runtime's.
pub fn rehearsed([left, right]: [Hand; 2], frame: u64) -> [Hand; 2] {
    let stick = if frame < GROWING { 1.0 } else { 0.0 };
    let trigger = if PULLS.contains(&frame) { 1.0 } else { 0.0 };
    [left, Hand { stick, trigger, ..right }]
}

/// The shapes, in the order in which the trigger goes through them.
const SHAPES: [Shape; 6] =
    [Shape::Sphere, Shape::Box, Shape::Cylinder, Shape::Cone, Shape::Torus, Shape::Plane];

/// How the clip is first held: in the right hand.
const RIGHT: usize = 1;

/// State from frame to frame.
#[derive(Clone, Debug)]
pub struct Controls {
    /// Where the volume stands.
    pub placement: Placement,
    size_mm: [f64; 3],
    shape: usize,
    /// Scale of the clip in the room: it stays as large in the hand when the volume grows.
    radius_m: f32,
    /// The hand that holds the clip.
    tool: usize,
    triggers: [Button; 2],
    squeezes: [Button; 2],
    /// The hand that carries the volume.
    carrier: Option<usize>,
    /// Where each grip was last tracked.
    grips: [Option<Rigid>; 2],
}

impl Controls {
    /// A clip as large as a peach at first.
    const RADIUS_M: f32 = 0.05;
    /// Bounds of its scale in the room.
    const RADII_M: [f32; 2] = [0.002, 1.0];
    /// Thumbsticks do not rest at 0.
    const DEAD: f32 = 0.15;
    /// Pushed fully, e times as large in a second.
    const GROWTH: f32 = 1.0;
    /// Longer frames are pauses: a headset taken off must not make the clip huge.
    const LONGEST_S: f32 = 0.1;

    /// With the volume where it first stands.
    pub fn new(placement: Placement, size_mm: [f64; 3]) -> Self {
        Self {
            placement,
            size_mm,
            shape: 0,
            radius_m: Self::RADIUS_M,
            tool: RIGHT,
            triggers: Default::default(),
            squeezes: Default::default(),
            carrier: None,
            grips: [None; 2],
        }
    }

    /// What the left and the right hand do in a frame that follows the one before after so many seconds.
    pub fn step(&mut self, hands: &[Hand; 2], seconds: f32) {
        let before = self.grips;
        for (i, hand) in hands.iter().enumerate() {
            self.grips[i] = hand.grip.or(before[i]);
            if self.triggers[i].pressed(hand.trigger) {
                match i == self.tool {
                    true => self.shape = (self.shape + 1) % SHAPES.len(),
                    false => self.tool = i,
                }
            }
            // The hand that took it last carries it.
            if self.squeezes[i].pressed(hand.squeeze) && hand.grip.is_some() {
                self.carrier = Some(i);
            }
        }
        self.carrier = self.carrier.filter(|&i| self.squeezes[i].down);
        if let Some((from, to)) = self.carrier.and_then(|i| Some((before[i]?, self.grips[i]?))) {
            self.placement = self.placement.carried(from, to);
        }
        for (i, hand) in hands.iter().enumerate() {
            let factor = growth(hand.stick, seconds);
            match self.grips[i].filter(|_| self.carrier == Some(i)) {
                Some(grip) => {
                    self.placement = self.placement.grown(factor, grip.position, self.size_mm);
                }
                None if i == self.tool => {
                    self.radius_m = (self.radius_m * factor).clamp(Self::RADII_M[0], Self::RADII_M[1]);
                }
                None => {}
            }
        }
    }

    /// The clip, in the volume's millimetres; none before its hand was seen.
    pub fn clip(&self) -> Option<Clip> {
        let (translate_mm, turned) = self.placement.to_volume(self.grips[self.tool]?);
        let pose = Pose {
            translate_mm,
            rotate_deg: degrees(turned),
            scale: Vec3::splat(self.radius_m / self.placement.metres),
        };
        Some(Clip { pose, ..Clip::remove(SHAPES[self.shape].clone()) })
    }
}

/// How many times as large a thumbstick makes something in a frame.
fn growth(stick: f32, seconds: f32) -> f32 {
    let push = if stick.abs() > Controls::DEAD { stick.clamp(-1.0, 1.0) } else { 0.0 };
    (push * Controls::GROWTH * seconds.clamp(0.0, Controls::LONGEST_S)).exp()
}

/// Degrees about the fixed axes x, then y, then z ([`Pose::rotate_deg`]).
fn degrees(turned: Quat) -> Vec3 {
    let (z, y, x) = turned.to_euler(EulerRot::ZYX);
    Vec3::new(x, y, z).map(f32::to_degrees)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [f64; 3] = [100.0; 3];
    /// A frame at 100 Hz.
    const FRAME: f32 = 0.01;

    fn at(x: f32) -> Option<Rigid> {
        Some(Rigid { position: Vec3::new(x, 1.0, -1.0), ..Rigid::IDENTITY })
    }

    /// Life size, one metre in front of the origin.
    fn controls() -> Controls {
        let pose = Rigid { position: Vec3::new(0.0, 1.0, -1.0), ..Rigid::IDENTITY };
        Controls::new(Placement { pose, metres: 0.001 }, SIZE)
    }

    fn right(hand: Hand) -> [Hand; 2] {
        [Hand::default(), hand]
    }

    #[test]
    fn the_clip_is_where_the_grip_is() {
        let mut c = controls();
        c.step(&right(Hand::default()), FRAME);
        assert!(c.clip().is_none(), "no hand was seen");
        let turned = Quat::from_euler(EulerRot::ZYX, 0.3, -0.8, 1.9);
        let grip = Rigid { position: Vec3::new(0.02, 1.01, -1.0), orientation: turned };
        c.step(&right(Hand { grip: Some(grip), ..Hand::default() }), FRAME);
        let pose = c.clip().unwrap().pose;
        assert!((pose.translate_mm - Vec3::new(20.0, 10.0, 0.0)).length() < 1e-3, "{pose:?}");
        assert!((pose.scale - 50.0).abs().max_element() < 1e-3);
        let found = Quat::from_mat3(&pose.rotation());
        assert!(found.angle_between(turned) < 1e-3, "the pose's three angles are the grip's rotation");
        // A lost hand leaves the clip where it was.
        c.step(&right(Hand::default()), FRAME);
        assert_eq!(c.clip().unwrap().pose, pose);
    }

    #[test]
    fn a_pull_of_the_trigger_is_one_change_of_shape() {
        let mut c = controls();
        let mut names = Vec::new();
        for trigger in [0.0, 0.5, 0.7, 0.55, 0.65, 1.0, 0.3, 0.5, 0.3, 0.9] {
            c.step(&right(Hand { grip: at(0.0), trigger, ..Hand::default() }), FRAME);
            names.push(c.clip().unwrap().shape.name().to_owned());
        }
        // Trembling between release and press changes nothing.
        let expected = ["sphere", "sphere", "box", "box", "box", "box", "box", "box", "box", "cylinder"];
        assert_eq!(names, expected);
        for _ in 0..SHAPES.len() {
            for trigger in [0.0, 1.0] {
                c.step(&right(Hand { grip: at(0.0), trigger, ..Hand::default() }), FRAME);
            }
        }
        assert_eq!(c.clip().unwrap().shape.name(), "cylinder", "all shapes come round");
    }

    #[test]
    fn the_other_hands_trigger_takes_the_clip_over() {
        let mut c = controls();
        let hands = |trigger| {
            [Hand { grip: at(-0.03), trigger, ..Hand::default() }, Hand { grip: at(0.03), ..Hand::default() }]
        };
        c.step(&hands(0.0), FRAME);
        assert!(c.clip().unwrap().pose.translate_mm.x > 0.0);
        c.step(&hands(1.0), FRAME);
        let clip = c.clip().unwrap();
        assert!(clip.pose.translate_mm.x < 0.0 && clip.shape.name() == "sphere");
    }

    #[test]
    fn the_thumbstick_scales_the_clip_in_bounds() {
        let mut c = controls();
        let push = |c: &mut Controls, stick, frames, seconds| {
            for _ in 0..frames {
                c.step(&right(Hand { grip: at(0.0), stick, ..Hand::default() }), seconds);
            }
            c.clip().unwrap().pose.scale.x
        };
        assert!((push(&mut c, 0.1, 10, FRAME) - 50.0).abs() < 1e-3, "a stick at rest");
        let grown = push(&mut c, 1.0, 100, FRAME);
        assert!((grown / 50.0 - std::f32::consts::E).abs() < 1e-2, "{grown}");
        assert!((push(&mut c, -1.0, 100, FRAME) - 50.0).abs() < 0.1, "down undoes up");
        assert!((push(&mut c, 1.0, 1, 3600.0) - 50.0 * 0.1_f32.exp()).abs() < 0.1, "a pause is no frame");
        assert!((push(&mut c, 1.0, 10_000, FRAME) - 1000.0).abs() < 0.1);
        assert!((push(&mut c, -1.0, 10_000, FRAME) - 2.0).abs() < 1e-3);
        assert!(c.clip().unwrap().check(50.0).is_ok(), "the smallest is a clip still");
    }

    #[test]
    fn the_rehearsal_ends_with_a_large_clip_of_another_shape() {
        let mut c = controls();
        for frame in 0..100 {
            c.step(&rehearsed(right(Hand { grip: at(0.0), ..Hand::default() }), frame), REHEARSED_S);
        }
        let clip = c.clip().unwrap();
        assert_eq!(clip.shape.name(), "cylinder");
        assert!((clip.pose.scale.x - 50.0 * 2.1_f32.exp()).abs() < 1.0, "{:?}", clip.pose);
    }

    #[test]
    fn the_grip_carries_the_volume_and_its_stick_scales_it() {
        let mut c = controls();
        let start = c.placement;
        c.step(&right(Hand { grip: at(0.0), ..Hand::default() }), FRAME);
        c.step(&right(Hand { grip: at(0.1), ..Hand::default() }), FRAME);
        assert_eq!(c.placement, start, "an open hand moves nothing");
        // The hand moves into the frame in which it closes: the volume comes along from there on.
        let held = |x| right(Hand { grip: at(x), squeeze: 1.0, ..Hand::default() });
        c.step(&held(0.1), FRAME);
        c.step(&held(0.4), FRAME);
        assert!((c.placement.pose.position.x - 0.3).abs() < 1e-5, "{:?}", c.placement);
        let radius = c.radius_m;
        let grows = right(Hand { grip: at(0.4), squeeze: 1.0, stick: 1.0, ..Hand::default() });
        c.step(&grows, FRAME);
        assert!(c.placement.metres > 0.001 && c.radius_m == radius, "the volume grows and the clip does not");
        let released = right(Hand { grip: at(9.0), ..Hand::default() });
        let left_there = c.placement;
        c.step(&released, FRAME);
        assert_eq!(c.placement, left_there);
        // A hand that is not tracked takes nothing.
        c.step(&right(Hand { squeeze: 1.0, ..Hand::default() }), FRAME);
        assert_eq!(c.carrier, None);
    }
}
