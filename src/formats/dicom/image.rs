//! What the header of one DICOM file says of its image: how values are stored, and where each frame lies
//! (PS3.3 C.7.6.2, C.7.6.3, C.7.6.16, C.8.8.3, C.11.1).

use std::path::{Path, PathBuf};

use super::data_set::{DOUBLE_PIXELS, DataSet, FLOAT_PIXELS, Header, Pixels, Tag};
use crate::Result;
use crate::volume::bad;

const SOP_INSTANCE: Tag = (0x0008, 0x0018);
const MODALITY: Tag = (0x0008, 0x0060);
const SERIES_DESCRIPTION: Tag = (0x0008, 0x103e);
const SERIES: Tag = (0x0020, 0x000e);
const SERIES_NUMBER: Tag = (0x0020, 0x0011);
const SLICE_THICKNESS: Tag = (0x0018, 0x0050);
const SPACING_BETWEEN_SLICES: Tag = (0x0018, 0x0088);
const POSITION: Tag = (0x0020, 0x0032);
const ORIENTATION: Tag = (0x0020, 0x0037);
const SAMPLES: Tag = (0x0028, 0x0002);
const PHOTOMETRIC: Tag = (0x0028, 0x0004);
const FRAMES: Tag = (0x0028, 0x0008);
const ROWS: Tag = (0x0028, 0x0010);
const COLUMNS: Tag = (0x0028, 0x0011);
const PIXEL_SPACING: Tag = (0x0028, 0x0030);
const ALLOCATED: Tag = (0x0028, 0x0100);
const STORED: Tag = (0x0028, 0x0101);
const HIGH_BIT: Tag = (0x0028, 0x0102);
const SIGNED: Tag = (0x0028, 0x0103);
const INTERCEPT: Tag = (0x0028, 0x1052);
const SLOPE: Tag = (0x0028, 0x1053);
const MODALITY_TABLE: Tag = (0x0028, 0x3000);
const TRANSFORMATION: Tag = (0x0028, 0x9145);
const MEASURES: Tag = (0x0028, 0x9110);
const PLANE_POSITION: Tag = (0x0020, 0x9113);
const PLANE_ORIENTATION: Tag = (0x0020, 0x9116);
const SHARED_GROUPS: Tag = (0x5200, 0x9229);
const FRAME_GROUPS: Tag = (0x5200, 0x9230);
const FRAME_OFFSETS: Tag = (0x3004, 0x000c);
const DOSE_SCALING: Tag = (0x3004, 0x000e);
const EXTENDED_OFFSETS: Tag = (0x7fe0, 0x0001);

/// An image file, in so far as a list of series needs it; the rest is asked of those that were chosen.
pub(super) struct Entry {
    pub(super) series: Series,
    /// Its frames: one, or many in one file.
    pub(super) frames: usize,
    pub(super) image: Result<Image>,
}

/// A series, as one tells it from others.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Series {
    pub(super) uid: String,
    pub(super) number: i64,
    pub(super) modality: String,
    pub(super) description: String,
}

/// The image of a file.
#[derive(Debug, Clone)]
pub(super) struct Image {
    pub(super) path: PathBuf,
    /// UID of the image: two files with the same are copies.
    pub(super) uid: String,
    /// Of the transfer syntax.
    pub(super) syntax: String,
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) sample: Sample,
    pub(super) pixels: Pixels,
    /// Where encapsulated frames begin, if a table of 64 bits says so.
    pub(super) offsets: Vec<u64>,
    pub(super) frames: Vec<Frame>,
}

/// How a value is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sample {
    /// In so many bits of a word, of which `high` is the highest.
    Integer {
        allocated: u16,
        stored: u16,
        high: u16,
        signed: bool,
    },
    Float,
    Double,
}

/// Where a frame lies in the patient, in mm, and what its values mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    /// Centre of the first pixel: left, posterior, superior.
    pub(super) position: [f64; 3],
    /// Direction along a row, direction along a column.
    pub(super) orientation: [[f64; 3]; 2],
    /// Distance of columns, distance of rows.
    pub(super) spacing: [f64; 2],
    /// What the file says of the distance of slices; for where there is only one.
    pub(super) thickness: Option<f64>,
    /// Value = slope · stored + intercept.
    pub(super) rescale: (f64, f64),
}

