//! Smooth probabilistic ambient occlusion.

pub mod product;
