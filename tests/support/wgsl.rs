//! WGSL compiled on the spot, and buffers of numbers for it.

use cao_compile::{Bounds, Options};
use cao_gpu::{Bind, Buffer, BufferUse, Gpu, Shader};
use cao_reflect as shader;

/// Compiles WGSL as the build does.
pub fn compile(wgsl: &str) -> &'static Shader {
    compile_with(wgsl, Options { bounds: Bounds::Unchecked, debug: false })
}

/// Compiles WGSL.
pub fn compile_with(wgsl: &str, options: Options) -> &'static Shader {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.wgsl");
    std::fs::write(&path, wgsl).unwrap();
    leak(cao_compile::file(folder.path(), &path, options).unwrap_or_else(|e| panic!("{e}")).shader)
}

/// The form that the library takes; its memory is never freed, as that of a built-in shader. Tests that hand over a lie look at what the
/// validation layer says of it.
#[allow(unsafe_code, reason = "tests bring kernels of their own")]
pub fn leak(shader: shader::Shader) -> &'static Shader {
    // SAFETY: what a test compiles is valid; where it lies on purpose, it asks for no more than the layer's complaint.
    Box::leak(Box::new(unsafe { Shader::new(shader) }))
}

/// A device buffer with these numbers in it.
pub fn device_buffer(gpu: &Gpu, name: &str, data: &[u32]) -> Buffer {
    let buffer = gpu.buffer(name, 4 * data.len() as u64, BufferUse::Device).unwrap();
    let mut rec = gpu.recorder("upload").unwrap();
    rec.update(&buffer, 0, bytemuck::cast_slice(data)).unwrap();
    rec.submit_and_wait().unwrap();
    buffer
}

/// All numbers of a device buffer.
pub fn read_back(gpu: &Gpu, buffer: &Buffer) -> Vec<u32> {
    let back = gpu.buffer("read back", buffer.bytes(), BufferUse::Readback).unwrap();
    let mut rec = gpu.recorder("read back").unwrap();
    rec.copy_buffer(buffer, 0, &back, 0, buffer.bytes()).unwrap();
    rec.submit_and_wait().unwrap();
    bytemuck::pod_collect_to_vec(&back.read(0, back.bytes()).unwrap())
}

/// Shorthand.
pub fn bind<'a>(name: &'a str, buffer: &'a Buffer) -> (&'a str, Bind<'a>) {
    (name, Bind::Buffer(buffer))
}
