//! Volumes from files.
//!
//! Formats: NRRD (`.nrrd`, `.nhdr`), NIfTI-1 and -2 (`.nii`, `.nii.gz`, `.hdr` + `.img`), MetaImage (`.mha`, `.mhd`),
//! and raw data with a description beside it ([`read_raw`]). The content decides which reader is used, the file's
//! extension only where a format has no signature.
//!
//! Where a file states how its grid lies in the patient, voxels come in canonical order ([`Volume::into_canonical`]), and
//! [`write_nrrd`](crate::write_nrrd) gives files the stored one back. Stored values keep the file's type; a file's slope and
//! intercept apply on access. What does not fit the header
//! exactly (too short, too long, NaN, an unknown type) is refused with the file and the field named.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::grid::Grid;
use crate::scene::VolumeSource;
use crate::{Error, Result, metaimage, nifti, nrrd, read_raw};
use cao_model::builtin;
use cao_model::values::{Endian, Values};
use cao_model::volume::{Volume, check_finite};

/// A volume by the name a user gives: a file ([`read`]), or `builtin:NAME:SIZE` ([`builtin::from_spec`]).
///
/// Errors: those of [`read`] and [`builtin::from_spec`].
pub fn open(spec: &str) -> Result<Volume> {
    VolumeSource::parse(spec).open()
}

impl VolumeSource {
    /// Makes or reads the volume.
    ///
    /// Errors: those of [`builtin::from_spec`], [`read`] and [`read_raw`].
    pub fn open(&self) -> Result<Volume> {
        match self {
            Self::Builtin(spec) => Ok(builtin::from_spec(spec)?),
            Self::File(path) => read(path),
            Self::Raw { path, dims, kind, spacing_mm, big_endian } => {
                let endian = if *big_endian { Endian::Big } else { Endian::Little };
                read_raw(path, *dims, kind, endian, *spacing_mm)
            }
        }
    }
}

/// Reads a volume file of any format but raw.
///
/// Errors: [`Error::Io`] when the file cannot be opened; [`Error::File`] with the field when the content is of no
/// known format, is incomplete, contradicts itself, or has values that are NaN or infinite.
pub fn read(path: &Path) -> Result<Volume> {
    let io = |source| Error::Io { path: path.into(), source };
    let mut head = Vec::new();
    File::open(path).map_err(io)?.take(HEAD_BYTES).read_to_end(&mut head).map_err(io)?;
    if nrrd::is_nrrd(&head) {
        return nrrd::read(path);
    }
    if nifti::is_nifti(&head) {
        return nifti::read(path);
    }
    if metaimage::is_metaimage(&head) {
        return metaimage::read(path);
    }
    // Damaged at the start, or not of this format at all: the format's own reader says what is wrong with it.
    let name = path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default();
    let ends = |list: &[&str]| list.iter().any(|end| name.ends_with(end));
    if ends(&[".nrrd", ".nhdr"]) {
        nrrd::read(path)
    } else if ends(&[".nii", ".nii.gz", ".hdr", ".hdr.gz", ".img", ".img.gz"]) {
        nifti::read(path)
    } else if ends(&[".mha", ".mhd"]) {
        metaimage::read(path)
    } else {
        Err(bad(path, "format", FORMATS))
    }
}

/// Enough of a file to know its format.
const HEAD_BYTES: u64 = 4096;

const FORMATS: &str = "not recognised, expected NRRD (.nrrd, .nhdr), NIfTI-1 or -2 (.nii, .nii.gz, .hdr with .img) or \
                       MetaImage (.mha, .mhd); raw data need their dimensions, type and spacing beside them";

/// An [`Error::File`].
pub(crate) fn bad(path: &Path, field: &str, problem: impl Into<String>) -> Error {
    Error::File { path: path.into(), field: field.into(), problem: problem.into() }
}

/// The last step of every reader: values that are no numbers are refused, everything else was checked before; then voxels
/// come into canonical order.
pub(crate) fn assemble(
    path: &Path,
    dims: [usize; 3],
    grid: Grid,
    values: Values,
    scale: (f64, f64),
) -> Result<Volume> {
    check_finite(dims, &values).map_err(|p| bad(path, "data", p))?;
    let Grid { spacing, origin, directions, space } = grid;
    let (slope, intercept) = scale;
    let volume = Volume { dims, spacing, origin, directions, space, values, slope, intercept, stored: None };
    if scale != (1.0, 0.0) && !(volume.range().0.is_finite() && volume.range().1.is_finite()) {
        let problem = format!(
            "slope {slope} and intercept {intercept} lead beyond all numbers, expected finite values"
        );
        return Err(bad(path, "data", problem));
    }
    volume.into_canonical().map_err(|error| bad(path, "data", error.to_string()))
}
