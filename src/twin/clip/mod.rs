//! Clips: depth layers, dilation maps, classification.

pub mod carve;
pub mod classify;
pub mod clip_bricks;
pub mod clips;
pub mod dilate;
pub mod pairs;
pub mod peel;
pub mod solid;
