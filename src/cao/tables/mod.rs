//! Methods `sat` and `shells`: boxes of a summed-area table.

pub mod boxes;
pub mod summed;
pub mod sums;
