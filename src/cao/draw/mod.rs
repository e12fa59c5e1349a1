//! Pictures: eyes, what there is to frame, ray cast, how far its rays may leap, bands of it, what a frame affords, where hosts want them, and where their own depth ends them.

pub mod band;
pub mod bounds;
pub mod brick_distance;
pub mod budget;
pub mod extent;
pub mod eyes;
pub mod filter;
pub mod picture;
pub mod present;
pub mod raycast;
pub mod scene_depth;
pub mod target;
