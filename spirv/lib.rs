//! The kernels: a module each, named as its file, with its code and everything that hosts need to know of it. The WGSL says it, the build
//! emits it, nobody writes it twice.
//!
//! For a file `<room>/<stem>.wgsl`, module `<stem>` has
//!
//! * `SHADER`, for `Gpu::compute` and `Gpu::graphics`;
//! * its constants, under their names;
//! * its structs in buffers and immediates, under their names, padding written out; of one that ends in an array of run-time size, the part
//!   before it, and in `<MEMBER>_AT` how long that is;
//! * for each compute entry point `<ENTRY>_WORKGROUP` and `<Entry>Bindings`, for a vertex and fragment shader `DrawBindings`.
//!
//! What several kernels include is in [`shared`], and re-exported by each of them.

#![deny(unsafe_code)]
#![allow(clippy::approx_constant, reason = "a kernel's constants are the kernel's, digit by digit")]

use cao_gpu as gpu;

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
