//! Which steps of which tiles of lines hold a voxel to compute (method.md §4, sparse sweeps), by asking every voxel.
//!
//! A voxel x lies on the line that began at layer r of the walk's axis, r < |v_a|, and is reached after i steps:
//! x_a = r + i·|v_a| (from the other end where v_a < 0). Across the walk the line began at x − i·v, modulo the volume. Some lines of a layer
//! are a tile.

use cao_kernels::shared::sweep;
use std::collections::BTreeSet;

/// Lines of a tile along the two axes across a walk.
const TILE: [usize; 2] = [sweep::TILE[0] as usize, sweep::TILE[1] as usize];

/// Tiles, the first axis across the walk fastest, then the second, then layers; and in them steps from a line's first voxel on.
pub fn sweep_list(
    dims: [usize; 3],
    step: [i32; 3],
    axis: usize,
    todo: impl Fn([usize; 3]) -> bool,
) -> BTreeSet<(usize, usize)> {
    let stride = step[axis].unsigned_abs() as usize;
    let across: Vec<usize> = (0..3).filter(|&a| a != axis).collect();
    let mut found = BTreeSet::new();
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let voxel = [x, y, z];
                if !todo(voxel) {
                    continue;
                }
                let along = if step[axis] < 0 { dims[axis] - 1 - voxel[axis] } else { voxel[axis] };
                let (layer, i) = (along % stride, along / stride);
                let place = |a: usize| {
                    (voxel[a] as i64 - i as i64 * i64::from(step[a])).rem_euclid(dims[a] as i64) as usize
                };
                let tiles = dims[across[0]].div_ceil(TILE[0]);
                let rows = dims[across[1]].div_ceil(TILE[1]);
                let tile = (layer * rows + place(across[1]) / TILE[1]) * tiles + place(across[0]) / TILE[0];
                found.insert((tile, i));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_voxel_is_in_one_step() {
        let one = |at: [usize; 3]| move |voxel: [usize; 3]| voxel == at;
        let dims = [16, 10, 20];
        // Step 9 along z from (13 + 9, 5) mod (16, 10): place (6, 5).
        assert_eq!(
            sweep_list(dims, [-1, 0, 1], 2, one([13, 5, 9])).into_iter().collect::<Vec<_>>(),
            [(2, 9)]
        );
        // Two layers; 9 is in the second, at step 4; place (9, 5 - 4).
        assert_eq!(sweep_list(dims, [0, 1, 2], 2, one([9, 5, 9])).into_iter().collect::<Vec<_>>(), [(7, 4)]);
        assert!(sweep_list(dims, [1, 0, 0], 0, |_| false).is_empty());
        assert_eq!(sweep_list(dims, [1, 0, 0], 0, |_| true).len(), 2 * 5 * 16);
    }
}
