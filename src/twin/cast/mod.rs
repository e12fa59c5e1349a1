//! Rays cast from every voxel, and their contextual update.

pub mod contextual;
pub mod lao;
