//! MetaImage: <https://itk.org/Wiki/ITK/MetaIO/Documentation>.
//!
//! The frame is LPS, as ITK reads it, and is turned into RAS; a header without position and orientation has none.
//! Keys that say nothing about the grid or the data are free in this format and are passed over.

use std::path::Path;

use crate::Result;
use crate::grid::{self, Grid};
use crate::parts::Parts;
use crate::payload::{Encoding, Payload, Skip};
use crate::reading::{Frame, Opened, Reading};
use crate::text::{Fields, Lines, data_files, quoted};
use crate::volume::{Found, assemble, bad};
use cao_model::error::shown_path;
use cao_model::values::{Endian, Kind};
use cao_model::volume::{IDENTITY, check_spacing, voxel_count};

/// Keys that are used here, and those that files begin with.
const KEYS: [&str; 26] = [
    "ObjectType",
    "NDims",
    "DimSize",
    "ElementType",
    "ElementNumberOfChannels",
    "ElementDataFile",
    "ElementSpacing",
    "ElementSize",
    "ElementByteOrderMSB",
    "BinaryDataByteOrderMSB",
    "BinaryData",
    "CompressedData",
    "CompressedDataSize",
    "HeaderSize",
    "Offset",
    "Position",
    "Origin",
    "TransformMatrix",
    "Rotation",
    "Orientation",
    "DistanceUnits",
    "ElementToIntensityFunctionSlope",
    "ElementToIntensityFunctionOffset",
    "Comment",
    "ObjectSubType",
    "Name",
];

/// Whether a file begins as MetaImage files do, which have no signature: with a line `Key = value` of a known key.
pub(crate) fn is_metaimage(head: &[u8]) -> bool {
    let line = head.split(|b| *b == b'\n').next().unwrap_or_default();
    let Ok(line) = std::str::from_utf8(line) else { return false };
    line.split_once('=').is_some_and(|(key, _)| known(key.trim()).is_some())
}

fn known(key: &str) -> Option<&'static str> {
    KEYS.iter().copied().find(|k| k.eq_ignore_ascii_case(key))
}

/// Reads a file with the data in it or beside it.
pub(crate) fn read(path: &Path, reading: &Reading) -> Result<Opened> {
    let header = Header::read(path)?;
    let fields = &header.fields;
    let object = fields.get("ObjectType").unwrap_or("Image");
    if !object.eq_ignore_ascii_case("Image") {
        return Err(bad(path, "ObjectType", format!("{}, expected Image", quoted(object))));
    }
    if let Some([n]) = fields.array::<u64, 1>("ElementNumberOfChannels", "a whole number")?
        && n != 1
    {
        return Err(bad(path, "ElementNumberOfChannels", format!("{n}, expected 1: scalar volumes")));
    }
    let sizes = header.sizes()?;
    let dims = [sizes[0], sizes[1], sizes[2]];
    let count = voxel_count(dims).map_err(|p| bad(path, "DimSize", p))?;
    let frame = header.frame(&sizes, reading)?;
    let grid = header.grid(sizes.len())?;
    let scale = header.scale()?;
    let payload = header.payload(&sizes, count, frame)?;
    let mut warnings = Vec::new();
    let values = payload.read(path, "ElementDataFile", count, &mut warnings)?;
    assemble(path, Found { dims: dims.map(|d| d as usize), grid, values, scale, warnings }, reading)
}

/// Most axes of an image in ITK's reader.
const MAX_AXES: u64 = 10;

struct Header<'a> {
    fields: Fields<'a>,
    /// File names after `ElementDataFile = LIST`.
    list: Vec<String>,
    /// Byte after the header.
    end: u64,
}

impl<'a> Header<'a> {
    fn read(path: &'a Path) -> Result<Self> {
        let mut lines = Lines::open(path)?;
        let mut fields = Fields::new(path);
        while let Some(line) = lines.next()? {
            if line.trim().is_empty() {
                continue;
            }
            let Some((key, value)) = line.split_once('=') else {
                return Err(bad(path, "header", format!("line {}, expected `Key = value`", quoted(&line))));
            };
            let Some(key) = known(key.trim()) else { continue };
            fields.insert(key, value)?;
            // By the format's rule the last one: data follow.
            if key == "ElementDataFile" {
                let end = lines.position();
                let list = if value.trim().starts_with("LIST") { lines.rest()? } else { Vec::new() };
                return Ok(Header { fields, list, end });
            }
        }
        Err(bad(path, "ElementDataFile", "missing, expected as the last line of the header"))
    }

