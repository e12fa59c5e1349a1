//! Surfaces: what pixels show of them, their ambient occlusion by rays and by volumes, their light.

pub mod ambient;
pub mod gather;
pub mod gbuffer;
pub mod geometry;
pub mod light;
pub mod shares;
pub mod surfaces;
pub mod trace;
pub mod trace_queries;
pub mod upsample;
pub mod volumes;
