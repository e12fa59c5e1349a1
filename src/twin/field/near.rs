//! Which bricks an edit concerns (method.md §5.2): those with a voxel within `reach` mm of a voxel of a changed brick that need a value, or
//! have some that nothing needs any more; or with one that is within so many voxels of it along every axis.

use crate::Grid;
use crate::field::bricks::{EDGE, bricks};

/// How far a change reaches.
#[derive(Clone, Copy, Debug)]
pub enum Reach {
    /// In mm.
    Ball(f64),
    /// In voxels along each axis.
    Box([usize; 3]),
}

/// Of each brick of [`bricks`]: whether it is to be computed, and whether it has values then, where `valued` says which had some before. A
/// voxel needs a value if it or a neighbour has opacity; all do if `unneeded`.
pub fn near(
    grid: &Grid,
    opacity: &[u16],
    changed: &[bool],
    valued: &[bool],
    reach: Reach,
    unneeded: bool,
) -> Vec<[bool; 2]> {
    let all = bricks(grid);
    let mut needed = vec![unneeded; all.len()];
    for i in 0..grid.len() {
        let voxel = grid.voxel(i);
        if opacity[i] > 0 || grid.neighbours(voxel).any(|n| opacity[grid.index(n)] > 0) {
            needed[all.index(voxel.map(|c| c / EDGE))] = true;
        }
    }
    // Between whole bricks: cut short at the upper end, a brick is no farther away.
    let apart = |a: [usize; 3], b: [usize; 3]| -> [usize; 3] {
        std::array::from_fn(|i| (EDGE * a[i].abs_diff(b[i])).saturating_sub(EDGE - 1))
    };
    let within = |voxels: [usize; 3]| match reach {
        Reach::Ball(mm) => {
            let squared = |i: usize| (voxels[i] as f64 * grid.spacing[i]).powi(2);
            (0..3).map(squared).sum::<f64>().sqrt() <= mm
        }
        Reach::Box(most) => (0..3).all(|i| voxels[i] <= most[i]),
    };
    (0..all.len())
        .map(|i| {
            let close = |j: usize| changed[j] && within(apart(all.voxel(i), all.voxel(j)));
            match (0..all.len()).any(close) {
                true => [needed[i] || valued[i], needed[i]],
                false => [false, valued[i]],
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bricks_within_reach_that_need_values_are_chosen() {
        let grid = Grid { dims: [40, 8, 8], spacing: [0.5, 1.0, 1.0] };
        let mut opacity = vec![0; grid.len()];
        // In the second brick, beside the third; and in the fifth.
        opacity[grid.index([15, 4, 4])] = 9;
        opacity[grid.index([35, 4, 4])] = 9;
        let changed = [true, false, false, false, false];
        // Nearest voxels of neighbours are half a millimetre apart, of the next bricks 4.5, then 8.5 and 12.5.
        let within = |changed, reach, unneeded| {
            near(&grid, &opacity, changed, &[false; 5], reach, unneeded)
                .into_iter()
                .map(|[to_do, _]| to_do)
                .collect::<Vec<_>>()
        };
        let chosen = |changed, mm, unneeded| within(changed, Reach::Ball(mm), unneeded);
        let found = |reach, unneeded| chosen(&changed, reach, unneeded);
        assert_eq!(found(0.4, false), [false; 5]);
        assert_eq!(found(0.5, false), [false, true, false, false, false]);
        assert_eq!(found(12.4, false), [false, true, true, false, false]);
        assert_eq!(found(12.5, false), [false, true, true, false, true]);
        assert_eq!(found(4.5, true), [true, true, true, false, false]);
        assert_eq!(chosen(&[false; 5], 99.0, true), [false; 5]);
        // The first and the fourth have values that nothing needs; the fourth is out of reach.
        assert_eq!(
            near(&grid, &opacity, &changed, &[true, false, false, true, true], Reach::Ball(4.5), false),
            [[true, false], [true, true], [true, true], [false, true], [false, true]]
        );
        // In voxels: the third brick is 9 away, whatever their size.
        let boxed = |voxels| within(&changed, Reach::Box([voxels, 0, 0]), true);
        assert_eq!(boxed(0), [true, false, false, false, false]);
        assert_eq!(boxed(8), [true, true, false, false, false]);
        assert_eq!(boxed(9), [true, true, true, false, false]);
    }
}
