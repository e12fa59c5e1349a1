//! TIFF and BigTIFF: the pages of one file, or a file a slice (<https://www.itu.int/itudoc/itu-t/com16/tiff-fx/docs/tiff6.pdf>).
//!
//! The distance of pixels is that of XResolution and YResolution, where they have a unit; the distance of slices is
//! ImageJ's `spacing` or OME's PhysicalSizeZ, else that of pixels. Without any of these all are 1 mm. The format knows
//! no patient.

use std::fs::File;
use std::io::{BufReader, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use tiff::decoder::ifd::Value;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::{ByteOrder, Tag, Type, ValueBuffer};
use tiff::{ColorType, TiffError};

use crate::grid::{Grid, millimetres};
use crate::reading::{Frame, Opened, Reading};
use crate::volume::{Found, assemble, bad};
use crate::{Error, Result, file};
use cao_model::values::{Endian, Kind, Values};
use cao_model::volume::{check_spacing, voxel_count};

/// No codec of these expands further: packed bits 64 times, deflate 1032, LZW 2730 (4096 bytes a code of 12 bits).
const MAX_RATIO: u64 = 2730;
const PER_INCH: u32 = 2;
const MM_PER_INCH: f64 = 25.4;
const WHITE_IS_ZERO: u32 = 0;
const UNCOMPRESSED: u32 = 1;

/// Whether a file begins as one does, in either order of bytes, classic or big.
pub(crate) fn is_tiff(head: &[u8]) -> bool {
    head.starts_with(b"II*\0")
        || head.starts_with(b"MM\0*")
        || head.starts_with(b"II+\0")
        || head.starts_with(b"MM\0+")
}

/// Reads the pages of these files, one after the other; `path` is what the user named.
pub(crate) fn read(path: &Path, files: &[PathBuf], reading: &Reading) -> Result<Opened> {
    Frame::choose(reading, 1, false).map_err(|p| bad(path, "pages", p))?;
    let mut stack = Stack::default();
    // Sizes first, so that nothing is decoded in vain.
    for file in files {
        stack.scan(file)?;
    }
    let Some((first, _)) = stack.first.clone() else {
        return Err(bad(path, "pages", "0, expected 1 or more"));
    };
    let description = stack.description.clone();
    // More than 4 GB: ImageJ writes one page's header, and all pages one after the other.
    let contiguous = number(&description, "images=").filter(|n| stack.pages == 1 && *n > 1.0);
    let pages = contiguous.map_or(stack.pages, |n| n as u64);
    one_channel(path, &description, pages)?;
    let dims = [first.width.into(), first.height.into(), pages];
    let count = voxel_count(dims).map_err(|p| bad(path, "pages", p))?;
    let bytes = count as u64 * u64::from(first.bits / 8);
    let most = stack.on_disk.saturating_mul(if stack.compressed { MAX_RATIO } else { 1 });
    if bytes > most {
        let problem = format!(
            "{bytes} bytes of values in files of {} bytes, which cannot hold that much",
            stack.on_disk
        );
        return Err(bad(path, "pages", problem));
    }
    let mut values = Values::with_capacity(first.kind, count).ok_or_else(|| {
        bad(path, "pages", format!("{bytes} bytes of values are more memory than the system gives"))
    })?;
    for file in files {
        match contiguous {
            Some(_) => read_contiguous(file, first.kind, count, &mut values)?,
            // Checked above to be possible.
            None => read_pages(file, bytes / pages, &mut values)?,
        }
    }
    if values.len() != count {
        return Err(bad(path, "pages", format!("{} values, expected {count}", values.len())));
    }
    let spacing = spacing(path, &stack, &description)?;
    let (dims, grid) = (dims.map(|d| d as usize), Grid::plain(spacing));
    assemble(path, Found { dims, grid, values, scale: (1.0, 0.0), warnings: Vec::new() }, reading)
}

/// What all pages have in common.
#[derive(Clone, Copy, PartialEq)]
struct Page {
    width: u32,
    height: u32,
    kind: Kind,
    /// Of a value in the file: half precision has fewer than its `kind` here.
    bits: u8,
}

#[derive(Default)]
struct Stack {
    /// The first page, and its name for refusals.
    first: Option<(Page, String)>,
    pages: u64,
    on_disk: u64,
    compressed: bool,
    /// Of the first page: what was written into it, pixels a unit along x and y, and what the unit is.
    description: String,
    resolution: [Option<f64>; 2],
    unit: u32,
}

type Pages = Decoder<BufReader<File>>;

/// Opens a file of which no field needs more memory than the file can fill, and no page more than `page` bytes.
fn open(path: &Path, page: u64) -> Result<(Pages, u64)> {
    let (file, length) = file::open(path).map_err(Error::io(path))?;
    // The library has one limit for both; it keeps each byte of a field in 32 of its own.
    let most = usize::try_from(page.max(length.saturating_mul(32))).unwrap_or(usize::MAX);
    let mut limits = Limits::default();
    (limits.decoding_buffer_size, limits.intermediate_buffer_size) = (most, most);
    let decoder = Decoder::new(BufReader::new(file)).map_err(refused(path, 0))?;
    Ok((decoder.with_limits(limits), length))
}

/// A refusal of the library, with the page.
fn refused(path: &Path, page: u64) -> impl Fn(TiffError) -> Error + '_ {
    move |error| match error {
        TiffError::IoError(source) if source.kind() != std::io::ErrorKind::UnexpectedEof => {
            Error::Io { path: path.into(), source }
        }
        other => bad(path, &format!("page {}", page + 1), other.to_string()),
    }
}

