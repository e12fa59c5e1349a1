//! A volume: values on a regular grid, and where it lies.

use crate::order::{Layout, Steps, Stored};
use crate::transfer::TransferFunction;
use crate::values::Values;
use crate::{Error, Result};

/// What `origin` and `directions` of a [`Volume`] refer to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Space {
    /// The file does not say, or a frame without anatomical meaning; numbers are as in the file.
    Unknown,
    /// The patient: +x right, +y anterior, +z superior. Files in other anatomical frames are turned into this one.
    Ras,
}

/// A scalar field on a regular grid.
///
/// Plain index space: distances everywhere come from `spacing` alone, and a renderer draws the index axes as they are.
/// `origin`, `directions` and `space` say where the grid lies, for files that are written, for [`Volume::into_canonical`] and
/// for the rotation that is left to the patient ([`Turn`](crate::frame::Turn)).
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    /// Voxels along x, y, z; x is fastest in memory.
    pub dims: [usize; 3],
    /// Distance of neighbouring voxel centres along x, y, z in mm.
    pub spacing: [f64; 3],
    /// Position of the centre of voxel (0, 0, 0) in the file's frame, in mm.
    pub origin: [f64; 3],
    /// Unit vectors of the index axes x, y, z in the file's frame.
    pub directions: [[f64; 3]; 3],
    /// The frame of `origin` and `directions`.
    pub space: Space,
    /// Stored values, x fastest.
    pub values: Values,
    /// Value = `slope` · stored + `intercept`.
    pub slope: f64,
    /// See `slope`.
    pub intercept: f64,
    /// The order of the voxels in their file, where it is another one; files that are written get it back.
    pub stored: Option<Stored>,
}

impl Volume {
    /// A volume with values as stored, origin 0 and axes as they come.
    ///
    /// Errors: [`Error::Config`] when a dimension is 0, the number of values is not the product of `dims`, a spacing
    /// (mm) is not positive and reasonable, or a value is NaN or infinite.
    pub fn new(dims: [usize; 3], spacing: [f64; 3], values: Values) -> Result<Self> {
        let volume = Self {
            dims,
            spacing,
            origin: [0.0; 3],
            directions: IDENTITY,
            space: Space::Unknown,
            values,
            slope: 1.0,
            intercept: 0.0,
            stored: None,
        };
        volume.check()?;
        Ok(volume)
    }

    /// Is it what [`Volume::new`] would accept? For one whose fields were changed by hand, or that was read with its NaN.
    ///
    /// Errors: as [`Volume::new`].
    pub fn check(&self) -> Result<()> {
        let [x, y, z] = self.dims;
        let count = voxel_count(self.dims.map(|d| d as u64)).map_err(|p| Error::refused("dims", p))?;
        check_spacing(self.spacing).map_err(|p| Error::refused("spacing", p))?;
        if self.len() != count {
            let problem = format!("{} values, expected {count} for {x} × {y} × {z} voxels", self.len());
            return Err(Error::refused("values", problem));
        }
        check_finite(self.dims, &self.values).map_err(|p| Error::refused("values", p))
    }

