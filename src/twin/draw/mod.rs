//! Pictures.

pub mod brick_distance;
pub mod clip_normal;
pub mod raycast;
pub mod segment;
pub mod shading;
