//! Vicinity shading.

#[expect(clippy::module_inception, reason = "named as its kernel")]
pub mod vicinity;
