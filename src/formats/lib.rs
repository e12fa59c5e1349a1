//! Files in and out: volumes ([`open`]), clip meshes ([`obj`]), surfaces ([`surface`]), transfer functions ([`transfer`]), scenes ([`scene`]), pictures
//! ([`picture`]), weights of networks ([`network`]). One reader a file; what a file says and what it should have said is named in every refusal.

#![forbid(unsafe_code)]

mod analyze;
mod binary;
#[cfg(feature = "dicom")]
mod dicom;
pub mod error;
pub mod feature;
pub mod file;
mod foreign;
mod grid;
mod gzip;
pub mod input;
mod keys;
pub mod label;
mod light;
mod listing;
pub mod mesh_keys;
mod metaimage;
pub mod network;
mod nifti;
mod nrrd;
pub mod obj;
mod outputs;
mod parts;
mod payload;
pub mod picture;
mod polygon;
mod raw;
mod reading;
pub mod scene;
pub mod surface;
mod text;
mod tiff_stack;
mod toml_value;
pub mod transfer;
pub mod volume;
mod write;

pub use error::{Error, Result};
pub use outputs::{Output, Outputs, write_atomic};
pub use picture::{GrowingPng, Picture};
pub use raw::read_raw;
pub use reading::{NoNumbers, Opened, Reading};
pub use scene::Scene;
pub use volume::{open, read, read_as, read_series};
pub use write::write_nrrd;
