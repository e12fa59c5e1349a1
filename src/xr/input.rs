//! Hands: what the runtime calls an action, and what each kind of controller has for it.

#![forbid(unsafe_code)]

use crate::controls::Hand;
use crate::placement::Rigid;
use anyhow::Result;
use cao::glam::{Quat, Vec3};
use openxr as xr;

/// What each kind of controller has for trigger, squeeze and thumbstick; an empty name where it has nothing. All have `grip/pose`.
const PROFILES: [(&str, [&str; 3]); 5] = [
    ("khr/simple_controller", ["select/click", "menu/click", ""]),
    ("oculus/touch_controller", ["trigger/value", "squeeze/value", "thumbstick/y"]),
    ("valve/index_controller", ["trigger/value", "squeeze/value", "thumbstick/y"]),
    ("htc/vive_controller", ["trigger/value", "squeeze/click", "trackpad/y"]),
    ("microsoft/motion_controller", ["trigger/value", "squeeze/click", "thumbstick/y"]),
];

/// The left and the right hand.
const HANDS: [&str; 2] = ["/user/hand/left", "/user/hand/right"];

/// The actions of a session.
pub struct Input {
    set: xr::ActionSet,
    /// Trigger, squeeze, thumbstick.
    values: [xr::Action<f32>; 3],
    hands: [xr::Path; 2],
    grips: [xr::Space; 2],
}

impl Input {
    /// Makes the actions, suggests what they are on each kind of controller, and attaches them.
    ///
    /// # Errors
    /// The runtime's. A kind of controller that it does not know is left out.
    pub fn new(session: &xr::Session<xr::Vulkan>) -> Result<Self> {
        let instance = session.instance();
        let set = instance.create_action_set("cao", "Clip and volume", 0)?;
        let path = |text: String| instance.string_to_path(&text);
        let hands = [path(HANDS[0].into())?, path(HANDS[1].into())?];
        let pose = set.create_action::<xr::Posef>("grip", "Place of the hand", &hands)?;
        let values = [
            set.create_action::<f32>("shape", "Next shape, or take the clip", &hands)?,
            set.create_action::<f32>("carry", "Carry the volume", &hands)?,
            set.create_action::<f32>("scale", "Size of clip or volume", &hands)?,
        ];
        for (profile, inputs) in PROFILES {
            let mut bindings = Vec::new();
            for hand in HANDS {
                bindings.push(xr::Binding::new(&pose, path(format!("{hand}/input/grip/pose"))?));
                for (action, input) in values.iter().zip(inputs).filter(|(_, input)| !input.is_empty()) {
                    bindings.push(xr::Binding::new(action, path(format!("{hand}/input/{input}"))?));
                }
            }
            let profile = path(format!("/interaction_profiles/{profile}"))?;
            match instance.suggest_interaction_profile_bindings(profile, &bindings) {
                Err(xr::sys::Result::ERROR_PATH_UNSUPPORTED) => {}
                other => other?,
            }
        }
        session.attach_action_sets(&[&set])?;
        let space = |hand| pose.create_space(session, hand, xr::Posef::IDENTITY);
        let grips = [space(hands[0])?, space(hands[1])?];
        Ok(Self { set, values, hands, grips })
    }

    /// What the hands do; their places are those at a time, in a space.
    ///
    /// # Errors
    /// The runtime's.
    pub fn read(
        &self,
        session: &xr::Session<xr::Vulkan>,
        space: &xr::Space,
        time: xr::Time,
    ) -> Result<[Hand; 2]> {
        session.sync_actions(&[(&self.set).into()])?;
        let mut hands = [Hand::default(); 2];
        for (i, hand) in hands.iter_mut().enumerate() {
            let value =
                |action: &xr::Action<f32>| action.state(session, self.hands[i]).map(|s| s.current_state);
            let [trigger, squeeze, stick] = &self.values;
            *hand = Hand {
                grip: located(&self.grips[i].locate(space, time)?),
                trigger: value(trigger)?,
                squeeze: value(squeeze)?,
                stick: value(stick)?,
            };
        }
        Ok(hands)
    }
}

/// A pose of the runtime.
pub fn rigid(pose: xr::Posef) -> Rigid {
    let (p, q) = (pose.position, pose.orientation);
    Rigid { position: Vec3::new(p.x, p.y, p.z), orientation: Quat::from_xyzw(q.x, q.y, q.z, q.w).normalize() }
}

/// Where something is, if that is known.
pub fn located(location: &xr::SpaceLocation) -> Option<Rigid> {
    let known = xr::SpaceLocationFlags::POSITION_VALID | xr::SpaceLocationFlags::ORIENTATION_VALID;
    location.location_flags.contains(known).then(|| rigid(location.pose))
}
