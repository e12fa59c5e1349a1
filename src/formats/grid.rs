//! From the vectors and units of a header to spacing, unit directions and one anatomical frame.

use cao_model::volume::{IDENTITY, Space};

/// Cosine between two index axes beyond which a grid counts as sheared (0.1°, a voxel in 570): distances are taken along the
/// axes, as if they were at right angles. Headers with three digits stay below it.
const MAX_AXIS_COSINE: f64 = 0.001_75;

/// Where the voxels of a file are.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Grid {
    pub(crate) spacing: [f64; 3],
    pub(crate) origin: [f64; 3],
    pub(crate) directions: [[f64; 3]; 3],
    pub(crate) space: Space,
}

impl Grid {
    /// Nothing known but the spacing.
    pub(crate) fn plain(spacing: [f64; 3]) -> Self {
        Grid { spacing, origin: [0.0; 3], directions: IDENTITY, space: Space::Unknown }
    }

    /// Turned into RAS from a frame whose axes point as `flip` says (−1: opposite to RAS).
    pub(crate) fn flipped(mut self, flip: [f64; 3]) -> Self {
        self.origin = times(self.origin, flip);
        self.directions = self.directions.map(|d| times(d, flip));
        self.space = Space::Ras;
        self
    }

    /// All lengths times `factor`, to turn a unit into mm.
    pub(crate) fn scaled(mut self, factor: f64) -> Self {
        self.spacing = self.spacing.map(|s| s * factor);
        self.origin = self.origin.map(|o| o * factor);
        self
    }
}

/// Millimetres in a unit of length; `None` when the name is not one.
pub(crate) fn millimetres(unit: &str) -> Option<f64> {
    Some(match unit.trim().to_lowercase().as_str() {
        "m" | "meter" | "meters" | "metre" | "metres" => 1000.0,
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => 10.0,
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => 1.0,
        // Both signs for micro.
        "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometers" | "micrometre"
        | "micrometres" => 1e-3,
        "nm" | "nanometer" | "nanometers" | "nanometre" | "nanometres" => 1e-6,
        _ => return None,
    })
}

/// Lengths and unit vectors of three axis vectors; says why when they do not span a grid with right angles.
pub(crate) fn axes(vectors: [[f64; 3]; 3]) -> Result<([f64; 3], [[f64; 3]; 3]), String> {
    let lengths = vectors.map(|v| dot(v, v).sqrt());
    if let Some(axis) = lengths.iter().position(|l| !l.is_finite() || *l == 0.0) {
        return Err(format!(
            "the vector of axis {axis} is {:?}, expected a finite one that is not 0",
            vectors[axis]
        ));
    }
    let units: [[f64; 3]; 3] = std::array::from_fn(|a| vectors[a].map(|x| x / lengths[a]));
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        let cosine = dot(units[a], units[b]);
        if cosine.abs() > MAX_AXIS_COSINE {
            let degrees = cosine.clamp(-1.0, 1.0).acos().to_degrees();
            return Err(format!(
                "axes {a} and {b} meet at {degrees:.1}°, expected 90° (a sheared grid, as of a tilted gantry, has to be \
                 resampled first)"
            ));
        }
    }
    Ok((lengths, units))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn times(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    // The sum turns -0 into 0, which is what people read.
    std::array::from_fn(|i| a[i] * b[i] + 0.0)
}
