//! Rays by brick with contextual updates from change.

#[expect(clippy::module_inception, reason = "named as its kernel")]
pub mod rays;
pub(crate) mod ruled;
pub mod traced;
