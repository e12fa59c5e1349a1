//! Pictures: eyes, what there is to frame, ray cast, how far its rays may leap, attachments of hosts.

pub mod bounds;
pub mod brick_distance;
pub mod extent;
pub mod eyes;
pub mod filter;
pub mod picture;
pub mod present;
pub mod raycast;
