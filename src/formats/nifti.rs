//! NIfTI-1 and NIfTI-2, in one file (`.nii`, `.nii.gz`) or two (`.hdr` and `.img`):
//! <https://nifti.nimh.nih.gov/nifti-1>, <https://nifti.nimh.nih.gov/nifti-2>.
//!
//! Origin and directions are those of the sform, else of the qform, both in RAS. Spacing is `pixdim`, or the sform's where that
//! says something else. A sheared sform is refused also where there is a qform, which cannot have a shear and hides it.

use std::io::Read;
use std::path::{Path, PathBuf};

use crate::binary::Binary;
use crate::grid::{self, Grid};
use crate::parts::Parts;
use crate::payload::{Encoding, Payload, Skip};
use crate::reading::{Frame, Opened, Reading};
use crate::volume::{Found, assemble, bad};
use crate::{Error, Result, file};
use cao_model::error::quoted;
use cao_model::values::{Endian, Kind};
use cao_model::volume::{Space, check_spacing, voxel_count};

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
pub(crate) fn read(path: &Path, reading: &Reading) -> Result<Opened> {
    let named_image = ["img", "img.gz"].iter().any(|end| has_extension(path, end));
    let header_path = if named_image { partner(path, "hdr") } else { path.to_path_buf() };
    let path = header_path.as_path();
    let (bytes, compressed) = start_of(path)?;
    let header = Header::parse(path, bytes)?;
    let dims = header.dims()?;
    let count = voxel_count(dims).map_err(|p| bad(path, "dim", p))?;
    let grid = header.grid()?;
    let scale = header.scale()?;
    let payload = header.payload(compressed, header.frame(reading)?)?;
    let mut warnings = Vec::new();
    let values = payload.read(path, "data", count, &mut warnings)?;
    assemble(path, Found { dims: dims.map(|d| d as usize), grid, values, scale, warnings }, reading)
}

pub(crate) fn has_extension(path: &Path, extension: &str) -> bool {
    let name = path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default();
    name.ends_with(&format!(".{extension}"))
}

/// The other file of a pair: with this extension in small letters, capitals or a capital, or with it and `.gz` when only that one is
/// there.
pub(crate) fn partner(path: &Path, extension: &str) -> PathBuf {
    let stem = if has_extension(path, "gz") { path.with_extension("") } else { path.to_path_buf() };
    let capitals = extension.to_uppercase();
    let capital = format!("{}{}", &capitals[..1], &extension[1..]);
    let (small, zipped) = (extension.to_owned(), format!("{extension}.gz"));
    let spelt =
        [small, capitals.clone(), capital, zipped, format!("{capitals}.GZ"), format!("{capitals}.gz")];
    let mut found = spelt.iter().map(|extension| stem.with_extension(extension));
    // What is missing is called as its partner is.
    let capitals = stem.extension().is_some_and(|e| e.to_string_lossy().chars().all(char::is_uppercase));
    let missing = || stem.with_extension(&spelt[usize::from(capitals)]);
    found.find(|path| path.exists()).unwrap_or_else(missing)
}

