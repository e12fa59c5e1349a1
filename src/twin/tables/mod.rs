//! Summed-area tables and their boxes.

pub mod boxes;
pub mod sums;
