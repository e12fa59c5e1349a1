//! The ambient factor that a place of a ray shows: of the air in front of its surface.
//!
//! ```text
//! A(x) = Σ w m V_AO / Σ w m    over the eight voxels round y = x + h g / max(|g|, least),   g = change of V_AO a length h at x
//! ```
//!
//! h is the smallest spacing, w linear weights; m is 0 where a voxel holds 1, as those do that need no value, else 1. Where all are
//! 0, A is 1.

use crate::{Grid, blend, trilinear_clamped};
use cao_kernels::raycast as kernel;
use glam::DVec3;

/// A at index coordinates x.
pub fn ambient_at(grid: &Grid, ambient: &[f32], position: [f64; 3]) -> f64 {
    let air = air_of(grid, ambient, position);
    let valued = |voxel: [i64; 3]| Some(grid.clamped(ambient, voxel)).filter(|value| *value < 1.0);
    let sum = blend(air, |voxel| valued(voxel).unwrap_or(0.0));
    let weight = blend(air, |voxel| valued(voxel).map_or(0.0, |_| 1.0));
    let least = f64::from(kernel::LEAST_WEIGHT);
    (sum + least) / (weight + least)
}

/// Index coordinates y of the air in front of a place x.
pub fn air_of(grid: &Grid, ambient: &[f32], position: [f64; 3]) -> [f64; 3] {
    let voxel: [f64; 3] = grid.spacing.map(|spacing| grid.min_spacing() / spacing);
    let rise: [f64; 3] = std::array::from_fn(|axis| {
        let beside = |way: f64| {
            let mut place = position;
            place[axis] += way;
            trilinear_clamped(grid, ambient, place)
        };
        0.5 * voxel[axis] * (beside(1.0) - beside(-1.0))
    });
    let length = DVec3::from_array(rise).length().max(f64::from(kernel::LEAST_RISE));
    std::array::from_fn(|axis| position[axis] + voxel[axis] * rise[axis] / length)
}
