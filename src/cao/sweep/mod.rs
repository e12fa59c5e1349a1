//! Line sweeps with contextual updates from change.

pub mod carve;
pub mod near;
pub mod past;
pub mod sweep;
pub mod sweep_list;
pub mod swept;
