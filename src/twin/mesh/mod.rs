//! Surfaces: ambient occlusion of points by triangles, exactly and by volumes; rays; what pixels show.

pub mod caps;
pub mod gather;
pub mod gbuffer;
pub mod light;
pub mod occluder;
pub mod ray;
pub mod shares;
pub mod trace;
pub mod upsample;
