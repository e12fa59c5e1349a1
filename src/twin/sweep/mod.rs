//! Line sweeps.

pub mod carve;
pub mod near;
pub mod sweep;
pub mod sweep_list;
