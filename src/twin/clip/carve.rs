//! Stored opacity, where a brick's opacity lies, and which bricks an edit changed (method.md §5.2).

use crate::Grid;
use crate::field::bricks::{EDGE, bricks};
use cao_kernels::shared::parts::PARTS;

/// Opacity to 1/65535, as the device stores it.
pub fn stored(opacity: f32) -> u16 {
    (f64::from(opacity) * f64::from(PARTS)).round() as u16
}

/// For each brick of [`bricks`], x fastest, a bit for each of the 27 bricks at `(dx, dy, dz)` from it, its own included:
/// `(dx+1) + 3(dy+1) + 9(dz+1)` is set if a voxel with opacity in it is, or has as a neighbour's place, a voxel of that brick.
pub fn contact(grid: &Grid, opacity: &[u16]) -> Vec<u32> {
    let all = bricks(grid);
    let mut bits = vec![0; all.len()];
    for i in (0..grid.len()).filter(|&i| opacity[i] > 0) {
        let voxel = grid.voxel(i).map(|c| c as i64);
        let own = voxel.map(|c| c / EDGE as i64);
        for n in 0..27 {
            // Places outside the volume count: no brick is there to ask.
            let place: [i64; 3] =
                std::array::from_fn(|axis| voxel[axis] + [n % 3, n / 3 % 3, n / 9][axis] - 1);
            let other = place.map(|c| c.div_euclid(EDGE as i64));
            let bit: i64 = (0..3).map(|axis| (other[axis] - own[axis] + 1) * [1, 3, 9][axis]).sum();
            bits[all.index(own.map(|c| c as usize))] |= 1 << bit;
        }
    }
    bits
}

/// Whether a stored opacity of each brick differs.
pub fn changed(grid: &Grid, before: &[u16], after: &[u16]) -> Vec<bool> {
    let all = bricks(grid);
    let mut changed = vec![false; all.len()];
    for i in (0..grid.len()).filter(|&i| before[i] != after[i]) {
        changed[all.index(grid.voxel(i).map(|c| c / EDGE))] = true;
    }
    changed
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { dims: [17, 8, 9], spacing: [1.0; 3] };

    fn with(voxel: [usize; 3]) -> Vec<u16> {
        let mut opacity = vec![0; GRID.len()];
        opacity[GRID.index(voxel)] = 1;
        opacity
    }

    #[test]
    fn a_voxel_inside_touches_its_own_brick_only_and_a_corner_eight() {
        assert_eq!(contact(&GRID, &with([3, 3, 3])), [1 << 13, 0, 0, 0, 0, 0]);
        let corner = contact(&GRID, &with([7, 7, 7]))[0];
        assert_eq!(corner.count_ones(), 8);
        assert_eq!(corner, [13, 14, 16, 17, 22, 23, 25, 26].into_iter().map(|bit| 1 << bit).sum::<u32>());
        assert_eq!(contact(&GRID, &with([8, 3, 3]))[1], 1 << 13 | 1 << 12);
    }

    #[test]
    fn rounding_is_to_the_nearest_and_changes_are_found_in_their_brick() {
        assert_eq!([0.0, 7e-6, 8e-6, 0.5, 1.0].map(stored), [0, 0, 1, 32768, 65535]);
        let changed = changed(&GRID, &with([3, 3, 3]), &with([16, 0, 8]));
        assert_eq!(changed, [true, false, false, false, false, true]);
    }
}
