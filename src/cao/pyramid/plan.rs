//! Which cubes a level has means over, and which of them are stored.
//!
//! Level l has cubes of w voxels along an axis, their low corners every t voxels from the volume's first on: cell c is the mean over
//! [c t, c t + w), and 0 counts beyond the volume. Doubling l times from one voxel, w = 2^l where spacings are equal. Elsewhere an axis is doubled
//! while its cube is the shortest in mm along it, to within a factor of √2: so every level is a shell further out, and cubes stay nearly
//! cubes. What is t is the difference between N-buffers (1), mip levels (w), and what lies between:
//!
//! ```text
//! nbuffer        t = 1                       the first m halved, then N-buffers on their grid      mixed:m      t_l = w_min(l, m)
//! mip            t = w                       N-buffers up to k, then every second cell             reversed:k   t_l = w_l / w_min(l, k)
//! ```
//!
//! Cubes are even and voxels do not lie in their middle. A look-up is at the place whose cube is centred on the voxel, (p − w/2)/t in cells
//! from the corner: between N-buffer cells that is the centred cube with half of its weight in its outermost layers, exactly. Without that half
//! voxel shading shifts by half a voxel along each axis.

use crate::field::BRICK;
use cao_kernels::shared::levels::{LEVELS, Level};
use cao_model::options::Levels;

/// Most levels behind V_o.
pub const MOST: u32 = LEVELS - 1;

/// What texture coordinates are rounded by, in cells: devices have 8 bits at least of what lies between two of them.
const ROUNDED: f32 = 1.0 / 128.0;

/// Longest radius in smallest spacings: half the width of the last level's cube.
pub const MOST_VOXELS: f32 = (1 << (MOST - 1)) as f32;

/// One level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cells {
    /// w: voxels along the edges of a cube.
    pub width: [i64; 3],
    /// t: voxels from one cell to the next.
    pub stride: [i64; 3],
    /// The first cell that is stored.
    pub first: [i64; 3],
    /// How many are.
    pub dims: [u32; 3],
}

impl Cells {
    /// Tiles along each axis: as many cells as a brick has voxels.
    pub fn tiles(&self) -> [u32; 3] {
        self.dims.map(|n| n.div_ceil(BRICK))
    }

    /// Tiles in all.
    pub fn tile_count(&self) -> u32 {
        self.tiles().iter().product()
    }
}

/// All levels, the first that of V_o itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Level 0, 1 …
    pub cells: Vec<Cells>,
    /// How far in half-widths a cube may be moved.
    factor: f32,
}

impl Plan {
    /// The levels for a radius, which holds, in a volume of these voxels: L = 1 + log2(R / smallest spacing), rounded; none of a radius that
    /// rounds to less than one voxel's half.
    ///
    /// # Errors
    /// [`cao_model::Error::Limit`] for radii above [`MOST_VOXELS`].
    pub fn new(
        dims: [u32; 3],
        spacing: [f32; 3],
        radius_mm: f32,
        levels: Levels,
        factor: f32,
    ) -> cao_model::Result<Self> {
        let smallest = spacing.into_iter().fold(f32::INFINITY, f32::min);
        too_far(radius_mm, smallest)?;
        let voxels = radius_mm / smallest;
        // Of 0 it is −∞, which is none.
        let count = (1.0 + voxels.log2().round()).max(0.0) as u32;
        Ok(Self::of(dims, spacing, count, levels, factor))
    }

    /// So many levels behind V_o.
    pub fn of(dims: [u32; 3], spacing: [f32; 3], count: u32, levels: Levels, factor: f32) -> Self {
        let widths = widths(spacing, count);
        let stride = |l: usize| -> [i64; 3] {
            let at = |n: u32| widths[l.min(n as usize)];
            match levels {
                Levels::Nbuffer => [1; 3],
                Levels::Mip => widths[l],
                Levels::Mixed(m) => at(m),
                Levels::Reversed(k) => std::array::from_fn(|i| widths[l][i] / at(k)[i]),
            }
        };
        let mut cells: Vec<Cells> = (0..widths.len())
            .map(|l| Cells { width: widths[l], stride: stride(l), first: [0; 3], dims })
            .collect();
        // From the last: a level holds what is looked up in it and what the next is made of, as far as that is not 0.
        for l in (1..cells.len()).rev() {
            let coarser = cells.get(l + 1).copied();
            for (i, &voxels) in dims.iter().enumerate() {
                let [low, high] = stored(cells[l], coarser, i, voxels, factor);
                (cells[l].first[i], cells[l].dims[i]) = (low, (high - low + 1).max(1) as u32);
            }
        }
        Self { cells, factor }
    }

    /// L.
    pub fn levels(&self) -> u32 {
        self.cells.len() as u32 - 1
    }

