//! Each kernel against its twin: one module a kernel, under its name.

mod bounds;
mod brick_distance;
mod bricks;
mod carve;
mod classify;
mod clip_bricks;
mod clipping;
mod cone;
mod dilate;
mod extent;
mod filter;
mod lao;
mod level;
mod near;
mod occupancy;
mod opacity;
mod pairs;
mod peel;
mod present;
mod product;
mod raycast;
mod rays;
mod reference;
mod shading;
mod ssao;
