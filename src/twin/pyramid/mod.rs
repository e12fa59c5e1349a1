//! Volumes of mean opacities over cubes.

pub mod level;
