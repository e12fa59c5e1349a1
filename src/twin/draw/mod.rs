//! Pictures.

pub mod bounds;
pub mod brick_distance;
pub mod extent;
pub mod raycast;
