//! Values to opacities, and what is known of whole bricks.

pub mod bricks;
pub mod features;
pub mod near;
pub mod occupancy;
pub mod opacity;
