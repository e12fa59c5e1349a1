//! Between grids (DVAO §3.1, §3.2).
//!
//! ```text
//! shrink   V_o to the grid of a net: 1 − (1 − mean)^(reference length of the net / that of V_o), the mean of V_o over a voxel of the grid
//! halve    every second voxel is kept, the first one first
//! double   each is repeated
//! ```
//!
//! The paper resizes trilinearly, its authors' program to the nearest, as here. The mean is of n samples along each axis, in the middles of n equal parts, n
//! the voxels of V_o that the voxel covers, rounded up; V_o is interpolated and 0 outside.

use super::Tensor;
use crate::{Grid, each, trilinear};

/// Where a volume lies in the grid of a net.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Voxels of the grid.
    pub dims: [usize; 3],
    /// Of these, before the volume begins.
    pub before: [usize; 3],
    /// A voxel of the volume in voxels of the grid.
    pub voxel: [f64; 3],
}

impl Placed {
    /// In a grid of cubes of `step` mm whose edges are multiples of `multiple`, no longer than they have to be, with the volume in its middle.
    pub fn new(grid: &Grid, step: f64, multiple: usize) -> Self {
        // Rounding must not make a voxel more.
        let covers =
            |i: usize| (grid.dims[i] as f64 * grid.spacing[i] / step - 1e-3).ceil().max(1.0) as usize;
        let dims = std::array::from_fn(|i| covers(i).next_multiple_of(multiple));
        let before = std::array::from_fn(|i| (dims[i] - covers(i)) / 2);
        Self { dims, before, voxel: grid.spacing.map(|spacing| spacing / step) }
    }

    /// Index coordinates of the volume → of the grid.
    pub fn to_grid(&self, position: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| (position[i] + 0.5) * self.voxel[i] + self.before[i] as f64 - 0.5)
    }

    /// Index coordinates of the grid → of the volume.
    pub fn to_volume(&self, position: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| (position[i] + 0.5 - self.before[i] as f64) / self.voxel[i] - 0.5)
    }
}

/// V_o on the grid, x fastest; `exponent` is the reference length of the net divided by that of V_o.
pub fn shrink(grid: &Grid, opacity: &[f32], placed: &Placed, exponent: f64) -> Vec<f32> {
    let to = Grid { dims: placed.dims, spacing: [1.0; 3] };
    // Rounding must not make a sample more.
    let parts = placed.voxel.map(|voxel| (0.999 / voxel).ceil().max(1.0) as usize);
    let samples = Grid { dims: parts, spacing: [1.0; 3] };
    each(to.len(), |i| {
        let voxel = to.voxel(i);
        let sample = |n: usize| {
            let part = samples.voxel(n);
            let at = |axis: usize| voxel[axis] as f64 - 0.5 + (part[axis] as f64 + 0.5) / parts[axis] as f64;
            trilinear(grid, opacity, placed.to_volume(std::array::from_fn(at)))
        };
        let mean = (0..samples.len()).map(sample).sum::<f64>() / samples.len() as f64;
        (1.0 - (1.0 - mean).max(0.0).powf(exponent)) as f32
    })
}

/// Every second voxel along each axis.
pub fn halve(input: &Tensor) -> Tensor {
    resized(input, input.dims.map(|d| d.div_ceil(2)), |voxel| voxel.map(|c| 2 * c))
}

/// Each voxel twice along each axis.
pub fn double(input: &Tensor) -> Tensor {
    resized(input, input.dims.map(|d| 2 * d), |voxel| voxel.map(|c| c / 2))
}

fn resized(input: &Tensor, dims: [usize; 3], from: impl Fn([usize; 3]) -> [usize; 3] + Sync) -> Tensor {
    let grid = |dims| Grid { dims, spacing: [1.0; 3] };
    let (old, new) = (grid(input.dims), grid(dims));
    let planes = each(input.channels().len(), |c| {
        let channel = &input.values[c * old.len()..][..old.len()];
        (0..new.len()).map(|i| channel[old.index(from(new.voxel(i)))]).collect::<Vec<_>>()
    });
    Tensor { dims, values: planes.concat() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_volume_lies_in_the_middle_of_whole_multiples() {
        let grid = Grid { dims: [100, 10, 7], spacing: [0.5, 1.0, 4.0] };
        let placed = Placed::new(&grid, 1.0, 16);
        assert_eq!((placed.dims, placed.before), ([64, 16, 32], [7, 3, 2]));
        assert_eq!(placed.voxel, [0.5, 1.0, 4.0]);
        // The corner of the volume is a corner of voxels of the grid.
        assert_eq!(placed.to_grid([-0.5; 3]), [6.5, 2.5, 1.5]);
        assert_eq!(placed.to_volume(placed.to_grid([3.25, 4.5, 6.0])), [3.25, 4.5, 6.0]);
        // 64 voxels of a third, within rounding.
        let third = Grid { dims: [64; 3], spacing: [1.0 / 3.0; 3] };
        assert_eq!(Placed::new(&third, 1.0 / 3.0 - 1e-9, 32).dims, [64; 3]);
    }

    #[test]
    fn a_grid_of_the_volumes_own_voxels_has_its_opacities_and_zeros_around() {
        let grid = Grid { dims: [3, 2, 1], spacing: [2.0; 3] };
        let opacity = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
        let found = shrink(&grid, &opacity, &Placed::new(&grid, 2.0, 4), 1.0);
        let to = Grid { dims: [4; 3], spacing: [1.0; 3] };
        for (i, value) in found.iter().enumerate() {
            let [x, y, z] = to.voxel(i);
            let inside = x < 3 && (1..3).contains(&y) && z == 1;
            let expected = if inside { opacity[grid.index([x, y - 1, 0])] } else { 0.0 };
            assert!((value - expected).abs() < 1e-6, "{:?}: {value}", to.voxel(i));
        }
    }

    /// Transmittances multiply along twice the length: 1 − (1 − a)².
    #[test]
    fn a_voxel_of_the_grid_has_the_mean_of_what_it_covers_per_its_length() {
        let grid = Grid { dims: [4; 3], spacing: [1.0; 3] };
        let opacity: Vec<f32> = (0..64).map(|i| [0.25, 0.75][grid.voxel(i)[0] % 2]).collect();
        let placed = Placed { dims: [2; 3], before: [0; 3], voxel: [0.5; 3] };
        assert_eq!(shrink(&grid, &opacity, &placed, 2.0), [0.75; 8]);
        assert_eq!(shrink(&grid, &[1.0; 64], &placed, 2.0), [1.0; 8]);
    }

    #[test]
    fn every_second_is_kept_and_each_is_repeated() {
        let values = (0..2 * 4 * 2 * 2).map(|i| i as f32).collect();
        let input = Tensor { dims: [4, 2, 2], values };
        assert_eq!(halve(&input), Tensor { dims: [2, 1, 1], values: vec![0.0, 2.0, 16.0, 18.0] });
        let doubled = double(&halve(&input));
        assert_eq!(doubled.dims, input.dims);
        assert_eq!(
            doubled.values,
            [[0.0, 0.0, 2.0, 2.0].repeat(4), [16.0, 16.0, 18.0, 18.0].repeat(4)].concat()
        );
        assert_eq!(halve(&doubled), halve(&input));
        let odd = Tensor { dims: [3, 1, 1], values: vec![1.0, 2.0, 3.0] };
        assert_eq!(halve(&odd).values, [1.0, 3.0]);
    }
}