/// Reads what a file says; `None` when it has no image (reports, contours, directories). A damaged file is an entry of
/// its series, as it may be a slice of it.
pub(super) fn read(path: &Path) -> Result<Option<Entry>> {
    let mut header = Header::read(path)?;
    let fault = header.fault.take();
    let set = header.data_set();
    if let Some(error) = fault {
        return if set.has(SERIES) {
            Ok(Some(Entry { series: Series::of(&set), frames: 1, image: Err(error) }))
        } else {
            Err(error)
        };
    }
    let Some(pixels) = header.pixels.filter(|_| set.has(ROWS)) else { return Ok(None) };
    let frames = set.text(FRAMES).and_then(|n| n.parse().ok()).unwrap_or(1);
    let image = Reading { path, set: &set }.image(&header, pixels, frames);
    Ok(Some(Entry { series: Series::of(&set), frames, image }))
}

impl Series {
    fn of(set: &DataSet) -> Self {
        Self {
            uid: set.text(SERIES).unwrap_or_default(),
            number: set.text(SERIES_NUMBER).and_then(|n| n.parse().ok()).unwrap_or(0),
            modality: set.text(MODALITY).unwrap_or_default(),
            description: set.text(SERIES_DESCRIPTION).unwrap_or_default(),
        }
    }
}

/// A data set and the file to name in refusals.
struct Reading<'a> {
    path: &'a Path,
    set: &'a DataSet<'a>,
}