    /// How many voxels along each axis from a changed brick it can change what is looked up around a voxel, or around a place as far from its
    /// middle as `moved` says.
    ///
    /// A look-up at x takes the cells of which the middle is less than t from it. The last of those that have voxels of a brick ends w − min(t, 8)
    /// beyond it, for cells and bricks begin at common multiples; and the middle of a voxel is half a voxel from its side. So `|x| < w/2 + t − min(t, 8) + ½`
    /// beyond the brick: `2^(L−1) (1 + factor)` of N-buffers, `2^(L−1) (3 + factor) − 8` of mip levels as wide as bricks. Level 0 covers neighbours,
    /// for the normal and for which voxels need a value.
    pub fn reach(&self, moved: [f32; 3]) -> [u32; 3] {
        let far = |cells: &Cells, i: usize| {
            let (w, t) = (cells.width[i] as f32, cells.stride[i] as f32);
            moved[i] + 0.5 * (1.0 + self.factor) * w + t * (1.0 + ROUNDED) - t.min(BRICK as f32) + 0.5
        };
        std::array::from_fn(|i| self.cells.iter().map(|cells| far(cells, i) as u32).max().unwrap_or(1))
    }

    /// As kernels look them up.
    pub fn table(&self) -> Vec<Level> {
        let count = |cells: &Cells| cells.width.iter().product::<i64>() as f64;
        let level = |l: usize| {
            let cells = &self.cells[l];
            let shell = if l == 0 { 1.0 } else { count(cells) - count(&self.cells[l - 1]) };
            let inner = if l == 0 { 0.0 } else { count(&self.cells[l - 1]) };
            let along = |of: &dyn Fn(f64, f64, f64, f64) -> f64| -> [f32; 3] {
                std::array::from_fn(|i| {
                    let (w, t) = (cells.width[i] as f64, cells.stride[i] as f64);
                    of(w, t, cells.first[i] as f64, f64::from(cells.dims[i])) as f32
                })
            };
            Level {
                scale: along(&|_, t, _, n| 1.0 / (t * n)),
                outer: (count(cells) / shell) as f32,
                bias: along(&|w, t, first, n| (0.5 - first - 0.5 * w / t) / n),
                inner: (inner / shell) as f32,
                lift: along(&|w, _, _, _| 0.5 * f64::from(self.factor) * w),
                pad: Default::default(),
            }
        };
        (0..self.cells.len()).map(level).collect()
    }

    /// Bytes of the stored levels, of 2 a cell.
    pub fn bytes(&self) -> u64 {
        self.cells.iter().skip(1).map(|c| 2 * c.dims.iter().map(|n| u64::from(*n)).product::<u64>()).sum()
    }
}

/// Refuses a radius of more than [`MOST_VOXELS`] of the smallest spacing.
///
/// # Errors
/// [`cao_model::Error::Limit`].
pub fn too_far(radius_mm: f32, smallest: f32) -> cao_model::Result<()> {
    let voxels = radius_mm / smallest;
    // Rounding of lengths in mm must not refuse it.
    if voxels <= MOST_VOXELS * 1.001 {
        return Ok(());
    }
    Err(cao_model::Error::Limit {
        what: format!("voxels in a radius of {radius_mm} mm at {smallest} mm a voxel"),
        needed: voxels.ceil() as u64,
        limit: MOST_VOXELS as u64,
        hint: "make the radius smaller, or use method cao or lao".into(),
    })
}

/// Voxels along the edges of the cube of each level.
fn widths(spacing: [f32; 3], count: u32) -> Vec<[i64; 3]> {
    let mut all = vec![[1_i64; 3]];
    for l in 0..count as usize {
        let length = |i: usize| all[l][i] as f32 * spacing[i];
        let shortest = (0..3).map(length).fold(f32::INFINITY, f32::min);
        let double = |i: usize| if length(i) <= std::f32::consts::SQRT_2 * shortest { 2 } else { 1 };
        all.push(std::array::from_fn(|i| double(i) * all[l][i]));
    }
    all
}

