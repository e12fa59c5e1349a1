//! From the grid of a net to V_AO: its values around the middle of a voxel, interpolated, continued outside by the outermost.

use super::resize::Placed;
use crate::{Grid, each, trilinear_clamped};

/// V_AO of every voxel; 1 where none is needed: where neither the voxel nor a neighbour has opacity, unless `unneeded`.
pub fn output(grid: &Grid, opacity: &[f32], placed: &Placed, values: &[f32], unneeded: bool) -> Vec<f32> {
    let of = Grid { dims: placed.dims, spacing: [1.0; 3] };
    let solid = |voxel| opacity[grid.index(voxel)] > 0.0;
    each(grid.len(), |i| {
        let voxel = grid.voxel(i);
        if !(unneeded || solid(voxel) || grid.neighbours(voxel).any(solid)) {
            return 1.0;
        }
        trilinear_clamped(&of, values, placed.to_grid(voxel.map(|c| c as f64))) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_field_is_itself_within_the_grid_and_constant_outside() {
        let grid = Grid { dims: [8, 3, 2], spacing: [1.0; 3] };
        let placed = Placed::new(&grid, 2.0, 2);
        assert_eq!((placed.dims, placed.before), ([4, 2, 2], [0; 3]));
        let of = Grid { dims: placed.dims, spacing: [1.0; 3] };
        let values: Vec<f32> = (0..of.len()).map(|i| 0.1 * of.voxel(i)[0] as f32).collect();
        let found = output(&grid, &[1.0; 48], &placed, &values, false);
        // A quarter of the coarse voxel beside its middle; up to a quarter beyond the outermost middles.
        for (x, expected) in [0.0, 0.025, 0.075, 0.125, 0.175, 0.225, 0.275, 0.3].into_iter().enumerate() {
            assert!((found[x] - expected).abs() < 1e-6, "{x}: {}", found[x]);
        }
    }

    #[test]
    fn what_is_not_needed_is_one() {
        let grid = Grid { dims: [4, 1, 1], spacing: [1.0; 3] };
        let placed = Placed::new(&grid, 1.0, 1);
        let of = |unneeded| output(&grid, &[0.5, 0.0, 0.0, 0.0], &placed, &[0.25; 4], unneeded);
        assert_eq!((of(false), of(true)), (vec![0.25, 0.25, 1.0, 1.0], vec![0.25; 4]));
    }
}
