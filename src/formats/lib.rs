//! Files in and out: volumes ([`open`]), meshes ([`obj`]), transfer functions ([`transfer`]), scenes ([`scene`]), pictures
//! ([`picture`]). One reader a file; what a file says and what it should have said is named in every refusal.

#![forbid(unsafe_code)]

mod analyze;
#[cfg(feature = "dicom")]
mod dicom;
pub mod error;
mod foreign;
mod grid;
mod listing;
mod metaimage;
mod nifti;
mod nrrd;
pub mod obj;
mod payload;
pub mod picture;
mod raw;
pub mod scene;
mod text;
mod tiff_stack;
mod toml_value;
pub mod transfer;
pub mod volume;
mod write;

pub use error::{Error, Result};
pub use picture::Picture;
pub use raw::read_raw;
pub use scene::Scene;
pub use volume::{open, read, read_series};
pub use write::{write_atomic, write_nrrd};