impl Stack {
    /// Adds what the headers of a file's pages say.
    fn scan(&mut self, path: &Path) -> Result<()> {
        let (mut file, length) = open(path, 0)?;
        self.on_disk += length;
        let mut index = 0;
        loop {
            let name = format!("page {}", index + 1);
            let tiff = refused(path, index);
            let number = |file: &mut Pages, tag| file.find_tag_unsigned::<u32>(tag).map_err(&tiff);
            if number(&mut file, Tag::PhotometricInterpretation)? == Some(WHITE_IS_ZERO) {
                let problem = "0 is white, expected the larger values to be the brighter ones (BlackIsZero)";
                return Err(bad(path, &name, problem));
            }
            self.compressed |= number(&mut file, Tag::Compression)?.unwrap_or(UNCOMPRESSED) != UNCOMPRESSED;
            let (width, height) = file.dimensions().map_err(&tiff)?;
            let (kind, bits) = kind(&mut file, path, index)?;
            let page = Page { width, height, kind, bits };
            match &self.first {
                None => {
                    self.description = description(&mut file);
                    self.resolution = [Tag::XResolution, Tag::YResolution].map(|tag| ratio(&mut file, tag));
                    self.unit = number(&mut file, Tag::ResolutionUnit)?.unwrap_or(PER_INCH);
                    self.first = Some((page, format!("{name} of {}", path.display())));
                }
                Some((first, _)) if *first == page => {}
                Some((first, of)) => {
                    let shown = |p: Page| format!("{} × {} {}", p.width, p.height, p.kind.name());
                    let problem = format!("{}, expected {} as {of}", shown(page), shown(*first));
                    return Err(bad(path, &name, problem));
                }
            }
            self.pages += 1;
            if !file.more_images() {
                return Ok(());
            }
            file.next_image().map_err(&tiff)?;
            index += 1;
        }
    }
}

