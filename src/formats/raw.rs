//! Raw data: a file of nothing but values, described by the caller.

use std::path::Path;

use crate::grid::Grid;
use crate::parts::Parts;
use crate::payload::{Encoding, Payload, Skip};
use crate::reading::{Frame, Opened, Reading};
use crate::volume::{Found, assemble, bad};
use crate::{Error, Result};
use cao_model::error::quoted;
use cao_model::values::{Endian, Kind};
use cao_model::volume::{Volume, check_spacing, voxel_count};

/// Reads a raw file of `dims` voxels (x fastest) of type `kind` (`uint8`, `i16`, `float`, … as in NRRD) with `spacing`
/// in mm.
///
/// Errors: [`cao_model::Error::Config`] for impossible dimensions, type or spacing; [`Error::File`] when the file's size is not
/// exactly dimensions × type (nothing else tells whether the dimensions are right), or values are NaN or infinite.
pub fn read_raw(
    path: &Path,
    dims: [usize; 3],
    kind: &str,
    endian: Endian,
    spacing: [f64; 3],
) -> Result<Volume> {
    Ok(read_as(path, dims, kind, endian, spacing, &Reading::default())?.volume)
}

/// As [`read_raw`], with what the caller chose.
pub(crate) fn read_as(
    path: &Path,
    dims: [usize; 3],
    kind: &str,
    endian: Endian,
    spacing: [f64; 3],
    reading: &Reading,
) -> Result<Opened> {
    let count = voxel_count(dims.map(|d| d as u64)).map_err(|p| Error::refused("dims", p))?;
    check_spacing(spacing).map_err(|p| Error::refused("spacing", p))?;
    let kind = Kind::parse(kind).ok_or_else(|| {
        Error::refused("type", format!("{} is unknown, expected {}", quoted(kind), Kind::EXPECTED))
    })?;
    let frame = Frame::choose(reading, 1, false).map_err(|p| bad(path, "data", p))?;
    let parts = Parts::one(path.into(), 0);
    let payload =
        Payload { kind, endian, encoding: Encoding::Raw, skip: Skip::NOTHING, parts, frame, exact: true };
    let mut warnings = Vec::new();
    let values = payload.read(path, "data", count, &mut warnings)?;
    let found = Found { dims, grid: Grid::plain(spacing), values, scale: (1.0, 0.0), warnings };
    assemble(path, found, reading)
}
