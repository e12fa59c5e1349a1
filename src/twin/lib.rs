//! Twins: the equation of each numerical stage in plain loops with f64 sums, the truth that tests use.
//!
//! Written from the paper, not from the shaders; not tuned, and no fallback for a missing GPU. Each file opens with
//! its equation. Geometry that decides visibility (shape distances, depth maps) is f32, as [`cao_model::clip`] defines it.

#![forbid(unsafe_code)]

pub mod cast;
pub mod clip;
pub mod cones;
pub mod draw;
pub mod features;
pub mod field;
pub mod histograms;
pub mod image_space;
pub mod measure;
pub mod mesh;
pub mod network;
pub mod pyramid;
pub mod rays;
pub mod spao;
pub mod tables;
pub mod vicinity;

/// Shape of every field of a volume: values in x-fastest order, voxel centres at integer index coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Distance of neighbouring voxel centres along x, y, z in mm.
    pub spacing: [f64; 3],
}

impl Grid {
    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.dims.iter().product()
    }

    /// Whether an axis has no voxel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Index of voxel `[x, y, z]` in a field.
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    /// Voxel `[x, y, z]` at an index of a field.
    pub fn voxel(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        [index % nx, index / nx % ny, index / nx / ny]
    }

    /// Smallest spacing in mm.
    pub fn min_spacing(&self) -> f64 {
        self.spacing.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Spacings in smallest spacings, as f32 has them, rounded to 65536ths.
    pub fn ratios(&self) -> [f64; 3] {
        let spacing = self.spacing.map(|s| f64::from(s as f32));
        let smallest = spacing.into_iter().fold(f64::INFINITY, f64::min);
        spacing.map(|s| (65536.0 * s / smallest).round() / 65536.0)
    }

    /// |spacing|, the diagonal of a voxel in mm.
    pub fn diagonal(&self) -> f64 {
        self.spacing.iter().map(|s| s * s).sum::<f64>().sqrt()
    }

    /// Index coordinates → world mm, origin at the volume's centre.
    pub fn to_world(&self, position: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| (position[i] - (self.dims[i] as f64 - 1.0) / 2.0) * self.spacing[i])
    }

    /// World mm → index coordinates.
    pub fn to_index(&self, world: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| world[i] / self.spacing[i] + (self.dims[i] as f64 - 1.0) / 2.0)
    }

    /// The field at a voxel, continued outside by its edge voxels.
    fn clamped(&self, field: &[f32], voxel: [i64; 3]) -> f64 {
        let nearest = std::array::from_fn(|i| voxel[i].clamp(0, self.dims[i] as i64 - 1) as usize);
        f64::from(field[self.index(nearest)])
    }

    /// The voxels that share a face, an edge or a corner with `voxel` (at most 26).
    pub fn neighbours(&self, voxel: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
        let (dims, centre) = (self.dims, voxel.map(|c| c as isize));
        (0..27_isize).filter(|&n| n != 13).filter_map(move |n| {
            let offset = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
            let at: [isize; 3] = std::array::from_fn(|i| centre[i] + offset[i]);
            (0..3).all(|i| at[i] >= 0 && at[i] < dims[i] as isize).then(|| at.map(|c| c as usize))
        })
    }
}

/// Trilinear value of a field at index coordinates; voxels outside the volume count as 0, so that the field fades to
/// 0 within one voxel beyond its outermost centres.
pub fn trilinear(grid: &Grid, field: &[f32], position: [f64; 3]) -> f64 {
    blend(position, |voxel| {
        let inside = (0..3).all(|i| voxel[i] >= 0 && voxel[i] < grid.dims[i] as i64);
        if inside { f64::from(field[grid.index(voxel.map(|c| c as usize))]) } else { 0.0 }
    })
}

/// Trilinear value of a field at index coordinates, continued outside by its edge voxels.
pub fn trilinear_clamped(grid: &Grid, field: &[f32], position: [f64; 3]) -> f64 {
    blend(position, |voxel| grid.clamped(field, voxel))
}

/// Mean of the eight voxels around a position, weighted by 1 − distance along each axis.
fn blend(position: [f64; 3], value: impl Fn([i64; 3]) -> f64) -> f64 {
    let low = position.map(f64::floor);
    let mut sum = 0.0;
    for corner in 0..8_usize {
        let step: [i64; 3] = std::array::from_fn(|i| (corner >> i & 1) as i64);
        let weight: f64 = (0..3)
            .map(|i| {
                let t = position[i] - low[i];
                if step[i] == 1 { t } else { 1.0 - t }
            })
            .product();
        if weight > 0.0 {
            sum += weight * value(std::array::from_fn(|i| low[i] as i64 + step[i]));
        }
    }
    sum
}

