//! Cone tracing (docs/cones.md).

pub mod cone;
pub mod traced;
