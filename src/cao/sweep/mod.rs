//! Line sweeps with contextual updates from change.

pub mod carve;
pub mod near;
pub mod past;
#[expect(clippy::module_inception, reason = "named as its kernel")]
pub mod sweep;
pub mod sweep_list;
pub mod swept;
