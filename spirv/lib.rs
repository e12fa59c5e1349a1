//! The kernels of `cao`, compiled from the WGSL files beside this one, with their host-side interface.
//!
//! One module a kernel, named as its file; the build makes them, nothing is written by hand.

#![forbid(unsafe_code)]

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