    fn path(&self) -> &'a Path {
        self.fields.path
    }

    /// The first of several names for the same thing that the header has.
    fn first_of<const N: usize>(&self, names: [&'static str; N]) -> Option<&'static str> {
        names.into_iter().find(|n| self.fields.get(n).is_some())
    }

    fn flag(&self, name: &str) -> Result<Option<bool>> {
        let Some(text) = self.fields.get(name) else { return Ok(None) };
        match text.to_ascii_lowercase().as_str() {
            "true" | "t" | "1" => Ok(Some(true)),
            "false" | "f" | "0" => Ok(Some(false)),
            _ => Err(bad(self.path(), name, format!("{}, expected True or False", quoted(text)))),
        }
    }

    /// Voxels along every axis, of which there are three or more.
    fn sizes(&self) -> Result<Vec<u64>> {
        let (path, fields) = (self.path(), &self.fields);
        let [axes] = fields.array::<u64, 1>("NDims", "a whole number")?.unwrap_or([3]);
        if !(3..=MAX_AXES).contains(&axes) {
            return Err(bad(path, "NDims", format!("{axes}, expected 3: a volume (or 4: a series of them)")));
        }
        let sizes = fields.list("DimSize", axes as usize, "whole numbers of voxels")?;
        sizes.ok_or_else(|| bad(path, "DimSize", "missing, expected in every header"))
    }

    /// Which volume along the one further axis that has more than one sample.
    fn frame(&self, sizes: &[u64], reading: &Reading) -> Result<Frame> {
        let further: Vec<u64> = sizes[3..].iter().copied().filter(|n| *n != 1).collect();
        let count = match further[..] {
            [] => 1,
            [n] => n,
            _ => {
                let problem = format!("{sizes:?}, expected at most one axis beyond those of space");
                return Err(bad(self.path(), "DimSize", problem));
            }
        };
        Frame::choose(reading, count, false).map_err(|p| bad(self.path(), "DimSize", p))
    }

    /// The grid of the first three of these axes.
    fn grid(&self, axes: usize) -> Result<Grid> {
        let (path, fields) = (self.path(), &self.fields);
        let spatial = |list: Vec<f64>| -> [f64; 3] { std::array::from_fn(|i| list[i]) };
        let field = self.first_of(["ElementSpacing", "ElementSize"]).unwrap_or("ElementSpacing");
        let spacing = fields.list(field, axes, "numbers")?.map_or([1.0; 3], spatial);
        let unit = match fields.get("DistanceUnits") {
            None | Some("?" | "") => 1.0,
            Some(name) => grid::millimetres(name).ok_or_else(|| {
                bad(path, "DistanceUnits", format!("{}, expected mm, cm or um", quoted(name)))
            })?,
        };
        let mut grid = Grid::plain(spacing);
        let origin = self.first_of(["Offset", "Position", "Origin"]);
        if let Some(name) = origin {
            grid.origin = fields.list(name, axes, "numbers")?.map_or([0.0; 3], spatial);
            if grid.origin.iter().any(|x: &f64| !x.is_finite()) {
                return Err(bad(path, name, "not finite, expected a position"));
            }
        }
        let matrix = self.first_of(["TransformMatrix", "Rotation", "Orientation"]);
        if let Some(name) = matrix {
            // Row a is the direction of index axis a, as ITK writes it.
            let m: Vec<f64> = fields.list(name, axes * axes, "numbers")?.unwrap_or_default();
            let row = |a: usize| &m[a * axes..(a + 1) * axes];
            let mixed = (0..axes).any(|a| (0..axes).any(|b| (a < 3) != (b < 3) && row(a)[b] != 0.0));
            if mixed {
                let problem = "an axis of space leads into the series, expected the axes of space apart from the others";
                return Err(bad(path, name, problem));
            }
            let rows = [0, 1, 2].map(|a| std::array::from_fn(|b| row(a)[b]));
            grid.directions =
                if rows == IDENTITY { IDENTITY } else { grid::axes(rows).map_err(|p| bad(path, name, p))?.1 };
        }
        let grid = grid.scaled(unit);
        check_spacing(grid.spacing).map_err(|p| bad(path, field, p))?;
        let placed = origin.is_some() || matrix.is_some();
        Ok(if placed { grid.flipped([-1.0, -1.0, 1.0]) } else { grid })
    }

    fn scale(&self) -> Result<(f64, f64)> {
        let number = |name: &str, default: f64| match self.fields.array::<f64, 1>(name, "a number")? {
            Some([x]) if !x.is_finite() => {
                Err(bad(self.path(), name, format!("{x}, expected a finite number")))
            }
            Some([x]) => Ok(x),
            None => Ok(default),
        };
        Ok((
            number("ElementToIntensityFunctionSlope", 1.0)?,
            number("ElementToIntensityFunctionOffset", 0.0)?,
        ))
    }

    fn payload(&self, sizes: &[u64], count: usize, frame: Frame) -> Result<Payload> {
        let (path, fields) = (self.path(), &self.fields);
        let name = fields.require("ElementType")?;
        let kind = kind(name).ok_or_else(|| {
            let expected = "MET_CHAR, MET_UCHAR, MET_SHORT, MET_USHORT, MET_INT, MET_UINT, MET_LONG, MET_ULONG, \
                            MET_LONG_LONG, MET_ULONG_LONG, MET_FLOAT or MET_DOUBLE";
            bad(path, "ElementType", format!("{}, expected {expected}", quoted(name)))
        })?;
        let order = self.first_of(["BinaryDataByteOrderMSB", "ElementByteOrderMSB"]);
        let big = order.map_or(Ok(None), |name| self.flag(name))?.unwrap_or(false);
        let endian = if big { Endian::Big } else { Endian::Little };
        let compressed = self.flag("CompressedData")?.unwrap_or(false);
        let encoding = match (self.flag("BinaryData")?.unwrap_or(true), compressed) {
            (true, false) => Encoding::Raw,
            (true, true) => Encoding::Deflate,
            (false, false) => Encoding::Ascii,
            (false, true) => {
                return Err(bad(
                    path,
                    "CompressedData",
                    "True beside BinaryData = False, expected one of both",
                ));
            }
        };
        let data_file = fields.require("ElementDataFile")?;
        let local = data_file.eq_ignore_ascii_case("LOCAL");
        let mut parts = if local {
            Parts::one(path.into(), self.end)
        } else {
            data_files(path, "ElementDataFile", data_file, &self.list, sizes)?
        };
        let [header_size] = fields.array::<i64, 1>("HeaderSize", "a number of bytes, or -1")?.unwrap_or([0]);
        let mut skip = Skip::NOTHING;
        match header_size {
            0 => {}
            -1 if encoding == Encoding::Raw => skip = Skip::AllButLast,
            // Counted from the start of the file, as MetaIO does, also when header and data share it.
            1.. => parts.start = header_size as u64,
            _ => {
                let problem =
                    format!("{header_size}, expected 0 or more, or -1 for data that are not compressed");
                return Err(bad(path, "HeaderSize", problem));
            }
        }
        let size = fields.array::<u64, 1>("CompressedDataSize", "a number of bytes")?;
        // A size of 0 is what writers leave that did not know it.
        if let (Encoding::Deflate, Some([size]), 1) = (encoding, size, parts.len())
            && let Ok(meta) = std::fs::metadata(parts.path(0))
            && meta.len().saturating_sub(parts.start) < size
        {
            let have = meta.len().saturating_sub(parts.start);
            let problem =
                format!("{size} bytes, but {} holds {have} for {count} values", shown_path(parts.path(0)));
            return Err(bad(path, "CompressedDataSize", problem));
        }
        Ok(Payload { kind, endian, encoding, skip, parts, frame, exact: false })
    }
}

/// MetaIO's types; its LONG has 4 bytes on every system.
fn kind(name: &str) -> Option<Kind> {
    Some(match name.to_ascii_uppercase().as_str() {
        "MET_CHAR" | "MET_ASCII_CHAR" => Kind::I8,
        "MET_UCHAR" => Kind::U8,
        "MET_SHORT" => Kind::I16,
        "MET_USHORT" => Kind::U16,
        "MET_INT" | "MET_LONG" => Kind::I32,
        "MET_UINT" | "MET_ULONG" => Kind::U32,
        "MET_LONG_LONG" => Kind::I64,
        "MET_ULONG_LONG" => Kind::U64,
        "MET_FLOAT" => Kind::F32,
        "MET_DOUBLE" => Kind::F64,
        _ => return None,
    })
}
