//! The plain data of `cao`: volumes, transfer functions, clips, views, ray sets, settings and the list of methods. Nothing here
//! touches a device or a file, but for the system's word on how much memory there is; lengths are mm, angles degrees, arrays `[x, y, z]` with x fastest in memory.

#![forbid(unsafe_code)]

pub mod builtin;
pub mod bvh;
pub mod clip;
pub mod error;
pub mod feature;
pub mod fit;
pub mod frame;
pub mod image_space;
pub mod light;
pub mod lit;
pub mod look;
pub mod memory;
pub mod mesh;
pub mod methods;
pub mod network;
pub mod occlusion;
pub mod options;
pub mod order;
pub mod pixel_occlusion;
pub mod samples;
pub mod scenes;
pub mod settings;
pub mod surface;
pub mod transfer;
pub mod values;
pub mod view;
pub mod volume;

pub use error::{Error, Result};
pub use methods::METHODS;

/// The version whose vectors are in this crate's signatures.
pub use glam;
