//! Line sweeps.

pub mod carve;
pub mod near;
#[expect(clippy::module_inception, reason = "named as its kernel")]
pub mod sweep;
pub mod sweep_list;
