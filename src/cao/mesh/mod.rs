//! Surfaces: what pixels show of them, and their ambient occlusion.

pub mod geometry;