/// The first bytes after decompression, and whether there was any.
pub(crate) fn start_of(path: &Path) -> Result<(Vec<u8>, bool)> {
    let io = Error::io(path);
    let (mut file, _) = file::open(path).map_err(io)?;
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
    numbers: Binary<Vec<u8>>,
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
                let found = String::from_utf8_lossy(magic);
                let expected = if second { "n+2 or ni2" } else { "n+1 or ni1 (ANALYZE files have none)" };
                return Err(bad(path, "magic", format!("{}, expected {expected}", quoted(&found))));
            }
        };
        Ok(Header { path, numbers: Binary { bytes, endian }, second, pair })
    }

    /// Floating-point number `i` of a field: 32 bits in version 1, 64 in version 2.
    fn real(&self, offsets: (usize, usize), i: usize) -> f64 {
        if self.second {
            f64::from_le_bytes(self.numbers.at(offsets.1 + 8 * i))
        } else {
            self.numbers.f32(offsets.0 + 4 * i)
        }
    }

    /// Entry `i` of `dim`, of which the first is their number.
    fn dim(&self, i: usize) -> i64 {
        if self.second {
            i64::from_le_bytes(self.numbers.at(16 + 8 * i))
        } else {
            self.numbers.i16(40 + 2 * i)
        }
    }

    fn dims(&self) -> Result<[u64; 3]> {
        let dim = |i: usize| self.dim(i);
        let rank = dim(0);
        if !(3..=7).contains(&rank) {
            return Err(bad(
                self.path,
                "dim[0]",
                format!("{rank} dimensions, expected 3, or 4 for a series"),
            ));
        }
        // 0 stands for an unused dimension in many files.
        if let Some(i) = (5..=rank as usize).find(|i| !(0..=1).contains(&dim(*i))) {
            let problem = format!("{}, expected 1: scalar volumes, no vectors", dim(i));
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

    /// Which volume of the fourth dimension.
    fn frame(&self, reading: &Reading) -> Result<Frame> {
        let count = if self.dim(0) > 3 { self.dim(4).max(1) } else { 1 };
        Frame::choose(reading, count as u64, false).map_err(|p| bad(self.path, "dim[4]", p))
    }

    fn grid(&self) -> Result<Grid> {
        let path = self.path;
        let units = if self.second { self.numbers.i32(500) } else { self.numbers.bytes[123].into() };
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
        let (qform, sform) = if self.second {
            (self.numbers.i32(344), self.numbers.i32(348))
        } else {
            (self.numbers.i16(252), self.numbers.i16(254))
        };
        // Some writers announce an sform and leave its place empty.
        let blank = (0..3).all(|i| self.srow(i) == [0.0; 3]);
        let mut grid = match (sform > 0 && !(blank && qform > 0), qform > 0) {
            (true, _) => self.sform(grid)?,
            (false, true) => self.qform(grid)?,
            (false, false) => grid,
        };
        grid = grid.scaled(unit);
        check_spacing(grid.spacing).map_err(|p| bad(path, "srow", p))?;
        if grid.origin.iter().any(|x| !x.is_finite()) {
            return Err(bad(path, "qoffset", format!("{:?}, expected a finite position", grid.origin)));
        }
        Ok(grid)
    }

    /// Column `i` of the sform: the vector of an index axis, or the origin.
    fn srow(&self, i: usize) -> [f64; 3] {
        [(280, 400), (296, 432), (312, 464)].map(|offsets| self.real(offsets, i))
    }

    fn sform(&self, grid: Grid) -> Result<Grid> {
        let (lengths, directions) =
            grid::axes([0, 1, 2].map(|i| self.srow(i))).map_err(|p| bad(self.path, "srow", p))?;
        let origin = self.srow(3);
        if origin.iter().any(|x| !x.is_finite()) {
            let problem = format!("origin {origin:?}, expected a finite position");
            return Err(bad(self.path, "srow", problem));
        }
        // Beyond rounding, points of the patient are those of the sform: a registration may have scaled it.
        let same = |a: usize| (lengths[a] - grid.spacing[a]).abs() <= 1e-3 * grid.spacing[a];
        let spacing = if (0..3).all(same) { grid.spacing } else { lengths };
        Ok(Grid { spacing, origin, directions, space: Space::Ras })
    }

    /// Method 2 of the format: a unit quaternion of which b, c, d are stored.
    fn qform(&self, grid: Grid) -> Result<Grid> {
        let [mut b, mut c, mut d] = [0, 1, 2].map(|i| self.real((256, 352), i));
        let square = b * b + c * c + d * d;
        if !square.is_finite() {
            return Err(bad(self.path, "quatern", format!("({b}, {c}, {d}), expected finite numbers")));
        }
        let mut a = (1.0 - square).max(0.0).sqrt();
        // Where rounding of the three is all that is left of a, or makes them too long, a is 0, as in the format's own library.
        if 1.0 - square < 1e-7 {
            let length = square.sqrt();
            (a, b, c, d) = (0.0, b / length, c / length, d / length);
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

    fn payload(&self, compressed: bool, frame: Frame) -> Result<Payload> {
        let path = self.path;
        let code = self.numbers.i16(if self.second { 12 } else { 70 });
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
        let offset = if self.second {
            i64::from_le_bytes(self.numbers.at(168)) as f64
        } else {
            self.real((108, 0), 0)
        };
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
        let parts = Parts::one(data, start);
        Ok(Payload { kind, endian: self.numbers.endian, encoding, skip, parts, frame, exact: false })
    }
}
