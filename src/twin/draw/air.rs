//! The ambient factor that a place of a ray shows: of the air in front of its surface.
//!
//! ```text
//! A(x) = Σ w V'    over the eight voxels round y = x + h g / max(|g|, least),   g = change of V_AO a length h at x
//! ```
//!
//! h is the smallest spacing, w linear weights; V' is V_AO, but of voxels that hold 1, as those do that need no value, what V_AO and g
//! at x make of y.

use crate::{Grid, blend, trilinear_clamped};
use cao_kernels::raycast as kernel;
use glam::DVec3;

/// A at index coordinates x.
pub fn ambient_at(grid: &Grid, ambient: &[f32], position: [f64; 3]) -> f64 {
    let (rise, out) = rise_of(grid, ambient, position);
    let risen = (trilinear_clamped(grid, ambient, position) + rise.dot(out)).min(1.0);
    blend(air_of(grid, ambient, position), |voxel| match grid.clamped(ambient, voxel) {
        value if value < 1.0 => value,
        _ => risen,
    })
}

/// Index coordinates y of the air in front of a place x.
pub fn air_of(grid: &Grid, ambient: &[f32], position: [f64; 3]) -> [f64; 3] {
    let (_, out) = rise_of(grid, ambient, position);
    std::array::from_fn(|axis| position[axis] + voxel_of(grid)[axis] * out[axis])
}

/// h in voxels along each axis.
fn voxel_of(grid: &Grid) -> [f64; 3] {
    grid.spacing.map(|spacing| grid.min_spacing() / spacing)
}

/// g, and the way to y in lengths h.
fn rise_of(grid: &Grid, ambient: &[f32], position: [f64; 3]) -> (DVec3, DVec3) {
    let rise = DVec3::from_array(std::array::from_fn(|axis| {
        let beside = |way: f64| {
            let mut place = position;
            place[axis] += way;
            trilinear_clamped(grid, ambient, place)
        };
        0.5 * voxel_of(grid)[axis] * (beside(1.0) - beside(-1.0))
    }));
    (rise, rise / rise.length().max(f64::from(kernel::LEAST_RISE)))
}