/// `f` of every index below `count`, in order, on all cores.
pub fn each<T: Send>(count: usize, f: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let share = count.div_ceil(cores).max(1);
    let f = &f;
    std::thread::scope(|scope| {
        let parts: Vec<_> = (0..count)
            .step_by(share)
            .map(|first| scope.spawn(move || (first..(first + share).min(count)).map(f).collect::<Vec<_>>()))
            .collect();
        parts
            .into_iter()
            .flat_map(|part| part.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    })
}

#[cfg(test)]
pub(crate) mod random {
    //! A small generator, so that every failing case is found again.

    /// PCG-like state.
    pub struct Random(pub u32);

    impl Random {
        /// Uniform in [0, 1).
        pub fn unit(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            let word = ((self.0 >> ((self.0 >> 28) + 4)) ^ self.0).wrapping_mul(277_803_737);
            (((word >> 22) ^ word) >> 8) as f32 / (1 << 24) as f32
        }

        /// Uniform in [low, high).
        pub fn within(&mut self, low: f32, high: f32) -> f32 {
            low + (high - low) * self.unit()
        }

        /// Each coordinate uniform in [low, high).
        pub fn vector(&mut self, low: f32, high: f32) -> glam::Vec3 {
            glam::Vec3::new(self.within(low, high), self.within(low, high), self.within(low, high))
        }

        /// Opacities: about half transparent, the rest anywhere in [0, 1].
        pub fn opacities(&mut self, count: usize) -> Vec<f32> {
            (0..count).map(|_| self.within(-1.0, 1.05).clamp(0.0, 1.0)).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { dims: [3, 4, 5], spacing: [1.0, 2.0, 0.5] };

    #[test]
    fn index_and_voxel_are_inverse_and_x_is_fastest() {
        assert_eq!(GRID.index([1, 0, 0]), 1);
        for i in 0..GRID.len() {
            assert_eq!(GRID.index(GRID.voxel(i)), i);
        }
    }

    #[test]
    fn world_is_centred_and_inverse_of_index() {
        assert_eq!(GRID.to_world([1.0, 1.5, 2.0]), [0.0; 3]);
        assert_eq!(GRID.to_world([0.0, 0.0, 0.0]), [-1.0, -3.0, -1.0]);
        assert_eq!(GRID.to_index(GRID.to_world([0.25, 1.0, 3.5])), [0.25, 1.0, 3.5]);
    }

    #[test]
    fn neighbours_are_26_inside_and_7_at_a_corner() {
        assert_eq!(GRID.neighbours([1, 1, 1]).count(), 26);
        assert_eq!(GRID.neighbours([2, 0, 4]).count(), 7);
        assert_eq!(Grid { dims: [1; 3], ..GRID }.neighbours([0; 3]).count(), 0);
    }

    #[test]
    fn trilinear_reproduces_linear_fields_and_fades_outside() {
        let field: Vec<f32> = (0..GRID.len())
            .map(|i| {
                let [x, y, z] = GRID.voxel(i).map(|c| c as f32);
                1.0 + x + 2.0 * y - 0.5 * z
            })
            .collect();
        let at = [0.3, 2.6, 3.1];
        let expected = 1.0 + 0.3 + 2.0 * 2.6 - 0.5 * 3.1;
        assert!((trilinear(&GRID, &field, at) - expected).abs() < 1e-12);
        assert!((trilinear_clamped(&GRID, &field, at) - expected).abs() < 1e-12);
        let ones = vec![1.0; GRID.len()];
        assert!((trilinear(&GRID, &ones, [-0.25, 1.0, 1.0]) - 0.75).abs() < 1e-12);
        assert!((trilinear(&GRID, &ones, [2.5, 3.5, 1.0]) - 0.25).abs() < 1e-12);
        assert_eq!(trilinear(&GRID, &ones, [-1.0, 1.0, 1.0]), 0.0);
        assert_eq!(trilinear(&GRID, &ones, [1e6, -1e6, 1.0]), 0.0);
        assert_eq!(trilinear_clamped(&GRID, &ones, [-9.0, 9.0, 1.3]), 1.0);
    }

    #[test]
    fn each_keeps_the_order() {
        for count in [0, 1, 2, 7, 1000] {
            assert_eq!(each(count, |i| i * i), (0..count).map(|i| i * i).collect::<Vec<_>>());
        }
    }
}
