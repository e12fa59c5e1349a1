//! Smooth probabilistic ambient occlusion (docs/spao.md).

pub mod product;
pub mod shells;
