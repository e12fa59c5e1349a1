//! Pictures.

pub mod brick_distance;
pub mod raycast;
pub mod segment;
pub mod shading;
