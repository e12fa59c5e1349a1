//! A
pub mod check;
pub mod controls;
pub mod placement;
