//! The method `vicinity`: vicinity shading.

pub mod shaded;
#[expect(clippy::module_inception, reason = "named as its kernel")]
pub mod vicinity;