impl Reading<'_> {
    fn image(&self, header: &Header, pixels: Pixels, frames: usize) -> Result<Image> {
        let Self { path, set } = *self;
        let size = |tag, name: &str| match set.u16(tag) {
            Some(n) if n > 0 => Ok(usize::from(n)),
            found => Err(bad(path, name, format!("{}, expected 1 or more", found.unwrap_or(0)))),
        };
        if set.u16(SAMPLES).unwrap_or(1) != 1 {
            let kind = set.text(PHOTOMETRIC).unwrap_or_default();
            let problem = format!("{kind}, colour; expected one value a pixel (MONOCHROME1 or MONOCHROME2)");
            return Err(bad(path, "PhotometricInterpretation", problem));
        }
        match set.text(PHOTOMETRIC).as_deref() {
            // Which way a display is to show them is not a property of the values.
            None | Some("MONOCHROME1" | "MONOCHROME2") => {}
            Some(other) => {
                let problem = format!("{other:?}, expected MONOCHROME1 or MONOCHROME2");
                return Err(bad(path, "PhotometricInterpretation", problem));
            }
        }
        if set.has(MODALITY_TABLE) {
            let problem = "values mean what a table says, expected RescaleSlope and RescaleIntercept";
            return Err(bad(path, "ModalityLUTSequence", problem));
        }
        Ok(Image {
            path: path.into(),
            uid: set.text(SOP_INSTANCE).unwrap_or_default(),
            syntax: header.syntax.clone(),
            columns: size(COLUMNS, "Columns")?,
            rows: size(ROWS, "Rows")?,
            sample: self.sample(pixels)?,
            pixels,
            offsets: set.u64s(EXTENDED_OFFSETS).unwrap_or_default(),
            frames: self.frames(frames)?,
        })
    }

    fn sample(&self, pixels: Pixels) -> Result<Sample> {
        let Self { path, set } = *self;
        match pixels.tag {
            FLOAT_PIXELS => return Ok(Sample::Float),
            DOUBLE_PIXELS => return Ok(Sample::Double),
            _ => {}
        }
        let allocated = set.u16(ALLOCATED).unwrap_or(0);
        if ![8, 16, 32].contains(&allocated) {
            return Err(bad(path, "BitsAllocated", format!("{allocated}, expected 8, 16 or 32")));
        }
        let stored = set.u16(STORED).unwrap_or(allocated);
        if !(1..=allocated).contains(&stored) {
            return Err(bad(
                path,
                "BitsStored",
                format!("{stored}, expected 1 to {allocated}, as allocated"),
            ));
        }
        let high = set.u16(HIGH_BIT).unwrap_or(stored - 1);
        if !(stored - 1..allocated).contains(&high) {
            let problem = format!("{high}, expected {} to {}", stored - 1, allocated - 1);
            return Err(bad(path, "HighBit", problem));
        }
        let signed = match set.u16(SIGNED) {
            None | Some(0) => false,
            Some(1) => true,
            Some(other) => {
                return Err(bad(path, "PixelRepresentation", format!("{other}, expected 0 or 1")));
            }
        };
        Ok(Sample::Integer { allocated, stored, high, signed })
    }

    fn frames(&self, count: usize) -> Result<Vec<Frame>> {
        let Self { path, set } = *self;
        if count == 0 {
            return Err(bad(path, "NumberOfFrames", "0, expected 1 or more"));
        }
        if set.has(FRAME_GROUPS) {
            return self.enhanced(count);
        }
        let first = self.frame(&[set], None)?;
        // A dose grid: the other frames lie at these distances along the normal.
        if let Some(offsets) = set.numbers(FRAME_OFFSETS).filter(|_| count > 1) {
            if offsets.len() != count {
                let problem = format!("{} numbers, expected {count}, as there are frames", offsets.len());
                return Err(bad(path, "GridFrameOffsetVector", problem));
            }
            let normal = cross(first.orientation[0], first.orientation[1]);
            // Positions along the patient's own axis are the older form: the first is then not 0.
            let frame = |offset: &f64| {
                let along: [f64; 3] = std::array::from_fn(|a| normal[a] * (offset - offsets[0]));
                Frame { position: std::array::from_fn(|a| first.position[a] + along[a]), ..first }
            };
            return Ok(offsets.iter().map(frame).collect());
        }
        if count > 1 {
            let problem = format!(
                "{count}, but nothing says where each lies; expected functional groups (enhanced images) or a dose grid"
            );
            return Err(bad(path, "NumberOfFrames", problem));
        }
        Ok(vec![first])
    }

    /// What a frame has of its own, else what all share.
    fn enhanced(&self, count: usize) -> Result<Vec<Frame>> {
        let Self { path, set } = *self;
        let own = set.items(FRAME_GROUPS);
        if own.len() != count {
            let problem = format!("{} items, expected {count}, as there are frames", own.len());
            return Err(bad(path, "PerFrameFunctionalGroupsSequence", problem));
        }
        let shared = set.item(SHARED_GROUPS);
        let mut frames = Vec::with_capacity(count);
        for (i, own) in own.iter().enumerate() {
            let group = |tag| own.item(tag).or_else(|| shared.as_ref().and_then(|s| s.item(tag)));
            let groups = [PLANE_POSITION, PLANE_ORIENTATION, MEASURES, TRANSFORMATION].map(group);
            let groups: Vec<&DataSet> = groups.iter().flatten().collect();
            frames.push(self.frame(&groups, Some(i))?);
        }
        Ok(frames)
    }

    /// A frame from the sets that describe it.
    fn frame(&self, sets: &[&DataSet], index: Option<usize>) -> Result<Frame> {
        let numbers = |tag| sets.iter().find_map(|set| set.numbers(tag));
        let whose = index.map(|i| format!(" of frame {}", i + 1)).unwrap_or_default();
        let field = |name: &str| format!("{name}{whose}");
        let position = self.exactly(&field("ImagePositionPatient"), numbers(POSITION))?;
        let [a, b, c, d, e, f] = self.exactly(&field("ImageOrientationPatient"), numbers(ORIENTATION))?;
        let [rows, columns] = self.exactly(&field("PixelSpacing"), numbers(PIXEL_SPACING))?;
        let number = |name: &str, tag, otherwise: f64| match numbers(tag) {
            None => Ok(otherwise),
            given => self.exactly(&field(name), given).map(|[x]| x),
        };
        let scaling = number("DoseGridScaling", DOSE_SCALING, 1.0)?;
        let slope = number("RescaleSlope", SLOPE, scaling)?;
        if slope == 0.0 {
            return Err(bad(
                self.path,
                &field("RescaleSlope"),
                "0, expected another number: it makes all values equal",
            ));
        }
        let between = numbers(SPACING_BETWEEN_SLICES).or_else(|| numbers(SLICE_THICKNESS));
        Ok(Frame {
            position,
            orientation: [[a, b, c], [d, e, f]],
            spacing: [columns, rows],
            thickness: between.and_then(|n| n.first().copied()).filter(|mm| *mm > 0.0),
            rescale: (slope, number("RescaleIntercept", INTERCEPT, 0.0)?),
        })
    }

    /// So many finite numbers.
    fn exactly<const N: usize>(&self, field: &str, found: Option<Vec<f64>>) -> Result<[f64; N]> {
        let expected = if N == 1 { "a finite number".into() } else { format!("{N} finite numbers") };
        let Some(found) = found else {
            return Err(bad(
                self.path,
                field,
                format!("missing, expected {expected}: it says where the slice lies"),
            ));
        };
        let numbers = found.as_slice().try_into().ok().filter(|n: &[f64; N]| n.iter().all(|x| x.is_finite()));
        numbers.ok_or_else(|| bad(self.path, field, format!("{found:?}, expected {expected}")))
    }
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
