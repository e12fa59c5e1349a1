//! Volumes of mean opacities over cubes.

pub mod level;
pub mod tiles;
