//! NIfTI-1 and NIfTI-2, in one file (`.nii`, `.nii.gz`) or two (`.hdr` and `.img`):
//! <https://nifti.nimh.nih.gov/nifti-1>, <https://nifti.nimh.nih.gov/nifti-2>.
//!
//! Spacing is `pixdim`; origin and directions are those of the sform, else of the qform, both in RAS.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::grid::{self, Grid};
use crate::payload::{Encoding, Part, Payload, Skip};
use crate::volume::{assemble, bad};
use crate::{Error, Result};
use cao_model::values::{Endian, Kind};
use cao_model::volume::{Space, Volume, check_spacing, voxel_count};

const HEADER_1: usize = 348;
const HEADER_2: usize = 540;
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Whether a file begins with a NIfTI header, compressed or not.
pub(crate) fn is_nifti(head: &[u8]) -> bool {
    let mut start = Vec::new();
    if head.starts_with(&GZIP) {
        // Cut off in mid-stream, so an error after the header is expected.
        let _ = flate2::read::GzDecoder::new(head).take(HEADER_2 as u64).read_to_end(&mut start);
    } else {
        start.extend_from_slice(&head[..head.len().min(HEADER_2)]);
    }
    Header::parse(Path::new(""), start).is_ok()
}

/// Reads a file, or the pair when either of its files is named.
pub(crate) fn read(path: &Path) -> Result<Volume> {
    let named_image = ["img", "img.gz"].iter().any(|end| has_extension(path, end));
    let header_path = if named_image { partner(path, "hdr") } else { path.to_path_buf() };
    let path = header_path.as_path();
    let (bytes, compressed) = start_of(path)?;
    let header = Header::parse(path, bytes)?;
    let dims = header.dims()?;
    let count = voxel_count(dims).map_err(|p| bad(path, "dim", p))?;
    let grid = header.grid()?;
    let scale = header.scale()?;
    let payload = header.payload(compressed)?;
    let values = payload.read(path, "data", count)?;
    assemble(path, dims.map(|d| d as usize), grid, values, scale)
}

pub(crate) fn has_extension(path: &Path, extension: &str) -> bool {
    let name = path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default();
    name.ends_with(&format!(".{extension}"))
}

/// The other file of a pair: with this extension, or with it and `.gz` when only that one is there.
pub(crate) fn partner(path: &Path, extension: &str) -> PathBuf {
    let stem = if has_extension(path, "gz") { path.with_extension("") } else { path.to_path_buf() };
    let plain = stem.with_extension(extension);
    let compressed = stem.with_extension(format!("{extension}.gz"));
    if !plain.exists() && compressed.exists() { compressed } else { plain }
}

/// The first bytes after decompression, and whether there was any.
pub(crate) fn start_of(path: &Path) -> Result<(Vec<u8>, bool)> {
    let io = |source| Error::Io { path: path.into(), source };
    let mut file = File::open(path).map_err(io)?;
    let mut magic = Vec::new();
    file.by_ref().take(2).read_to_end(&mut magic).map_err(io)?;
    let compressed = magic == GZIP;
    let whole = magic.as_slice().chain(file);
    let mut start = Vec::new();
    if compressed {
        let read = flate2::read::MultiGzDecoder::new(whole).take(HEADER_2 as u64).read_to_end(&mut start);
        // What came before the damage may still hold the header; if not, its length says so.
        if let Err(e) = read
            && start.is_empty()
        {
            return Err(bad(path, "header", format!("the compressed data are damaged ({e})")));
        }
    } else {
        whole.take(HEADER_2 as u64).read_to_end(&mut start).map_err(io)?;
    }
    Ok((start, compressed))
}

struct Header<'a> {
    path: &'a Path,
    bytes: Vec<u8>,
    endian: Endian,
    /// Version 2 rather than 1.
    second: bool,
    /// The data are in a file of their own.
    pair: bool,
}

impl<'a> Header<'a> {
    fn parse(path: &'a Path, bytes: Vec<u8>) -> Result<Self> {
        let short = |need: usize| {
            bad(path, "header", format!("{} bytes, expected {need} of a NIfTI header", bytes.len()))
        };
        let Some(size) = bytes.first_chunk::<4>() else { return Err(short(HEADER_1)) };
        let sizes = [(Endian::Little, i32::from_le_bytes(*size)), (Endian::Big, i32::from_be_bytes(*size))];
        let found = sizes.into_iter().find(|(_, n)| *n == HEADER_1 as i32 || *n == HEADER_2 as i32);
        let Some((endian, size)) = found else {
            let problem = format!("{}, expected {HEADER_1} (NIfTI-1) or {HEADER_2} (NIfTI-2)", sizes[0].1);
            return Err(bad(path, "sizeof_hdr", problem));
        };
        let second = size == HEADER_2 as i32;
        let size = size as usize;
        if bytes.len() < size {
            return Err(short(size));
        }
        let magic = if second { &bytes[4..8] } else { &bytes[344..348] };
        let version = if second { b'2' } else { b'1' };
        let pair = match magic {
            [b'n', b'+', v, 0] if *v == version => false,
            [b'n', b'i', v, 0] if *v == version => true,
            _ => {
                let found = String::from_utf8_lossy(magic).into_owned();
                let expected = if second { "n+2 or ni2" } else { "n+1 or ni1 (ANALYZE files have none)" };
                return Err(bad(path, "magic", format!("{found:?}, expected {expected}")));
            }
        };
        Ok(Header { path, bytes, endian, second, pair })
    }

