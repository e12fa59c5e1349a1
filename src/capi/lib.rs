//! The C interface of `cao`: what an engine in C, C++ or any language that calls C takes. `include/cao.h` is made of it
//! (`tools/capi header`); `docs/embedding/c.md` says how a host uses it.
//!
//! ```text
//! C ─ extern "C" fn ─ error::guard ─ edge: pointers, sizes, enums → plain data ─ handle: ids → objects ─ cao
//! ```
//!
//! * **Handles** are numbers that are never given out twice, in a table of the process. So a handle that was freed, never was, or is of
//!   another kind is refused, and the table is the only state beside the error callback. An object is freed once nobody is in a call with it.
//! * **Structs** begin with their size, by which a later version tells what an earlier one was compiled with.
//! * **Enums** come in as numbers and are checked: a number that is none of them is refused, not undefined.
//! * **Panics** end in `error::guard`, which every function runs in.
//!
//! Unsafe is what C cannot promise by types: that a pointer points to what the header says, and that Vulkan's handles are what they seem.

#![allow(
    clippy::missing_safety_doc,
    reason = "the header says once for all functions what pointers must be; each function says what is not that"
)]

pub mod device;
pub mod draw;
mod edge;
pub mod error;
pub mod features;
mod handle;
pub mod image;
pub mod recording;
pub mod renderer;
pub mod volume;

#[cfg(test)]
mod tests;

use std::ffi::c_char;

/// Changes where functions or structs change so that a host must be compiled again.
pub const CAO_ABI: u32 = 2;

/// The CAO_ABI that the library was built with; compare it with the header's.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_abi() -> u32 {
    CAO_ABI
}

/// The library's version, as "0.1.0". Alive as long as the library.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}
