//! What methods are measured against.

pub mod overdraw;
pub mod reference;
pub mod ssao;
