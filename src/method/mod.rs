//! Ambient occlusion methods, each on one page: dispatch, visible barrier, dispatch.

pub mod cao;
pub mod lao;
pub mod parts;
pub mod sweep;
pub mod trial;
pub mod volumes;
