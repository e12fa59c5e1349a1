//! What methods are measured against.

pub mod reference;
pub mod ssao;
