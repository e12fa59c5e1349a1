//! Volumes from files.
//!
//! Formats: NRRD (`.nrrd`, `.nhdr`), NIfTI-1 and -2 (`.nii`, `.nii.gz`, `.hdr` + `.img`), ANALYZE 7.5 (`.hdr` + `.img`),
//! MetaImage (`.mha`, `.mhd`), TIFF (pages, or a folder of slices), DICOM (feature `dicom`: a folder, or a file of the
//! series), and raw data with a description beside it ([`read_raw`]). The content decides which reader is used, the file's
//! extension only where a format has no signature.
//!
//! Stored values keep the file's type; a file's slope and intercept apply on access. What does not fit the header
//! exactly (too short, too long, NaN, an unknown type) is refused with the file and the field named.

use std::path::{Path, PathBuf};

#[cfg(feature = "dicom")]
use crate::dicom;
use crate::grid::Grid;
use crate::scene::VolumeSource;
use crate::{Error, Result, analyze, foreign, listing, metaimage, nifti, nrrd, read_raw, tiff_stack};
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
    /// Errors: those of [`builtin::from_spec`], [`read`], [`read_series`] and [`read_raw`].
    pub fn open(&self) -> Result<Volume> {
        match self {
            Self::Builtin(spec) => Ok(builtin::from_spec(spec)?),
            Self::File(path) => read(path),
            Self::Series { path, series } => read_series(path, series),
            Self::Raw { path, dims, kind, spacing_mm, big_endian } => {
                let endian = if *big_endian { Endian::Big } else { Endian::Little };
                read_raw(path, *dims, kind, endian, *spacing_mm)
            }
        }
    }
}

/// Reads a volume file of any format but raw; or a folder of slices (DICOM, TIFF), or those of its files that a pattern
/// names (`*` and `?` in the last part of a path that is no file).
///
/// Errors: [`Error::Io`] when the file cannot be opened; [`Error::File`] with the field when the content is of no
/// known format, is incomplete, contradicts itself, or has values that are NaN or infinite; field `series`, with a list,
/// when a folder has several series.
pub fn read(path: &Path) -> Result<Volume> {
    any(path, None)
}

/// Reads one DICOM series of a folder, a pattern, or the files beside one: `series` is its UID, or its number in the
/// list that [`read`] refuses several with.
///
/// Errors: those of [`read`], and field `series` when there is none of this name.
pub fn read_series(path: &Path, series: &str) -> Result<Volume> {
    any(path, Some(series))
}

fn any(path: &Path, series: Option<&str>) -> Result<Volume> {
    if path.is_dir() {
        return several(path, listing::folder(path)?, series);
    }
    if listing::is_pattern(path) {
        return several(path, listing::matching(path)?, series);
    }
    let head = listing::head(path)?;
    #[cfg(feature = "dicom")]
    if dicom::is_dicom(&head) {
        return dicom::read_file(path, series);
    }
    if let Some(series) = series {
        return Err(bad(path, "series", format!("{series:?}, but only DICOM files have series")));
    }
    if nrrd::is_nrrd(&head) {
        return nrrd::read(path);
    }
    if nifti::is_nifti(&head) {
        return nifti::read(path);
    }
    if metaimage::is_metaimage(&head) {
        return metaimage::read(path);
    }
    if tiff_stack::is_tiff(&head) {
        return tiff_stack::read(path, &[path.into()]);
    }
    let name = path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default();
    let ends = |list: &[&str]| list.iter().any(|end| name.ends_with(end));
    // The image of a pair has no signature; what it is, its header says.
    let pair = analyze::header_of(path);
    if ends(&[".hdr", ".hdr.gz", ".img", ".img.gz"])
        && listing::head(&pair).is_ok_and(|h| analyze::is_analyze(&pair, &h))
    {
        return analyze::read(&pair);
    }
    // Damaged at the start, or not of this format at all: the format's own reader says what is wrong with it.
    if ends(&[".nrrd", ".nhdr"]) {
        nrrd::read(path)
    } else if ends(&[".nii", ".nii.gz", ".hdr", ".hdr.gz", ".img", ".img.gz"]) {
        nifti::read(path)
    } else if ends(&[".mha", ".mhd"]) {
        metaimage::read(path)
    } else {
        Err(bad(path, "format", foreign::advice(path, &head).unwrap_or(FORMATS.into())))
    }
}

/// The slices among several files.
fn several(path: &Path, files: Vec<PathBuf>, series: Option<&str>) -> Result<Volume> {
    #[cfg(feature = "dicom")]
    if let Some(volume) = dicom::read_files(path, &files, series)? {
        return Ok(volume);
    }
    if let Some(series) = series {
        return Err(bad(path, "series", format!("{series:?}, but there are no DICOM images")));
    }
    // A stack lies in one folder; deeper ones are other stacks.
    let folder = if path.is_dir() { path } else { path.parent().unwrap_or(path) };
    let mut slices = Vec::new();
    let mut other = foreign::advice_on_folder(path);
    for file in &files {
        let head = listing::head(file)?;
        if file.parent() == Some(folder) && tiff_stack::is_tiff(&head) {
            slices.push(file.clone());
        } else if other.is_none() {
            other = foreign::advice(file, &head);
        }
    }
    if !slices.is_empty() {
        return tiff_stack::read(path, &slices);
    }
    let found = other.map(|advice| format!("; found {advice}")).unwrap_or_default();
    let problem = format!(
        "{} files, none of them a slice; looked for DICOM images (8 folders deep) and TIFF files; \
         a volume in one file is opened by the name of that file{found}",
        files.len()
    );
    Err(bad(path, "format", problem))
}

const FORMATS: &str = "not recognised, expected NRRD (.nrrd, .nhdr), NIfTI-1 or -2 (.nii, .nii.gz, .hdr with .img), \
                       ANALYZE 7.5 (.hdr with .img), MetaImage (.mha, .mhd), TIFF, or DICOM; raw data need their dimensions, \
                       type and spacing beside them";

/// An [`Error::File`].
pub(crate) fn bad(path: &Path, field: &str, problem: impl Into<String>) -> Error {
    Error::File { path: path.into(), field: field.into(), problem: problem.into() }
}

/// The last step of every reader: values that are no numbers are refused, everything else was checked before.
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
    let volume = Volume { dims, spacing, origin, directions, space, values, slope, intercept };
    if scale != (1.0, 0.0) && !(volume.range().0.is_finite() && volume.range().1.is_finite()) {
        let problem = format!(
            "slope {slope} and intercept {intercept} lead beyond all numbers, expected finite values"
        );
        return Err(bad(path, "data", problem));
    }
    Ok(volume)
}
