//! The ambient factor that a place of a ray shows: of the air in front of its surface.
//!
//! ```text
//! A(x) = Σ w V'    over the eight voxels round y = x + h g / max(|g|, least),   g = change of V_AO a length h at x
//! ```
//!
//! h is the smallest spacing, w linear weights; V' is V_AO, but of voxels that hold 1, as those do that need no value, what V_AO and g
//! at x make of y. In coloured light each of red, green and blue is so, but the way to y is along the change of their mean.

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

/// The same in coloured light: red, green and blue.
pub fn coloured_ambient_at(grid: &Grid, ambient: &[Vec<f32>; 3], position: [f64; 3]) -> [f64; 3] {
    let rise = ambient.each_ref().map(|channel| rise_of(grid, channel, position).0);
    let out = out_of(rise.iter().sum::<DVec3>() / 3.0);
    let air = std::array::from_fn(|axis| position[axis] + voxel_of(grid)[axis] * out[axis]);
    std::array::from_fn(|c| {
        let risen = (trilinear_clamped(grid, &ambient[c], position) + rise[c].dot(out)).min(1.0);
        blend(air, |voxel| match grid.clamped(&ambient[c], voxel) {
            value if value < 1.0 => value,
            _ => risen,
        })
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
    (rise, out_of(rise))
}

/// The way to y by g.
fn out_of(rise: DVec3) -> DVec3 {
    rise / rise.length().max(f64::from(kernel::LEAST_RISE))
}