    /// Bytes at an offset in native order. Offsets are those of the format, within the length that `parse` checked.
    fn at<const N: usize>(&self, offset: usize) -> [u8; N] {
        let mut bytes: [u8; N] = std::array::from_fn(|i| self.bytes[offset + i]);
        if self.endian == Endian::Big {
            bytes.reverse();
        }
        bytes
    }

    fn i16(&self, offset: usize) -> i64 {
        i16::from_le_bytes(self.at(offset)).into()
    }

    fn i32(&self, offset: usize) -> i64 {
        i32::from_le_bytes(self.at(offset)).into()
    }

    /// Floating-point number `i` of a field: 32 bits in version 1, 64 in version 2.
    fn real(&self, offsets: (usize, usize), i: usize) -> f64 {
        if self.second {
            f64::from_le_bytes(self.at(offsets.1 + 8 * i))
        } else {
            f32::from_le_bytes(self.at(offsets.0 + 4 * i)).into()
        }
    }

    fn dims(&self) -> Result<[u64; 3]> {
        let dim = |i: usize| {
            if self.second { i64::from_le_bytes(self.at(16 + 8 * i)) } else { self.i16(40 + 2 * i) }
        };
        let rank = dim(0);
        if !(3..=7).contains(&rank) {
            return Err(bad(
                self.path,
                "dim[0]",
                format!("{rank} dimensions, expected 3 (or 4 with dim[4] = 1)"),
            ));
        }
        // 0 stands for an unused dimension in many files.
        if let Some(i) = (4..=rank as usize).find(|i| !(0..=1).contains(&dim(*i))) {
            let problem = format!("{}, expected 1: one scalar volume, no series and no vectors", dim(i));
            return Err(bad(self.path, &format!("dim[{i}]"), problem));
        }
        let [x, y, z] = [1, 2, 3].map(|i| u64::try_from(dim(i)).map_err(|_| i));
        match (x, y, z) {
            (Ok(x), Ok(y), Ok(z)) => Ok([x, y, z]),
            (Err(i), ..) | (_, Err(i), _) | (.., Err(i)) => {
                Err(bad(self.path, &format!("dim[{i}]"), format!("{}, expected 1 or more", dim(i))))
            }
        }
    }

    fn grid(&self) -> Result<Grid> {
        let path = self.path;
        let units = if self.second { self.i32(500) } else { self.bytes[123].into() };
        // The low three bits are the unit of space.
        let unit = match units & 7 {
            0 | 2 => 1.0,
            1 => 1000.0,
            3 => 1e-3,
            n => {
                return Err(bad(
                    path,
                    "xyzt_units",
                    format!("{n}, expected 0 (unknown), 1 (m), 2 (mm) or 3 (µm)"),
                ));
            }
        };
        let pixdim = |i| self.real((76, 104), i);
        // Some writers put the direction into the sign; where the format looks for it is the qform and sform.
        let grid = Grid::plain([1, 2, 3].map(|i| pixdim(i).abs()));
        check_spacing(grid.spacing.map(|s| s * unit)).map_err(|p| bad(path, "pixdim", p))?;
        let (qform, sform) =
            if self.second { (self.i32(344), self.i32(348)) } else { (self.i16(252), self.i16(254)) };
        let mut grid = match (sform > 0, qform > 0) {
            (false, false) => grid,
            (false, true) => self.qform(grid)?,
            (true, false) => self.sform(grid)?,
            // A registration may shear the sform; the scanner's grid is then the other one.
            (true, true) => self.sform(grid.clone()).or_else(|_| self.qform(grid))?,
        };
        grid = grid.scaled(unit);
        if grid.origin.iter().any(|x| !x.is_finite()) {
            return Err(bad(path, "qoffset", format!("{:?}, expected a finite position", grid.origin)));
        }
        Ok(grid)
    }

