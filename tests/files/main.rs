//! Tests that need no device: files in and out, plain data, the kernels' compiler, the rules of the house.

// What the kernels' compiler emits says `crate::gpu`.
use cao_gpu as gpu;

mod builtin;
mod dicom;
mod house;
mod mesh;
mod places;
mod references;
mod scene;
mod shaders;
mod stacks;
mod transfer;
mod volume_files;
