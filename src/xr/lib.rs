//! A volume in an OpenXR headset: seen with both eyes from where the head is, clipped by what a hand holds.
//!
//! ```text
//! runtime ─ device (made through it, lent to `cao`) ─ session: [wait ─ begin ─ hands ─ update ─ acquire ─ late locate ─ draw ─ release ─ end]…
//! ```
//!
//! | module | what it is |
//! |---|---|
//! | [`placement`] | where the volume stands in the room; metres and millimetres. Knows no runtime |
//! | [`controls`] | what hands do to volume and clip. Knows no runtime |
//! | [`check`] | whether both eyes were shown the same thing. Knows no runtime |
//! | [`runtime`] [`device`] | the runtime and its headset; Vulkan as the runtime makes it |
//! | [`input`] [`target`] [`readback`] | controllers; the images that the compositor shows; what lies in them |
//! | [`session`] | states and frames |
//!
//! `docs/embedding/openxr.md` has the order of a frame, and what it was checked with.

pub mod check;
pub mod controls;
pub mod device;
pub mod input;
pub mod placement;
pub mod readback;
pub mod runtime;
pub mod session;
pub mod target;
