//! Rays by brick.

#[expect(clippy::module_inception, reason = "named as its kernel")]
pub mod rays;
