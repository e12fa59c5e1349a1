//! The box of the bricks that show something: smallest and largest place along each axis, by asking every brick.

use crate::Grid;

/// First and last brick along each axis of the box around those of the grid that show something; `None` where none does.
pub fn bounds(bricks: &Grid, shows: &[bool]) -> Option<[[usize; 3]; 2]> {
    let shown = || (0..bricks.len()).filter(|&brick| shows[brick]).map(|brick| bricks.voxel(brick));
    shown().next()?;
    let least = std::array::from_fn(|axis| shown().map(|at| at[axis]).min().unwrap_or(0));
    let most = std::array::from_fn(|axis| shown().map(|at| at[axis]).max().unwrap_or(0));
    Some([least, most])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_is_that_of_the_outermost_bricks() {
        let bricks = Grid { dims: [4, 3, 5], spacing: [8.0; 3] };
        let mut shows = vec![false; bricks.len()];
        assert_eq!(bounds(&bricks, &shows), None);
        shows[bricks.index([2, 0, 4])] = true;
        assert_eq!(bounds(&bricks, &shows), Some([[2, 0, 4]; 2]));
        shows[bricks.index([1, 2, 3])] = true;
        assert_eq!(bounds(&bricks, &shows), Some([[1, 0, 3], [2, 2, 4]]));
    }
}
