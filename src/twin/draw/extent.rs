//! How far what is visible reaches: `h(d) = max { d·p : p in a voxel that shows something }` in mm from the volume's centre, by asking
//! every corner of every voxel.

use crate::Grid;
use cao_kernels::extent::FAINT;

/// `h` of each direction; `None` where no voxel shows something. A voxel does if its opacity is more than the share [`FAINT`] of the
/// largest.
pub fn extent(grid: &Grid, opacity: &[f32], directions: &[[f64; 3]]) -> Option<Vec<f64>> {
    let largest = opacity.iter().copied().fold(0.0, f32::max);
    let shows = |voxel: &usize| opacity[*voxel] > FAINT * largest;
    let corners = (0..grid.len()).filter(shows).flat_map(|voxel| {
        let centre = grid.voxel(voxel).map(|c| c as f64);
        (0..8_usize).map(move |corner| {
            let side = |axis: usize| if corner >> axis & 1 == 1 { 0.5 } else { -0.5 };
            grid.to_world(std::array::from_fn(|axis| centre[axis] + side(axis)))
        })
    });
    let mut reach = vec![f64::NEG_INFINITY; directions.len()];
    let mut any = false;
    for p in corners {
        any = true;
        for (reach, d) in reach.iter_mut().zip(directions) {
            *reach = reach.max((0..3).map(|i| d[i] * p[i]).sum());
        }
    }
    any.then_some(reach)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_reaches_to_its_faces_and_corners_and_a_fog_around_it_does_not_count() {
        let grid = Grid { dims: [6, 5, 4], spacing: [1.0, 2.0, 0.5] };
        let mut opacity = vec![0.0; grid.len()];
        let ways = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.6, 0.8]];
        assert_eq!(extent(&grid, &opacity, &ways), None);
        // Alone a fog is what there is to see: all of the box.
        opacity.fill(0.01);
        let found = extent(&grid, &opacity, &ways).unwrap();
        for (found, expected) in found.iter().zip([3.0, 3.0, 0.6 * 5.0 + 0.8]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        // Voxels 1 … 3 along x, 2 along y, 0 … 1 along z.
        for (x, z) in (1..4).flat_map(|x| [(x, 0), (x, 1)]) {
            opacity[grid.index([x, 2, z])] = 0.7;
        }
        let found = extent(&grid, &opacity, &ways).unwrap();
        for (found, expected) in found.iter().zip([1.0, 2.0, 0.6]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        // A fog of more than a 64th of it does.
        opacity.iter_mut().for_each(|a| *a = a.max(0.012));
        assert_eq!(extent(&grid, &opacity, &ways).unwrap()[0], 3.0);
    }
}
