//! The order of voxels: from the one that a file has to the one whose index axes run along +right, +anterior and
//! +superior, and back.
//!
//! What is drawn has its index axes as x, y and z, so a grid whose axes are left-handed (LAS, RPS …) would come out as its
//! mirror image, which no rotation undoes. The 48 orders of one grid all lead to the same canonical order: which axis comes
//! first, and which way it runs, is decided by where the axes point and not by how they are numbered.

/// The order that voxels had in their file, where it is another one than in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stored {
    /// The file's order from the volume's.
    pub(crate) steps: Steps,
    /// Position of the first voxel of the file in mm, free of the rounding that a way there and back has.
    pub(crate) origin: [f64; 3],
}

/// Where voxels lie, without their values; fields as in [`Volume`](crate::volume::Volume).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Distances of neighbours in mm.
    pub spacing: [f64; 3],
    /// Position of voxel (0, 0, 0) in mm.
    pub origin: [f64; 3],
    /// Unit vectors of the index axes.
    pub directions: [[f64; 3]; 3],
}

/// One order seen from another: along axis a runs the other's axis `axes[a]`, backwards where `reversed`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Steps {
    pub(crate) axes: [usize; 3],
    pub(crate) reversed: [bool; 3],
}

/// Sums of cosines nearer than this count as equal, so that axes at 45° that were rounded differently are still sorted the
/// same way.
const TIE: f64 = 1e-4;

impl Steps {
    pub(crate) const NONE: Self = Self { axes: [0, 1, 2], reversed: [false; 3] };

    const PERMUTATIONS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

    /// The permutation and reversals after which unit vectors at right angles are closest to x, y and z: the sum of their
    /// cosines is the largest, and of those that share it the first vector leans most to x, then the second.
    ///
    /// The outcome is right-handed. The sums of the six permutations are 1 or more on average (each cosine is at least its
    /// square), so the largest is above 1, and the trace of a reflection is not.
    pub(crate) fn nearest(directions: &[[f64; 3]; 3]) -> Self {
        let cosine = |axes: [usize; 3], a: usize| directions[axes[a]][a];
        let sum = |axes: [usize; 3]| (0..3).map(|a| cosine(axes, a).abs()).sum::<f64>();
        let most = Self::PERMUTATIONS.into_iter().map(sum).fold(0.0, f64::max);
        let steps = |axes: [usize; 3]| Self { axes, reversed: [0, 1, 2].map(|a| cosine(axes, a) < 0.0) };
        let ties = Self::PERMUTATIONS.into_iter().filter(|axes| sum(*axes) > most - TIE).map(steps);
        // Whatever their numbers were, the same vectors are compared here.
        let vectors = |steps: &Self| steps.directions(directions);
        ties.reduce(|best, other| if precedes(&vectors(&other), &vectors(&best)) { other } else { best })
            .unwrap_or(Self::NONE)
    }

    pub(crate) fn inverse(self) -> Self {
        let mut inverse = Self::NONE;
        for a in 0..3 {
            inverse.axes[self.axes[a]] = a;
            inverse.reversed[self.axes[a]] = self.reversed[a];
        }
        inverse
    }

    fn directions(self, of: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
        // A difference, for the negative of 0 would be -0.
        [0, 1, 2].map(|a| of[self.axes[a]].map(|d| if self.reversed[a] { 0.0 - d } else { d }))
    }

    pub(crate) fn layout(self, of: &Layout) -> Layout {
        let mut origin = of.origin;
        for axis in (0..3).filter(|a| self.reversed[*a]).map(|a| self.axes[a]) {
            let length = (of.dims[axis] as f64 - 1.0) * of.spacing[axis];
            origin = [0, 1, 2].map(|i| origin[i] + length * of.directions[axis][i]);
        }
        Layout {
            dims: self.axes.map(|a| of.dims[a]),
            spacing: self.axes.map(|a| of.spacing[a]),
            origin,
            directions: self.directions(&of.directions),
        }
    }

    /// For each voxel in this order, x fastest, its place in the other, which has `dims`.
    pub(crate) fn places(self, dims: [usize; 3]) -> impl Iterator<Item = usize> {
        let strides = [1, dims[0], dims[0] * dims[1]];
        let along = move |a: usize| {
            let (n, stride) = (dims[self.axes[a]], strides[self.axes[a]]);
            (0..n).map(move |i| stride * if self.reversed[a] { n - 1 - i } else { i })
        };
        along(2).flat_map(move |z| along(1).flat_map(move |y| along(0).map(move |x| x + y + z)))
    }
}

/// Whether one basis comes before another: by the first component that differs, the larger first.
fn precedes(one: &[[f64; 3]; 3], other: &[[f64; 3]; 3]) -> bool {
    let pairs = one.as_flattened().iter().zip(other.as_flattened());
    pairs.map(|(a, b)| a - b).find(|d| d.abs() > TIE).is_some_and(|d| d > 0.0)
}
