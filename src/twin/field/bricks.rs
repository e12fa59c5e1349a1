//! Bricks of voxels, and which of them hold a voxel to compute (method.md §5: unchanged bricks cost nothing).

use crate::Grid;
use crate::cast::contextual::computed;

/// Voxels along an edge of a brick.
pub const EDGE: usize = cao_kernels::shared::bricks::BRICK as usize;

/// The bricks of a volume, as a grid of their own, x fastest; those at the upper ends may be cut short.
pub fn bricks(grid: &Grid) -> Grid {
    Grid { dims: grid.dims.map(|d| d.div_ceil(EDGE)), spacing: grid.spacing.map(|s| s * EDGE as f64) }
}

/// Indices of the bricks with a voxel whose ambient value has to be computed, ascending.
pub fn to_compute(grid: &Grid, mask: &[u8]) -> Vec<usize> {
    let bricks = bricks(grid);
    let mut marked = vec![false; bricks.len()];
    for i in 0..grid.len() {
        let voxel = grid.voxel(i);
        marked[bricks.index(voxel.map(|c| c / EDGE))] |= computed(grid, mask, voxel);
    }
    (0..bricks.len()).filter(|&brick| marked[brick]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::classify::{AFFECTED, CLIPPED, UNTOUCHED};

    const GRID: Grid = Grid { dims: [17, 8, 9], spacing: [1.0, 2.0, 0.5] };

    fn with(changes: &[([usize; 3], u8)], rest: u8) -> Vec<usize> {
        let mut mask = vec![rest; GRID.len()];
        changes.iter().for_each(|&(voxel, category)| mask[GRID.index(voxel)] = category);
        to_compute(&GRID, &mask)
    }

    #[test]
    fn bricks_cover_the_volume() {
        assert_eq!(bricks(&GRID).dims, [3, 1, 2]);
        assert_eq!(bricks(&Grid { dims: [1, 8, 16], ..GRID }).dims, [1, 1, 2]);
    }

    #[test]
    fn only_bricks_with_something_to_compute_are_listed_in_order() {
        assert!(with(&[], UNTOUCHED).is_empty());
        assert!(with(&[], CLIPPED).is_empty());
        assert_eq!(with(&[], AFFECTED), [0, 1, 2, 3, 4, 5]);
        assert_eq!(with(&[([16, 7, 8], AFFECTED), ([8, 0, 0], AFFECTED)], UNTOUCHED), [1, 5]);
    }

    /// A clipped voxel beside a visible one in the next brick is computed there.
    #[test]
    fn a_visible_voxel_calls_for_the_clipped_brick_beside_it() {
        assert_eq!(with(&[([7, 3, 3], UNTOUCHED)], CLIPPED), [0, 1]);
        assert_eq!(with(&[([6, 3, 3], UNTOUCHED)], CLIPPED), [0]);
        assert_eq!(with(&[([3, 3, 3], CLIPPED)], UNTOUCHED), [0]);
    }
}
