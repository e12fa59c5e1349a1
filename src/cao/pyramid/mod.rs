//! Volumes of mean opacities over cubes of 2^l voxels (SPAO §1.2.3), which several methods look up.

pub mod level;
pub mod levels;
pub mod plan;
pub mod tiles;
