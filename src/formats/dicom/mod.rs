//! DICOM: the series of a folder, the series that a file belongs to, or one file of many frames
//! (<https://dicom.nema.org/medical/dicom/current/output/html/>).
//!
//! Slices are ordered by their position along the normal; names of files and numbers of images mean nothing. Values
//! are those stored and RescaleSlope and RescaleIntercept on access; where these differ from slice to slice (PET),
//! their results, as 64-bit floating point. MONOCHROME1 changes no value: it only asks a display to show low ones bright.

mod data_set;
mod fragments;
mod image;
mod pixels;
mod stack;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::reading::{Frame, Opened, Reading};
use crate::volume::{Found, assemble, bad};
use crate::{Error, Result, listing};
use cao_model::values::{Kind, Values};
use cao_model::volume::voxel_count;
use image::{Entry, Image};

pub(crate) use data_set::is_dicom;

/// What blank images may expand to whatever the size of their files, in bytes; beyond, [`pixels::MAX_RATIO`] times that.
const BLANK: u64 = 1 << 30;
/// Series that a refusal lists.
const MOST_LISTED: usize = 30;

/// The series that a file belongs to, among the files beside it; a file of many frames alone. A directory file
/// (DICOMDIR) stands for its folder.
pub(crate) fn read_file(path: &Path, series: Option<&str>, reading: &Reading) -> Result<Opened> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Some(entry) = image::read(path)? else {
        if path.file_name().is_some_and(|name| name.to_string_lossy().to_uppercase().starts_with("DICOMDIR"))
        {
            let files = listing::folder(folder)?;
            let volume = read_files(folder, &files, series, reading)?;
            return volume
                .ok_or_else(|| bad(path, "files", "no DICOM images in the folder of this directory file"));
        }
        let problem = "a DICOM file without an image, expected CT, MR, PET or other slices";
        return Err(bad(path, "PixelData", problem));
    };
    if entry.frames > 1 && series.is_none() {
        return volume(path, vec![entry], reading);
    }
    let mut found = entries(&listing::beside(folder)?)?;
    if series.is_none() {
        found.retain(|other| other.series.uid == entry.series.uid);
        return volume(path, found, reading);
    }
    chosen(path, found, series, reading)
}

/// The series among these files, found in `folder`; `None` when none of them is a DICOM image.
pub(crate) fn read_files(
    folder: &Path,
    files: &[PathBuf],
    series: Option<&str>,
    reading: &Reading,
) -> Result<Option<Opened>> {
    let entries = entries(files)?;
    if entries.is_empty() { Ok(None) } else { chosen(folder, entries, series, reading).map(Some) }
}

/// The images among these files. A damaged one is refused: nobody knows whether it was a slice of the series.
fn entries(files: &[PathBuf]) -> Result<Vec<Entry>> {
    let mut found = Vec::new();
    for file in files {
        if is_dicom(&listing::head(file)?) {
            found.extend(image::read(file)?);
        }
    }
    Ok(found)
}

fn chosen(path: &Path, entries: Vec<Entry>, series: Option<&str>, reading: &Reading) -> Result<Opened> {
    let mut all: BTreeMap<(i64, String), Vec<Entry>> = BTreeMap::new();
    for entry in entries {
        all.entry((entry.series.number, entry.series.uid.clone())).or_default().push(entry);
    }
    let mut all: Vec<Vec<Entry>> = all.into_values().collect();
    let refused = |problem: String| {
        Err(Error::Choice { path: path.into(), field: "series".into(), problem, choices: listed(&all) })
    };
    let index = match series {
        None if all.len() == 1 => 0,
        None => {
            return refused(format!(
                "{} in this folder, choose one by its number or UID (--series):",
                all.len()
            ));
        }
        Some(wanted) => {
            let by_number = wanted.parse().ok().filter(|n| (1..=all.len()).contains(n)).map(|n: usize| n - 1);
            let found = all.iter().position(|s| s[0].series.uid == wanted).or(by_number);
            let Some(index) = found else {
                return refused(format!(
                    "{wanted:?} is none of them, expected a number or UID of this list:"
                ));
            };
            index
        }
    };
    volume(path, all.swap_remove(index), reading)
}

/// One line a series, as `--series` numbers them.
fn listed(all: &[Vec<Entry>]) -> Vec<String> {
    let line = |(i, entries): (usize, &Vec<Entry>)| {
        let series = &entries[0].series;
        let short = |text: &str| text.chars().take(64).collect::<String>().escape_debug().to_string();
        let size = match &entries[0].image {
            Ok(image) => format!(" of {} × {}", image.columns, image.rows),
            Err(_) => String::new(),
        };
        let images: usize = entries.iter().map(|entry| entry.frames).sum();
        let what = format!("{} \"{}\"", short(&series.modality), short(&series.description));
        format!("{}: {what}, {images} images{size}, {}", i + 1, short(&series.uid))
    };
    let mut lines: Vec<String> = all.iter().enumerate().take(MOST_LISTED).map(line).collect();
    if all.len() > MOST_LISTED {
        lines.push(format!("and {} more", all.len() - MOST_LISTED));
    }
    lines
}

/// The volume of these images.
fn volume(path: &Path, entries: Vec<Entry>, reading: &Reading) -> Result<Opened> {
    Frame::choose(reading, 1, false).map_err(|p| bad(path, "frames", p))?;
    let images = entries.into_iter().map(|entry| entry.image).collect::<Result<Vec<Image>>>()?;
    let (order, grid) = stack::stack(path, &images)?;
    let first = &images[0];
    let dims = [first.columns, first.rows, order.len()];
    let count = voxel_count(dims.map(|d| d as u64)).map_err(|p| bad(path, "size", p))?;
    let rescale = stack::common_rescale(&images);
    let stored = first.kind();
    let kind = if rescale.is_some() { stored } else { Kind::F64 };
    let mut on_disk = 0;
    for image in &images {
        on_disk += std::fs::metadata(&image.path).map_err(Error::io(&image.path))?.len();
    }
    let bytes = count as u64 * kind.bytes() as u64;
    let room = (bytes <= BLANK + on_disk.saturating_mul(pixels::MAX_RATIO))
        .then(|| Values::with_capacity(kind, count));
    let Some(mut values) = room.flatten() else {
        let problem =
            format!("{bytes} bytes of values are more than {on_disk} bytes of files or the memory can hold");
        return Err(bad(path, "size", problem));
    };
    let mut open: Option<(usize, pixels::Frames)> = None;
    for (image, index) in order {
        let mut frames = match open.take() {
            Some((i, frames)) if i == image => frames,
            _ => pixels::Frames::open(&images[image])?,
        };
        if rescale.is_some() {
            frames.append(index, &mut values)?;
        } else {
            let mut slice = Values::with_capacity(stored, first.frame_len())
                .ok_or_else(|| bad(path, "size", "a slice is more than the memory can hold"))?;
            frames.append(index, &mut slice)?;
            let (slope, intercept) = images[image].frames[index].rescale;
            if let Values::F64(values) = &mut values {
                values.extend((0..slice.len()).map(|i| slope * slice.get(i) + intercept));
            }
        }
        open = Some((image, frames));
    }
    let scale = rescale.unwrap_or((1.0, 0.0));
    assemble(path, Found { dims, grid, values, scale, warnings: Vec::new() }, reading)
}
