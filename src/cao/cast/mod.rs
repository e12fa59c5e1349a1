//! Rays cast by the sampler: local ambient occlusion, and its contextual update.

pub mod contextual;
pub mod full;
pub mod lao;
pub mod parts;
pub mod volumes;
