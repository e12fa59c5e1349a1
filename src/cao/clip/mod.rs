//! Clips: depth layers and dilation maps of meshes, classification of bricks and voxels.

pub mod carve;
pub mod classify;
pub mod clip_bricks;
pub mod clips;
pub mod dilate;
pub mod pairs;
pub mod peel;
mod positions;
pub mod solid;
