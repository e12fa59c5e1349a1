//! Volumes from files.
//!
//! Formats: NRRD (`.nrrd`, `.nhdr`), NIfTI-1 and -2 (`.nii`, `.nii.gz`, `.hdr` + `.img`), ANALYZE 7.5 (`.hdr` + `.img`),
//! MetaImage (`.mha`, `.mhd`), TIFF (pages, or a folder of slices), DICOM (feature `dicom`: a folder, or a file of the
//! series), and raw data with a description beside it ([`read_raw`](crate::read_raw)). The content decides which reader is used, the file's
//! extension only where a format has no signature.
//!
//! Where a file states how its grid lies in the patient, voxels come in canonical order ([`Volume::into_canonical`]), and
//! [`write_nrrd`](crate::write_nrrd) gives files the stored one back. Stored values keep the file's type; a file's slope and
//! intercept apply on access. What does not fit the header (too short, NaN, an unknown type) is refused with the file and the
//! field named; what follows the data is ignored with a warning. What a file leaves open, the caller says in a [`Reading`].

use std::path::{Path, PathBuf};

#[cfg(feature = "dicom")]
use crate::dicom;
use crate::grid::Grid;
use crate::raw;
use crate::reading::{Frame, NoNumbers, Opened, Reading};
use crate::scene::VolumeSource;
use crate::{Error, Result, analyze, foreign, listing, metaimage, nifti, nrrd, tiff_stack};
use cao_model::builtin;
use cao_model::values::{Endian, Values};
use cao_model::volume::{Volume, check_finite};

/// A volume by the name a user gives: a file ([`read`]), or `builtin:NAME:SIZE` ([`builtin::from_spec`]). Warnings are left
/// out; [`VolumeSource::open`] has them.
///
/// Errors: those of [`read`] and [`builtin::from_spec`].
pub fn open(spec: impl AsRef<Path>) -> Result<Volume> {
    Ok(VolumeSource::parse(spec).open(&Reading::default())?.volume)
}

impl VolumeSource {
    /// Makes or reads the volume.
    ///
    /// Errors: those of [`builtin::from_spec`], [`read`], [`read_series`] and [`read_raw`](crate::read_raw); [`Error::File`] or
    /// [`cao_model::Error::Config`] naming `frame-index` when what is one volume has not the frame that was chosen.
    pub fn open(&self, reading: &Reading) -> Result<Opened> {
        match self {
            Self::Builtin(spec) => {
                Frame::choose(reading, 1, false).map_err(|p| Error::refused("frame-index", p))?;
                Ok(Opened { volume: builtin::from_spec(spec)?, warnings: Vec::new() })
            }
            Self::File(path) => read_as(path, reading),
            Self::Series { path, series } => any(path, Some(series), reading),
            Self::Raw { path, dims, kind, spacing_mm, big_endian } => {
                let endian = if *big_endian { Endian::Big } else { Endian::Little };
                raw::read_as(path, *dims, kind, endian, *spacing_mm, reading)
            }
        }
    }
}

/// Reads a volume file of any format but raw, as [`read_as`] does by default, and leaves out the warnings.
///
/// Errors: those of [`read_as`].
pub fn read(path: &Path) -> Result<Volume> {
    Ok(read_as(path, &Reading::default())?.volume)
}

/// Reads a volume file of any format but raw, as `reading` says; or a folder of slices (DICOM, TIFF), or those of its files that a
/// pattern names (`*` and `?` in the last part of a path that is no file).
///
/// Errors: [`Error::Io`] when the file cannot be opened; [`Error::File`] with the field when the content is of no
/// known format, is incomplete, contradicts itself, is a series of which no volume is chosen, or has values that are NaN or
/// infinite and nothing stands for them; [`Error::Choice`], with a list, when a folder has several DICOM series.
pub fn read_as(path: &Path, reading: &Reading) -> Result<Opened> {
    any(path, None, reading)
}

/// Reads one DICOM series of a folder, a pattern, or the files beside one: `series` is its UID, or its number in the
/// list that [`read`] refuses several with. Leaves out the warnings.
///
/// Errors: those of [`read`], and [`Error::Choice`] when there is none of this name.
pub fn read_series(path: &Path, series: &str) -> Result<Volume> {
    Ok(any(path, Some(series), &Reading::default())?.volume)
}