/// The type of a page's values, and the bits that each has in the file.
fn kind(file: &mut Pages, path: &Path, index: u64) -> Result<(Kind, u8)> {
    let tiff = refused(path, index);
    let bits = match file.colortype().map_err(&tiff)? {
        ColorType::Gray(bits) => bits,
        other => {
            let problem = format!("{other:?}, expected one value a pixel (grey)");
            return Err(bad(path, &format!("page {}", index + 1), problem));
        }
    };
    let format = file.find_tag_unsigned_vec::<u16>(Tag::SampleFormat).map_err(&tiff)?;
    let kind = match (format.and_then(|f| f.first().copied()).unwrap_or(1), bits) {
        (1 | 4, 8) => Kind::U8,
        (1 | 4, 16) => Kind::U16,
        (1 | 4, 32) => Kind::U32,
        (1 | 4, 64) => Kind::U64,
        (2, 8) => Kind::I8,
        (2, 16) => Kind::I16,
        (2, 32) => Kind::I32,
        (2, 64) => Kind::I64,
        // Half precision has no type of its own here; 32 bits hold it exactly.
        (3, 16 | 32) => Kind::F32,
        (3, 64) => Kind::F64,
        (format, bits) => {
            let problem = format!(
                "SampleFormat {format} with {bits} bits, expected integers of 8, 16, 32 or 64 bits or floating point"
            );
            return Err(bad(path, &format!("page {}", index + 1), problem));
        }
    };
    Ok((kind, bits))
}

fn read_pages(path: &Path, page: u64, values: &mut Values) -> Result<()> {
    let (mut file, _) = open(path, page)?;
    let mut index = 0;
    loop {
        match (file.read_image().map_err(refused(path, index))?, &mut *values) {
            (DecodingResult::U8(page), Values::U8(v)) => v.extend(page),
            (DecodingResult::U16(page), Values::U16(v)) => v.extend(page),
            (DecodingResult::U32(page), Values::U32(v)) => v.extend(page),
            (DecodingResult::U64(page), Values::U64(v)) => v.extend(page),
            (DecodingResult::I8(page), Values::I8(v)) => v.extend(page),
            (DecodingResult::I16(page), Values::I16(v)) => v.extend(page),
            (DecodingResult::I32(page), Values::I32(v)) => v.extend(page),
            (DecodingResult::I64(page), Values::I64(v)) => v.extend(page),
            (DecodingResult::F16(page), Values::F32(v)) => v.extend(page.iter().map(|x| x.to_f32())),
            (DecodingResult::F32(page), Values::F32(v)) => v.extend(page),
            (DecodingResult::F64(page), Values::F64(v)) => v.extend(page),
            (_, values) => {
                let problem = format!("values of another type, expected {}", values.kind());
                return Err(bad(path, &format!("page {}", index + 1), problem));
            }
        }
        if !file.more_images() {
            return Ok(());
        }
        file.next_image().map_err(refused(path, index))?;
        index += 1;
    }
}

/// All pages as they lie behind the one that has a header.
fn read_contiguous(path: &Path, kind: Kind, count: usize, values: &mut Values) -> Result<()> {
    let (mut decoder, length) = open(path, 0)?;
    let start =
        decoder.get_tag_u64_vec(Tag::StripOffsets).map_err(refused(path, 0))?.first().copied().unwrap_or(0);
    let need = count as u64 * kind.bytes() as u64;
    if length.saturating_sub(start) < need {
        let problem = format!(
            "{} bytes, expected {need} ({count} values of type {})",
            length - start.min(length),
            kind.name()
        );
        return Err(bad(path, "data", problem));
    }
    let endian = match decoder.byte_order() {
        ByteOrder::LittleEndian => Endian::Little,
        ByteOrder::BigEndian => Endian::Big,
    };
    let mut file = BufReader::new(file::open(path).map_err(Error::io(path))?.0);
    file.seek(SeekFrom::Start(start)).map_err(Error::io(path))?;
    values.append(&mut file, count, endian).map_err(Error::io(path))?;
    Ok(())
}

