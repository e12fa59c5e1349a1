//! MetaImage: <https://itk.org/Wiki/ITK/MetaIO/Documentation>.
//!
//! The frame is LPS, as ITK reads it, and is turned into RAS; a header without position and orientation has none.
//! Keys that say nothing about the grid or the data are free in this format and are passed over.

use std::path::Path;

use crate::Result;
use crate::error::printable;
use crate::grid::{self, Grid};
use crate::payload::{Encoding, Part, Payload, Skip};
use crate::text::{Fields, Lines, data_files, quoted};
use crate::volume::{assemble, bad};
use cao_model::values::{Endian, Kind};
use cao_model::volume::{IDENTITY, Volume, check_spacing, voxel_count};

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
pub(crate) fn read(path: &Path) -> Result<Volume> {
    let header = Header::read(path)?;
    let fields = &header.fields;
    let object = fields.get("ObjectType").unwrap_or("Image");
    if !object.eq_ignore_ascii_case("Image") {
        return Err(bad(path, "ObjectType", format!("{}, expected Image", quoted(object))));
    }
    for (name, expected) in [("NDims", 3), ("ElementNumberOfChannels", 1)] {
        if let Some([n]) = fields.array::<u64, 1>(name, "a whole number")?
            && n != expected
        {
            return Err(bad(path, name, format!("{n}, expected {expected}: a scalar volume")));
        }
    }
    let dims = fields.array::<u64, 3>("DimSize", "whole numbers of voxels")?;
    let dims = dims.ok_or_else(|| bad(path, "DimSize", "missing, expected in every header"))?;
    let count = voxel_count(dims).map_err(|p| bad(path, "DimSize", p))?;
    let grid = header.grid()?;
    let scale = header.scale()?;
    let payload = header.payload(&dims, count)?;
    let values = payload.read(path, "ElementDataFile", count)?;
    assemble(path, dims.map(|d| d as usize), grid, values, scale)
}

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

    fn grid(&self) -> Result<Grid> {
        let (path, fields) = (self.path(), &self.fields);
        let field = self.first_of(["ElementSpacing", "ElementSize"]).unwrap_or("ElementSpacing");
        let spacing = fields.array(field, "numbers")?.unwrap_or([1.0; 3]);
        let unit = match fields.get("DistanceUnits") {
            None | Some("?" | "") => 1.0,
            Some(name) => grid::millimetres(name).ok_or_else(|| {
                bad(path, "DistanceUnits", format!("{}, expected mm, cm or um", quoted(name)))
            })?,
        };
        let mut grid = Grid::plain(spacing);
        let origin = self.first_of(["Offset", "Position", "Origin"]);
        if let Some(name) = origin {
            grid.origin = fields.array(name, "numbers")?.unwrap_or_default();
            if grid.origin.iter().any(|x: &f64| !x.is_finite()) {
                return Err(bad(path, name, "not finite, expected a position"));
            }
        }
        let matrix = self.first_of(["TransformMatrix", "Rotation", "Orientation"]);
        if let Some(name) = matrix {
            // Row a is the direction of index axis a, as ITK writes it.
            let m: [f64; 9] = fields.array(name, "numbers")?.unwrap_or_default();
            let rows = [[m[0], m[1], m[2]], [m[3], m[4], m[5]], [m[6], m[7], m[8]]];
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

    fn payload(&self, dims: &[u64; 3], count: usize) -> Result<Payload> {
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
            vec![Part { path: path.into(), start: self.end }]
        } else {
            data_files(path, "ElementDataFile", data_file, &self.list, dims)?
        };
        let [header_size] = fields.array::<i64, 1>("HeaderSize", "a number of bytes, or -1")?.unwrap_or([0]);
        let mut skip = Skip::NOTHING;
        match header_size {
            0 => {}
            -1 if encoding == Encoding::Raw => skip = Skip::AllButLast,
            // Counted from the start of the file, as MetaIO does, also when header and data share it.
            1.. => parts.iter_mut().for_each(|p| p.start = header_size as u64),
            _ => {
                let problem =
                    format!("{header_size}, expected 0 or more, or -1 for data that are not compressed");
                return Err(bad(path, "HeaderSize", problem));
            }
        }
        let size = fields.array::<u64, 1>("CompressedDataSize", "a number of bytes")?;
        // A size of 0 is what writers leave that did not know it.
        if let (Encoding::Deflate, Some([size]), [part]) = (encoding, size, parts.as_slice())
            && size > 0
            && let Ok(meta) = std::fs::metadata(&part.path)
            && meta.len().saturating_sub(part.start) != size
        {
            let have = meta.len().saturating_sub(part.start);
            let problem =
                format!("{size} bytes, but {} holds {have} for {count} values", printable(&part.path));
            return Err(bad(path, "CompressedDataSize", problem));
        }
        Ok(Payload { kind, endian, encoding, skip, parts })
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
