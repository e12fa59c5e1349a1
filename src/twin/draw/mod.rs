//! Pictures.

pub mod air;
pub mod bounds;
pub mod brick_distance;
pub mod clip_normal;
pub mod extent;
pub mod feature_colour;
pub mod raycast;
pub mod segment;
pub mod shading;
