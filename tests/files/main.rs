//! Tests that need no device: files in and out, plain data, the kernels' compiler, the rules of the house.

// What the kernels' compiler emits says `crate::gpu`.
use cao_gpu as gpu;

mod builtin;
mod fuzz;
mod hostile;
mod house;
mod mesh;
mod orders;
mod outputs;
mod readings;
mod scene;
mod shaders;
mod transfer;
mod volume_files;
