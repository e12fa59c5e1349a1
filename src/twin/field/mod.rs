//! Values to opacities, and what is known of whole bricks.

pub mod bricks;
pub mod occupancy;
pub mod opacity;
