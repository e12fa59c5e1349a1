//! Raw data: a file of nothing but values, described by the caller.

use std::path::Path;

use crate::grid::Grid;
use crate::payload::{Encoding, Part, Payload, Skip};
use crate::volume::assemble;
use crate::{Error, Result};
use cao_model::values::{Endian, Kind};
use cao_model::volume::{Volume, check_spacing, voxel_count};

/// Reads a raw file of `dims` voxels (x fastest) of type `kind` (`uint8`, `i16`, `float`, … as in NRRD) with `spacing`
/// in mm.
///
/// Errors: [`cao_model::Error::Config`] for impossible dimensions, type or spacing; [`Error::File`] when the file's size is not
/// exactly dimensions × type, or values are NaN or infinite.
pub fn read_raw(
    path: &Path,
    dims: [usize; 3],
    kind: &str,
    endian: Endian,
    spacing: [f64; 3],
) -> Result<Volume> {
    let count = voxel_count(dims.map(|d| d as u64)).map_err(|p| Error::refused("dims", p))?;
    check_spacing(spacing).map_err(|p| Error::refused("spacing", p))?;
    let kind = Kind::parse(kind)
        .ok_or_else(|| Error::refused("type", format!("{kind:?} is unknown, expected {}", Kind::EXPECTED)))?;
    let parts = vec![Part { path: path.into(), start: 0 }];
    let payload = Payload { kind, endian, encoding: Encoding::Raw, skip: Skip::NOTHING, parts };
    let values = payload.read(path, "data", count)?;
    assemble(path, dims, Grid::plain(spacing), values, (1.0, 0.0))
}
