//! Which tiles of a level an edit concerns, from the definition: those with a cell whose mean takes in a cell of a tile of the level before that
//! is concerned. Cell c is the mean of those at c stride + first and as much farther as `second`, along each axis.

use crate::Grid;

/// Cells along the edge of a tile.
pub const TILE: usize = 8;

/// Which cells a cell is the mean of.
#[derive(Clone, Copy, Debug)]
pub struct Means {
    /// Along each axis.
    pub stride: [i32; 3],
    /// Of cell 0.
    pub first: [i32; 3],
    /// From the first to the other.
    pub second: [i32; 3],
}

/// Tiles along each axis of so many cells.
pub fn tiles_of(dims: [usize; 3]) -> Grid {
    Grid { dims: dims.map(|n| n.div_ceil(TILE)), spacing: [1.0; 3] }
}

/// Of each tile of a level of `now` cells whether it is concerned, where `concerned` says so of those of a level of `before` cells.
pub fn tiles(before: [usize; 3], now: [usize; 3], means: Means, concerned: &[bool]) -> Vec<bool> {
    let (of_before, of_now) = (tiles_of(before), tiles_of(now));
    let cells = Grid { dims: now, spacing: [1.0; 3] };
    let mut found = vec![false; of_now.len()];
    for cell in (0..cells.len()).map(|i| cells.voxel(i)) {
        for corner in 0..8 {
            let place: [i32; 3] = std::array::from_fn(|i| {
                let farther = if corner >> i & 1 == 1 { means.second[i] } else { 0 };
                cell[i] as i32 * means.stride[i] + means.first[i] + farther
            });
            // Beyond them there is nothing that could change.
            if (0..3).all(|i| (0..before[i] as i32).contains(&place[i])) {
                let tile = of_before.index(place.map(|c| c as usize / TILE));
                found[of_now.index(cell.map(|c| c / TILE))] |= concerned[tile];
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_brick_goes_into_the_tiles_whose_means_reach_into_it() {
        let concerned = [false, false, true, false];
        let along = |stride, first, second, now| {
            let means = Means { stride: [stride, 1, 1], first: [first, 0, 0], second: [second, 0, 0] };
            tiles([32, 1, 1], [now, 1, 1], means, &concerned)
        };
        // Voxels 16 to 23. N-buffers: cells 16 to 23 by themselves, 8 to 15 by the voxel 8 farther.
        assert_eq!(along(1, 0, 8, 32), [false, true, true, false]);
        assert_eq!(along(1, 0, 1, 32), [false, true, true, false]);
        // With one cell before the volume's first.
        assert_eq!(along(1, -1, 1, 33), [false, false, true, true, false]);
        // Halved: cells 8 to 11.
        assert_eq!(along(2, 0, 1, 16), [false, true]);
    }
}