    /// Gives voxels that are NaN, infinite or beyond [`FARTHEST`](crate::values::FARTHEST) a value of which `transfer` makes opacity 0
    /// exactly; of all such values one near the smallest. They are then drawn as any voxel without opacity is. Returns how many there
    /// were.
    ///
    /// Errors: [`Error::Config`] naming `transfer` when there are such voxels and no such value.
    pub fn hide_no_numbers(&mut self, transfer: &TransferFunction) -> Result<usize> {
        let count = self.values.replace_no_numbers(f64::NAN);
        if count == 0 {
            return Ok(0);
        }
        let stored = |value: f32| (f64::from(value) - self.intercept) / self.slope;
        // What comes back from the stored number, in its type, may be another value by a rounding.
        let hidden = |stored: &f64| {
            let stored =
                if matches!(self.values, Values::F32(_)) { f64::from(*stored as f32) } else { *stored };
            let value = (self.slope * stored + self.intercept) as f32;
            stored.is_finite() && value.is_finite() && transfer.opacity_at(value) == 0.0
        };
        let low = self.range().0 as f32;
        let Some(value) = transfer.transparent_near(low).into_iter().map(stored).find(hidden) else {
            let problem = format!(
                "has no value of opacity 0 for the {count} voxels that hold no number; expected one, or a value for them"
            );
            return Err(Error::refused("transfer", problem));
        };
        Ok(self.values.replace_no_numbers(value))
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Never true of a volume that was read or made by [`Volume::new`].
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Value of voxel `i` (x fastest). Panics when `i` is not below [`Volume::len`], as a slice does.
    pub fn value(&self, i: usize) -> f64 {
        self.slope * self.values.get(i) + self.intercept
    }

    /// Value of voxel (x, y, z). Panics outside the volume, as a slice does.
    pub fn at(&self, x: usize, y: usize, z: usize) -> f64 {
        assert!(x < self.dims[0] && y < self.dims[1], "voxel ({x}, {y}, {z}) outside {:?}", self.dims);
        self.value(x + self.dims[0] * (y + self.dims[1] * z))
    }

    /// Smallest and largest value; those that are NaN or infinite do not count.
    pub fn range(&self) -> (f64, f64) {
        let (low, high) = self.values.range().unwrap_or((0.0, 0.0));
        let (a, b) = (self.slope * low + self.intercept, self.slope * high + self.intercept);
        (a.min(b), a.max(b))
    }

    /// Smallest of the three spacings in mm.
    pub fn min_spacing(&self) -> f64 {
        self.spacing.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Extent `dims · spacing` in mm: from outer face to outer face.
    pub fn size_mm(&self) -> [f64; 3] {
        std::array::from_fn(|a| self.dims[a] as f64 * self.spacing[a])
    }

    /// World position in mm of an index position: origin at the volume's centre, axes as the volume's, (0, 0, 0) is
    /// the centre of the first voxel.
    pub fn to_world(&self, index: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| (index[a] - (self.dims[a] as f64 - 1.0) / 2.0) * self.spacing[a])
    }

    /// The same volume with its voxels in canonical order: index axes run closest to +right, +anterior, +superior, and are
    /// right-handed. As it is where no patient frame is stated.
    ///
    /// # Errors
    /// [`Error::Config`] when there is no memory for the values once more.
    pub fn into_canonical(self) -> Result<Self> {
        if self.space == Space::Unknown || self.stored.is_some() {
            return Ok(self);
        }
        let steps = Steps::nearest(&self.directions);
        if steps == Steps::NONE {
            return Ok(self);
        }
        let stored = Some(Stored { steps: steps.inverse(), origin: self.origin });
        Ok(Self { stored, ..self.reordered(steps)? })
    }

    /// The same volume with its voxels in the order of its file.
    ///
    /// # Errors
    /// [`Error::Config`] when there is no memory for the values once more.
    pub fn into_stored(self) -> Result<Self> {
        match self.stored {
            None => Ok(self),
            Some(Stored { steps, origin }) => Ok(Self { stored: None, origin, ..self.reordered(steps)? }),
        }
    }

    /// How the voxels lie in the order of the file.
    pub fn stored_layout(&self) -> Layout {
        match self.stored {
            None => self.layout(),
            Some(Stored { steps, origin }) => Layout { origin, ..steps.layout(&self.layout()) },
        }
    }

    /// For each voxel in the order of the file, x fastest, its place in memory.
    pub fn stored_places(&self) -> impl Iterator<Item = usize> + use<> {
        self.stored.map_or(Steps::NONE, |stored| stored.steps).places(self.dims)
    }

    /// Where the index axes of the file point, such as `LAS`: to the left, to anterior, to superior. `None` where no patient
    /// frame is stated.
    pub fn stored_axes(&self) -> Option<String> {
        let steps = Steps::nearest(&self.stored_layout().directions).inverse();
        let letter = |a: usize| if steps.reversed[a] { b"LPI" } else { b"RAS" }[steps.axes[a]];
        (self.space == Space::Ras).then(|| [0, 1, 2].map(letter).map(char::from).iter().collect())
    }

    fn layout(&self) -> Layout {
        let Self { dims, spacing, origin, directions, .. } = *self;
        Layout { dims, spacing, origin, directions }
    }

    fn reordered(mut self, steps: Steps) -> Result<Self> {
        let Layout { dims, spacing, origin, directions } = steps.layout(&self.layout());
        if !self.values.gather(steps.places(self.dims)) {
            return Err(Error::Config {
                what: "values".into(),
                problem: format!(
                    "{} voxels of {} once more, to reorder them, are more memory than the system gives",
                    self.len(),
                    self.values.kind()
                ),
            });
        }
        Ok(Self { dims, spacing, origin, directions, ..self })
    }
}

/// Axes as they come.
pub const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Below and above no voxel grid is meant: 10⁻⁹ mm is a hundredth of an atom, 10⁹ mm a thousand kilometres.
const SPACING_LIMITS_MM: (f64, f64) = (1e-9, 1e9);

/// Product of the dimensions, if that many voxels can be addressed.
pub fn voxel_count(dims: [u64; 3]) -> Result<usize, String> {
    let [x, y, z] = dims;
    if dims.contains(&0) {
        return Err(format!("{x} × {y} × {z}, expected at least 1 voxel along every axis"));
    }
    // 8 is the largest value type in bytes.
    let fits = x.checked_mul(y).and_then(|n| n.checked_mul(z)).filter(|&n| n <= isize::MAX as u64 / 8);
    fits.map(|n| n as usize)
        .ok_or_else(|| format!("{x} × {y} × {z} voxels are more than any memory can hold"))
}

/// Says what is wrong with a spacing in mm.
pub fn check_spacing(spacing: [f64; 3]) -> Result<(), String> {
    let (low, high) = SPACING_LIMITS_MM;
    match spacing.iter().find(|s| !(**s >= low && **s <= high)) {
        Some(s) => Err(format!("{s} mm, expected a positive distance between {low:e} and {high:e} mm")),
        None => Ok(()),
    }
}

/// Says which values are no numbers.
pub fn check_finite(dims: [usize; 3], values: &Values) -> Result<(), String> {
    let Some((first, count)) = values.non_finite() else { return Ok(()) };
    let (x, y, z) = (first % dims[0], first / dims[0] % dims[1], first / dims[0] / dims[1]);
    Err(format!(
        "{count} of {} values are NaN or infinite, the first ({}) at voxel ({x}, {y}, {z}); expected finite values only",
        values.len(),
        values.get(first)
    ))
}
