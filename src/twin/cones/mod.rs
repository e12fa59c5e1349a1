//! Cone tracing.

pub mod cone;
