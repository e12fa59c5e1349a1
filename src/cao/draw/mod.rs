//! Pictures: eyes, ray cast, how far its rays may leap.

pub mod brick_distance;
pub mod eyes;
pub mod raycast;