    fn sform(&self, grid: Grid) -> Result<Grid> {
        let rows = [(280, 400), (296, 432), (312, 464)];
        let column = |i: usize| rows.map(|offsets| self.real(offsets, i));
        let (_, directions) =
            grid::axes([column(0), column(1), column(2)]).map_err(|p| bad(self.path, "srow", p))?;
        if column(3).iter().any(|x| !x.is_finite()) {
            return Err(bad(
                self.path,
                "srow",
                format!("origin {:?}, expected a finite position", column(3)),
            ));
        }
        Ok(Grid { origin: column(3), directions, space: Space::Ras, ..grid })
    }

    /// Method 2 of the format: a unit quaternion of which b, c, d are stored.
    fn qform(&self, grid: Grid) -> Result<Grid> {
        let [mut b, mut c, mut d] = [0, 1, 2].map(|i| self.real((256, 352), i));
        let square = b * b + c * c + d * d;
        if !square.is_finite() {
            return Err(bad(self.path, "quatern", format!("({b}, {c}, {d}), expected finite numbers")));
        }
        // Rounding may leave the three a little too long.
        let a = (1.0 - square).max(0.0).sqrt();
        if square > 1.0 {
            let length = square.sqrt();
            (b, c, d) = (b / length, c / length, d / length);
        }
        // pixdim[0] is the sign of the third axis, 0 meaning +1.
        let sign = if self.real((76, 104), 0) < 0.0 { -1.0 } else { 1.0 };
        let x = [a * a + b * b - c * c - d * d, 2.0 * (b * c + a * d), 2.0 * (b * d - a * c)];
        let y = [2.0 * (b * c - a * d), a * a + c * c - b * b - d * d, 2.0 * (c * d + a * b)];
        let z = [2.0 * (b * d + a * c), 2.0 * (c * d - a * b), a * a + d * d - b * b - c * c];
        let (_, directions) =
            grid::axes([x, y, z.map(|v| v * sign)]).map_err(|p| bad(self.path, "quatern", p))?;
        let origin = [0, 1, 2].map(|i| self.real((268, 376), i));
        Ok(Grid { origin, directions, space: Space::Ras, ..grid })
    }

    /// Slope and intercept; a slope of 0 or NaN (which some writers leave) means that there is no scaling.
    fn scale(&self) -> Result<(f64, f64)> {
        let (slope, intercept) = (self.real((112, 176), 0), self.real((116, 184), 0));
        if slope == 0.0 || slope.is_nan() {
            return Ok((1.0, 0.0));
        }
        for (field, x) in [("scl_slope", slope), ("scl_inter", intercept)] {
            if !x.is_finite() {
                return Err(bad(self.path, field, format!("{x}, expected a finite number")));
            }
        }
        Ok((slope, intercept))
    }

    fn payload(&self, compressed: bool) -> Result<Payload> {
        let path = self.path;
        let code = self.i16(if self.second { 12 } else { 70 });
        let kind = match code {
            2 => Kind::U8,
            4 => Kind::I16,
            8 => Kind::I32,
            16 => Kind::F32,
            64 => Kind::F64,
            256 => Kind::I8,
            512 => Kind::U16,
            768 => Kind::U32,
            1024 => Kind::I64,
            1280 => Kind::U64,
            _ => {
                let problem =
                    format!("{code}, expected 2, 4, 8, 16, 64, 256, 512, 768, 1024 or 1280 (a scalar type)");
                return Err(bad(path, "datatype", problem));
            }
        };
        let header = if self.second { HEADER_2 } else { HEADER_1 };
        // 0 was written for `where the header ends`, with its four bytes that announce extensions.
        let implied = if self.pair { 0 } else { header as u64 + 4 };
        let offset =
            if self.second { i64::from_le_bytes(self.at(168)) as f64 } else { self.real((108, 0), 0) };
        let least = if self.pair { 0 } else { header };
        let offset = match offset {
            0.0 => implied,
            // Beyond 2⁵³ bytes no file reaches.
            x if x >= least as f64 && x < 9e15 && x.fract() == 0.0 => x as u64,
            x => {
                return Err(bad(
                    path,
                    "vox_offset",
                    format!("{x}, expected a whole number of at least {least} bytes"),
                ));
            }
        };
        let (data, compressed) = if self.pair {
            let data = partner(path, "img");
            let compressed = has_extension(&data, "gz");
            (data, compressed)
        } else {
            (path.to_path_buf(), compressed)
        };
        let (encoding, skip, start) = if compressed {
            (Encoding::Deflate, Skip::Ahead { lines: 0, bytes: offset }, 0)
        } else {
            (Encoding::Raw, Skip::NOTHING, offset)
        };
        Ok(Payload { kind, endian: self.endian, encoding, skip, parts: vec![Part { path: data, start }] })
    }
}