fn any(path: &Path, series: Option<&str>, reading: &Reading) -> Result<Opened> {
    if path.is_dir() {
        return several(path, listing::folder(path)?, series, reading);
    }
    if listing::is_pattern(path) {
        return several(path, listing::matching(path)?, series, reading);
    }
    let head = listing::head(path)?;
    #[cfg(feature = "dicom")]
    if dicom::is_dicom(&head) {
        return dicom::read_file(path, series, reading);
    }
    if let Some(series) = series {
        return Err(bad(path, "series", format!("{series:?}, but only DICOM files have series")));
    }
    if nrrd::is_nrrd(&head) {
        return nrrd::read(path, reading);
    }
    if nifti::is_nifti(&head) {
        return nifti::read(path, reading);
    }
    if metaimage::is_metaimage(&head) {
        return metaimage::read(path, reading);
    }
    if tiff_stack::is_tiff(&head) {
        return tiff_stack::read(path, &[path.into()], reading);
    }
    let name = path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default();
    let ends = |list: &[&str]| list.iter().any(|end| name.ends_with(end));
    // The image of a pair has no signature; what it is, its header says.
    let pair = analyze::header_of(path);
    if ends(&[".hdr", ".hdr.gz", ".img", ".img.gz"])
        && listing::head(&pair).is_ok_and(|h| analyze::is_analyze(&pair, &h))
    {
        return analyze::read(&pair, reading);
    }
    // Damaged at the start, or not of this format at all: the format's own reader says what is wrong with it.
    if ends(&[".nrrd", ".nhdr"]) {
        nrrd::read(path, reading)
    } else if ends(&[".nii", ".nii.gz", ".hdr", ".hdr.gz", ".img", ".img.gz"]) {
        nifti::read(path, reading)
    } else if ends(&[".mha", ".mhd"]) {
        metaimage::read(path, reading)
    } else {
        Err(bad(path, "format", foreign::advice(path, &head).unwrap_or(FORMATS.into())))
    }
}

/// The slices among several files.
fn several(path: &Path, files: Vec<PathBuf>, series: Option<&str>, reading: &Reading) -> Result<Opened> {
    #[cfg(feature = "dicom")]
    if let Some(volume) = dicom::read_files(path, &files, series, reading)? {
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
        return tiff_stack::read(path, &slices, reading);
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
    Error::file(path, field, problem)
}

/// What a reader found.
pub(crate) struct Found {
    pub(crate) dims: [usize; 3],
    pub(crate) grid: Grid,
    pub(crate) values: Values,
    /// Slope and intercept.
    pub(crate) scale: (f64, f64),
    pub(crate) warnings: Vec<String>,
}

/// The last step of every reader: what stands for values that are no numbers, everything else was checked before; then voxels
/// come into canonical order.
pub(crate) fn assemble(path: &Path, found: Found, reading: &Reading) -> Result<Opened> {
    let Found { dims, grid, mut values, scale: (slope, intercept), warnings } = found;
    match reading.no_numbers {
        NoNumbers::Refuse => check_finite(dims, &values).map_err(|p| {
            bad(path, "data", p + ", or --nan VALUE|transparent, which says what stands for them")
        })?,
        NoNumbers::Transparent => drop(values.replace_no_numbers(f64::NAN)),
        NoNumbers::Value(value) => {
            let replaced = values.replace_no_numbers((value - intercept) / slope);
            if replaced > 0 && values.non_finite().is_some() {
                let problem = format!("--nan {value} cannot be stored as {}", values.kind());
                return Err(bad(path, "data", problem));
            }
        }
    }
    let Grid { spacing, origin, directions, space } = grid;
    let volume = Volume { dims, spacing, origin, directions, space, values, slope, intercept, stored: None };
    if (slope, intercept) != (1.0, 0.0) && !(volume.range().0.is_finite() && volume.range().1.is_finite()) {
        let problem = format!(
            "slope {slope} and intercept {intercept} lead beyond all numbers, expected finite values"
        );
        return Err(bad(path, "data", problem));
    }
    let volume = volume.into_canonical().map_err(|error| bad(path, "data", error.to_string()))?;
    Ok(Opened { volume, warnings })
}
