//! How far a ray may leap: `d(b) = min { max(|b_x − c_x|, |b_y − c_y|, |b_z − c_z|) : c shows something }`, the Chebyshev
//! distance in bricks, by asking every brick.

use crate::Grid;

/// The distance from each brick of the grid to the nearest that `shows` something, x fastest; `None` where none does.
pub fn brick_distance(bricks: &Grid, shows: &[bool]) -> Vec<Option<usize>> {
    (0..bricks.len())
        .map(|brick| {
            let here = bricks.voxel(brick);
            let distance = |other: usize| {
                let there = bricks.voxel(other);
                (0..3).map(|axis| here[axis].abs_diff(there[axis])).max()
            };
            (0..bricks.len()).filter(|&other| shows[other]).filter_map(distance).min()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_is_the_largest_of_the_three_ways() {
        let bricks = Grid { dims: [4, 3, 2], spacing: [8.0; 3] };
        let mut shows = vec![false; bricks.len()];
        assert_eq!(brick_distance(&bricks, &shows), vec![None; 24]);
        shows[bricks.index([0, 1, 1])] = true;
        let found = brick_distance(&bricks, &shows);
        let at = |brick| found[bricks.index(brick)];
        assert_eq!(at([0, 1, 1]), Some(0));
        assert_eq!(at([1, 2, 0]), Some(1));
        assert_eq!(at([3, 0, 0]), Some(3));
        shows[bricks.index([3, 0, 1])] = true;
        assert_eq!(brick_distance(&bricks, &shows)[bricks.index([3, 0, 0])], Some(1));
    }
}