/// First and last cell of a level along an axis of `n` voxels that are looked up or make the next level, and that reach into the volume.
fn stored(cells: Cells, coarser: Option<Cells>, i: usize, n: u32, factor: f32) -> [i64; 2] {
    let (w, t) = (cells.width[i], cells.stride[i]);
    let n = i64::from(n);
    let moved = (0.5 + 0.5 * f64::from(factor)) * w as f64;
    let back = (0.5 - 0.5 * f64::from(factor)) * w as f64;
    let mut low = ((0.5 - moved) / t as f64).floor() as i64;
    let mut high = ((n as f64 - 0.5 - back) / t as f64).floor() as i64 + 1;
    if let Some(next) = coarser {
        let ratio = next.stride[i] / t;
        let end = next.first[i] + i64::from(next.dims[i]) - 1;
        low = low.min(next.first[i] * ratio);
        high = high.max(end * ratio + (next.width[i] - w) / t);
    }
    // Those with c t + w > 0 and c t < n.
    [low.max(-((w - 1) / t)), high.min((n - 1) / t)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn widths_of(spacing: [f32; 3], count: u32) -> Vec<[i64; 3]> {
        Plan::of([64; 3], spacing, count, Levels::Mip, 0.0).cells.iter().map(|c| c.width).collect()
    }

    #[test]
    fn an_axis_is_doubled_while_its_cube_is_the_shortest() {
        assert_eq!(widths_of([0.7; 3], 3), [[1; 3], [2; 3], [4; 3], [8; 3]]);
        assert_eq!(widths_of([1.0, 1.0, 2.0], 3), [[1, 1, 1], [2, 2, 1], [4, 4, 2], [8, 8, 4]]);
        assert_eq!(widths_of([1.0, 1.0, 3.0], 4), [[1; 3], [2, 2, 1], [4, 4, 1], [8, 8, 2], [16, 16, 4]]);
        assert_eq!(widths_of([1.0, 1.0001, 0.999], 2), [[1; 3], [2; 3], [4; 3]]);
    }

    #[test]
    fn levels_follow_the_radius_and_longer_ones_are_refused() {
        let of = |radius| Plan::new([16; 3], [0.5, 1.0, 1.0], radius, Levels::Nbuffer, 0.0);
        let levels = [0.0, 0.3, 0.5, 1.0, 8.0, 10.0, 128.0].map(|radius| of(radius).unwrap().levels());
        assert_eq!(levels, [0, 0, 1, 2, 5, 5, 9]);
        let error = of(129.0).unwrap_err().to_string();
        assert!(error.contains("258") && error.contains("256"), "{error}");
    }

    #[test]
    fn the_reach_is_that_of_the_last_cube() {
        let reach = |levels, factor| Plan::of([16; 3], [1.0; 3], 4, levels, factor).reach([0.0; 3])[0];
        assert_eq!(reach(Levels::Nbuffer, 0.0), 8);
        assert_eq!(reach(Levels::Nbuffer, 2.0), 8 * 3);
        assert_eq!(reach(Levels::Mip, 0.0), 8 * 3 - 8);
        assert_eq!(reach(Levels::Mip, 1.0), 8 * 4 - 8);
        assert_eq!(reach(Levels::Mixed(1), 0.0), 8);
        assert_eq!(reach(Levels::Reversed(3), 0.0), 8);
        let none = Plan::of([16; 3], [1.0; 3], 0, Levels::Mip, 0.0);
        assert_eq!((none.reach([0.0; 3]), none.reach([5.5, 1.0, 0.0])), ([1; 3], [6, 2, 1]));
    }

    /// At 512³ the border costs 7 %: 2 bytes a voxel and level of N-buffers, 2/7 in all of mip levels.
    #[test]
    fn memory_is_that_of_the_form() {
        let bytes = |levels| Plan::of([512; 3], [1.0; 3], 5, levels, 0.0).bytes() as f64 / f64::from(1 << 27);
        for (levels, expected) in [
            (Levels::Nbuffer, 10.0),
            (Levels::Mip, 0.286),
            (Levels::Mixed(1), 5.0 * 0.25),
            (Levels::Mixed(2), 0.25 + 4.0 / 32.0),
            (Levels::Reversed(2), 4.0 + 0.286),
            (Levels::Reversed(3), 6.0 + 0.28),
        ] {
            let found = bytes(levels);
            assert!(found > 0.99 * expected && found < 1.08 * expected, "{levels:?}: {found} {expected}");
        }
    }

    /// Cells at the border reach into the volume, and one farther does not.
    #[test]
    fn what_is_stored_is_what_is_not_nothing() {
        for levels in [Levels::Nbuffer, Levels::Mip, Levels::Mixed(2), Levels::Reversed(2)] {
            let plan = Plan::of([13, 1, 40], [1.0; 3], 4, levels, 4.0);
            for cells in &plan.cells[1..] {
                for (i, n) in [13, 1, 40].into_iter().enumerate() {
                    let (w, t, first) = (cells.width[i], cells.stride[i], cells.first[i]);
                    let last = first + i64::from(cells.dims[i]) - 1;
                    assert!(first * t + w > 0 && (first - 1) * t + w <= 0, "{levels:?} {cells:?}");
                    assert!(last * t < n && (last + 1) * t >= n, "{levels:?} {cells:?}");
                }
            }
        }
    }
}
