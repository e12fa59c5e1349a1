//! Tests of the Vulkan layer by itself, with kernels of their own.

mod acceleration;
mod device;
mod draw;
mod hazard;
mod resources;
mod shaders;
mod undefined;
