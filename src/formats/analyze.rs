//! ANALYZE 7.5: a header of 348 bytes (`.hdr`) without the mark of NIfTI, values in `.img`
//! (<https://analyzedirect.com/documents/AnalyzeFileFormat.pdf>).
//!
//! The format does not say which side is left: `orient` is read by nobody and often wrong, so the volume has spacing
//! and no place in a patient. SPM keeps a slope and an intercept in `funused1` and `funused2`; others leave 0 there,
//! which means none. SPM's types 130 (int8), 132 (uint16) and 136 (uint32) are read too.

use std::path::Path;

use crate::Result;
use crate::binary::Binary;
use crate::grid::Grid;
use crate::nifti::{has_extension, partner, start_of};
use crate::parts::Parts;
use crate::payload::{Encoding, Payload, Skip};
use crate::reading::{Frame, Opened, Reading};
use crate::volume::{Found, assemble, bad};
use cao_model::values::{Endian, Kind};
use cao_model::volume::{check_spacing, voxel_count};

const HEADER: usize = 348;

/// The header of such a file, and the order of its bytes.
fn parse(bytes: &[u8]) -> Option<(Binary<&[u8; HEADER]>, i64)> {
    let bytes = bytes.first_chunk::<HEADER>()?;
    let mark = &bytes[344..348];
    if matches!(mark, [b'n', b'i' | b'+', b'1', 0]) {
        return None;
    }
    [Endian::Little, Endian::Big].into_iter().find_map(|endian| {
        let header = Binary { bytes, endian };
        let rank = header.i16(40);
        (header.i32(0) == HEADER as i64 && (1..=7).contains(&rank)).then_some((header, rank))
    })
}

/// Whether a file of this name begins with such a header.
pub(crate) fn is_analyze(path: &Path, head: &[u8]) -> bool {
    ["hdr", "hdr.gz"].iter().any(|end| has_extension(path, end)) && parse(head).is_some()
}

/// The header's file of a pair that is named by its image; the file itself otherwise.
pub(crate) fn header_of(path: &Path) -> std::path::PathBuf {
    let image = ["img", "img.gz"].iter().any(|end| has_extension(path, end));
    if image { partner(path, "hdr") } else { path.into() }
}

/// Reads the pair whose header this is.
pub(crate) fn read(path: &Path, reading: &Reading) -> Result<Opened> {
    let (bytes, _) = start_of(path)?;
    let Some((header, rank)) = parse(&bytes) else {
        return Err(bad(path, "header", "expected 348 bytes of an ANALYZE 7.5 header"));
    };
    let dim = |i: usize| header.i16(40 + 2 * i);
    if rank < 3 {
        return Err(bad(path, "dim[0]", format!("{rank} dimensions, expected 3 (or 4 with dim[4] = 1)")));
    }
    if let Some(i) = (4..=rank as usize).find(|i| !(0..=1).contains(&dim(*i))) {
        let problem = format!("{}, expected 1: one scalar volume, no series and no vectors", dim(i));
        return Err(bad(path, &format!("dim[{i}]"), problem));
    }
    let size = [1, 2, 3].map(|i| u64::try_from(dim(i)).unwrap_or(0));
    let count = voxel_count(size).map_err(|p| bad(path, "dim", p))?;
    let spacing = [1, 2, 3].map(|i| header.f32(76 + 4 * i).abs());
    check_spacing(spacing).map_err(|p| bad(path, "pixdim", p))?;
    let kind = match header.i16(70) {
        2 => Kind::U8,
        4 => Kind::I16,
        8 => Kind::I32,
        16 => Kind::F32,
        64 => Kind::F64,
        130 => Kind::I8,
        132 => Kind::U16,
        136 => Kind::U32,
        code => {
            let problem = format!("{code}, expected 2, 4, 8, 16, 64, 130, 132 or 136 (a scalar type)");
            return Err(bad(path, "datatype", problem));
        }
    };
    let offset = header.f32(108);
    if !((0.0..9e15).contains(&offset) && offset.fract() == 0.0) {
        return Err(bad(path, "vox_offset", format!("{offset}, expected a whole number of bytes")));
    }
    let (slope, intercept) = (header.f32(112), header.f32(116));
    let scale = if slope != 0.0 && slope.is_finite() {
        (slope, if intercept.is_finite() { intercept } else { 0.0 })
    } else {
        (1.0, 0.0)
    };
    let data = partner(path, "img");
    let offset = offset as u64;
    let (encoding, skip, start) = if has_extension(&data, "gz") {
        (Encoding::Deflate, Skip::Ahead { lines: 0, bytes: offset }, 0)
    } else {
        (Encoding::Raw, Skip::NOTHING, offset)
    };
    let frame = Frame::choose(reading, 1, false).map_err(|p| bad(path, "dim[4]", p))?;
    let parts = Parts::one(data, start);
    let payload = Payload { kind, endian: header.endian, encoding, skip, parts, frame, exact: false };
    let mut warnings = Vec::new();
    let values = payload.read(path, "data", count, &mut warnings)?;
    let dims = size.map(|d| d as usize);
    assemble(path, Found { dims, grid: Grid::plain(spacing), values, scale, warnings }, reading)
}
