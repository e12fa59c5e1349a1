//! Tests that need no device: files in and out, plain data, the kernels' compiler, the rules of the house.

// What the kernels' compiler emits says `crate::gpu`.
use cao_gpu as gpu;

mod builtin;
mod dicom;
mod features;
mod fuzz;
mod gltf;
mod hostile;
mod house;
mod mesh;
mod mesh_keys;
mod network;
mod orders;
mod outputs;
mod places;
mod readings;
mod references;
mod scene;
mod shaders;
mod stacks;
mod surface;
mod transfer;
mod twin_network;
mod volume_files;
