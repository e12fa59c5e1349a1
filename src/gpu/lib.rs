//! Vulkan and nothing else: device (our own, or a host's), memory, pipelines from reflected shaders, command recording with visible
//! barriers, timestamps, validation. Knows no volume and no method.
//!
//! ```text
//! Gpu::open ── buffer, image, sampler ──┐
//!     └────── compute, graphics ────────┤
//!     └────── recorder ── discard, barrier, dispatch, draw, copy ── submit_and_wait ── timings
//!     └────── record_into(host's command buffer) ── … ── finish ── timings, later
//! ```
//!
//! * Descriptors: one set, number 0, pushed with each command; hosts bind by the names in the WGSL,
//!   a struct of them for each entry point of a built-in kernel ([`Bindings`]).
//! * Images stay in the GENERAL layout from their first `discard` on.
//! * Every barrier is one line that names both sides from the table in [`Access`]; [`hazard`] refuses commands that lack one.
//! * Objects are freed when dropped, after the recorders that used them: a [`Recorder`] keeps what it refers to alive.
//! * What a device must have is the table in [`feature`].
//! * Safe functions refuse calls that Vulkan leaves undefined; what only a promise can rule out is `unsafe`: a host's handles, and code
//!   for the device with what it does on the numbers that it is given ([`Shader::new`]).

mod acceleration;
mod access;
mod bind;
mod buffer;
mod counts;
mod device;
mod draw;
pub mod error;
mod external;
pub mod feature;
mod format;
pub mod hazard;
mod idle;
mod image;
mod info;
mod memory;
mod pipeline;
mod recorder;
pub mod shader;
mod timing;
mod transfer;
mod validation;

pub use acceleration::{AccelerationStructure, Corners};
pub use access::Access;
pub use bind::{Bind, Bindings, Flat};
pub use buffer::{Buffer, BufferUse};
pub use counts::Counts;
pub use device::{Adopted, Gpu, OpenOptions};
pub use draw::Attachments;
pub use error::{Error, Result};
pub use external::{ImageState, Lent};
pub use format::Format;
pub use image::{Image, ImageDesc, ImageKind, ImageUse, Sampler, SamplerDesc};
pub use info::{DeviceInfo, DeviceKind};
pub use pipeline::{Blend, Cull, DepthTest, GraphicsDesc, Pipeline};
pub use recorder::Recorder;
pub use shader::Shader;
pub use timing::{Phase, Recorded, Stage, Timing, Timings};
pub use validation::ValidationLog;

/// The version whose handles are in this crate's signatures.
pub use ash;
