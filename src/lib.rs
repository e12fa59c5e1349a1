//! Contextual ambient occlusion for volumes.

pub mod clip;
pub mod cpu;
pub mod error;
pub mod gpu;
pub mod measure;
pub mod mesh;
pub mod method;
pub mod occlusion;
pub mod picture;
pub mod renderer;
pub mod scene;
pub mod stage;
pub mod transfer;
pub mod view;
pub mod volume;

pub use error::{Error, Result};