/// Refuses what has more than one value at a place: colours, channels, times.
fn one_channel(path: &Path, description: &str, pages: u64) -> Result<()> {
    for key in ["channels=", "frames=", "SizeC=\"", "SizeT=\""] {
        if let Some(n) = number(description, key).filter(|n| *n > 1.0) {
            let key = key.trim_end_matches(['=', '"']);
            let problem =
                format!("{key} {n}, expected 1: one scalar volume (Fiji splits channels and times)");
            return Err(bad(path, "ImageDescription", problem));
        }
    }
    let said = number(description, "slices=").or(number(description, "SizeZ=\""));
    match said.filter(|n| *n != pages as f64) {
        Some(n) => Err(bad(path, "ImageDescription", format!("{n} slices, but there are {pages} pages"))),
        None => Ok(()),
    }
}

/// Text of the page; empty without. As bytes: the library's own way prints when a length is a lie.
fn description(file: &mut Pages) -> String {
    let mut buffer = ValueBuffer::empty(Type::ASCII);
    let found = file.image_ifd().find_tag_buf(Tag::ImageDescription, &mut buffer);
    let bytes = if found.is_ok() { buffer.as_bytes() } else { &[] };
    String::from_utf8_lossy(bytes).trim_end_matches('\0').to_owned()
}

/// A number that is stored as a fraction.
fn ratio(file: &mut Pages, tag: Tag) -> Option<f64> {
    match file.find_tag(tag).ok()?? {
        Value::Rational(a, b) => Some(f64::from(a) / f64::from(b)),
        other => other.into_f64().ok(),
    }
}

fn spacing(path: &Path, stack: &Stack, description: &str) -> Result<[f64; 3]> {
    // A number with its unit in an attribute of OME's XML, which counts in micrometres.
    let ome = |axis: &str| {
        let size = number(description, &format!("PhysicalSize{axis}=\""))?;
        let unit = text(description, &format!("PhysicalSize{axis}Unit=\"")).unwrap_or("µm");
        Some((size, millimetres(unit)))
    };
    let named = |(size, unit): (f64, Option<f64>)| {
        let expected = "a unit of length that is not known, expected m, cm, mm, µm or nm";
        unit.map(|mm| size * mm).ok_or_else(|| bad(path, "ImageDescription", expected))
    };
    let is_imagej = description.starts_with("ImageJ=");
    let unit = match text(description, "unit=").filter(|_| is_imagej) {
        // ImageJ's own escape for µ.
        Some(unit) => unit_of_imagej(unit),
        None => match stack.unit {
            PER_INCH => Some(MM_PER_INCH),
            3 => Some(10.0),
            _ => None,
        },
    };
    let pixel = |axis: usize| {
        let per_unit = stack.resolution[axis].filter(|r| r.is_finite() && *r > 0.0)?;
        Some(unit? / per_unit)
    };
    let x = ome("X").map(named).transpose()?.or(pixel(0)).unwrap_or(1.0);
    let y = ome("Y").map(named).transpose()?.or(pixel(1)).unwrap_or(x);
    let between = number(description, "spacing=").filter(|_| is_imagej).and_then(|n| Some(n.abs() * unit?));
    let z = ome("Z").map(named).transpose()?.or(between).unwrap_or(x);
    check_spacing([x, y, z]).map_err(|p| bad(path, "XResolution, YResolution or ImageDescription", p))?;
    Ok([x, y, z])
}

fn unit_of_imagej(unit: &str) -> Option<f64> {
    match unit {
        "\\u00B5m" => Some(1e-3),
        "inch" | "in" => Some(MM_PER_INCH),
        other => millimetres(other),
    }
}

/// What follows a key up to the end of the line or the quotes.
fn text<'a>(description: &'a str, key: &str) -> Option<&'a str> {
    let starts = |(at, _): &(usize, &str)| {
        let before = description[..*at].chars().next_back();
        !before.is_some_and(char::is_alphanumeric)
    };
    let (at, _) = description.match_indices(key).find(starts)?;
    description[at + key.len()..].split(['\n', '\r', '"']).next().map(str::trim)
}

fn number(description: &str, key: &str) -> Option<f64> {
    text(description, key)?.parse().ok().filter(|n: &f64| n.is_finite())
}
