//! Occlusion of features, each by itself.

pub mod fdao;
