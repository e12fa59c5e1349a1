//! Pictures.

pub mod brick_distance;
pub mod extent;
pub mod raycast;
