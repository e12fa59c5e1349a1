//! Host sides of the kernels that only measurements use.

pub mod overdraw;
pub mod reference;
pub mod ssao;
