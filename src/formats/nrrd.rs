//! NRRD, versions 1 to 5: <https://teem.sourceforge.net/nrrd/format.html>.
//!
//! Origin and directions come out in RAS when the header names an anatomical space, as they are otherwise. As teem,
//! the format's own library, does, unknown fields are refused: a misspelt `spacings` must not become a wrong distance.

use std::path::Path;

use crate::Result;
use crate::grid::{self, Grid};
use crate::parts::Parts;
use crate::payload::{Encoding, Payload, Skip};
use crate::reading::{Frame, Opened, Reading};
use crate::text::{Fields, Lines, data_files, quoted};
use crate::volume::{Found, assemble, bad};
use cao_model::values::{Endian, Kind};
use cao_model::volume::{check_spacing, voxel_count};

/// All fields of the format. White space and case do not matter in a field's name.
const FIELDS: [&str; 28] = [
    "axis maxs",
    "axis mins",
    "block size",
    "byte skip",
    "centers",
    "content",
    "data file",
    "dimension",
    "encoding",
    "endian",
    "kinds",
    "labels",
    "line skip",
    "max",
    "measurement frame",
    "min",
    "number",
    "old max",
    "old min",
    "sample units",
    "sizes",
    "space",
    "space dimension",
    "space directions",
    "space origin",
    "space units",
    "spacings",
    "thicknesses",
];
/// Fields with a second name, and `type` and `units`, which have none.
const MORE_FIELDS: [(&str, &str); 3] = [("centerings", "centers"), ("type", "type"), ("units", "units")];

/// Whether a file begins as NRRD files do.
pub(crate) fn is_nrrd(head: &[u8]) -> bool {
    head.starts_with(b"NRRD0")
}

/// Reads a file with attached or detached data.
pub(crate) fn read(path: &Path, reading: &Reading) -> Result<Opened> {
    let header = Header::read(path)?;
    let (axes, frame) = header.axes(reading)?;
    let dims = axes.map(|a| header.sizes[a]);
    let count = voxel_count(dims).map_err(|p| bad(path, "sizes", p))?;
    let grid = header.grid(axes)?;
    let payload = header.payload(frame)?;
    let mut warnings = Vec::new();
    let values = payload.read(path, "data file", count, &mut warnings)?;
    let found = Found { dims: dims.map(|d| d as usize), grid, values, scale: (1.0, 0.0), warnings };
    assemble(path, found, reading)
}

/// A space: how many axes it has, and the signs that turn it into RAS; none where it has no anatomical meaning.
struct World {
    axes: usize,
    flip: Option<[f64; 3]>,
}

/// The most axes that teem reads.
const MAX_AXES: usize = 16;

struct Header<'a> {
    fields: Fields<'a>,
    sizes: Vec<u64>,
    /// File names after `data file: LIST`.
    list: Vec<String>,
    /// Byte after the header.
    end: u64,
}

impl<'a> Header<'a> {
    fn read(path: &'a Path) -> Result<Self> {
        let mut lines = Lines::open(path)?;
        let magic = lines.next()?.unwrap_or_default();
        let magic = magic.trim_end();
        if !["NRRD00.01", "NRRD0001", "NRRD0002", "NRRD0003", "NRRD0004", "NRRD0005"].contains(&magic) {
            return Err(bad(path, "magic", format!("{}, expected NRRD0001 to NRRD0005", quoted(magic))));
        }
        let mut fields = Fields::new(path);
        let mut list = Vec::new();
        while let Some(line) = lines.next()? {
            if line.is_empty() {
                break;
            }
            if line.starts_with('#') {
                continue;
            }
            let Some((name, value)) = split(&line) else {
                return Err(bad(path, "header", format!("line {}, expected `field: value`", quoted(&line))));
            };
            let Some(value) = value else { continue };
            let name = field(name).ok_or_else(|| bad(path, name.trim(), "is not a field of the format"))?;
            fields.insert(name, value)?;
            if name == "data file" && value.split_whitespace().next() == Some("LIST") {
                list = lines.rest()?;
                break;
            }
        }
        let dimension: [usize; 1] = fields.array("dimension", "a whole number")?.unwrap_or_default();
        let sizes = fields.numbers("sizes", "whole numbers of samples along the axes")?;
        let sizes: Vec<u64> = sizes.ok_or_else(|| bad(path, "sizes", "missing, expected in every header"))?;
        let header = Header { fields, sizes, list, end: lines.position() };
        header.fields.require("dimension")?;
        if dimension[0] > MAX_AXES {
            return Err(bad(path, "dimension", format!("{}, expected 3 (or 4: a series)", dimension[0])));
        }
        if header.sizes.len() != dimension[0] {
            let problem =
                format!("{} numbers, expected {} as `dimension` says", header.sizes.len(), dimension[0]);
            return Err(bad(path, "sizes", problem));
        }
        Ok(header)
    }

    fn path(&self) -> &'a Path {
        self.fields.path
    }

    /// Which three axes are those of space, and which volume of a series. Beyond three, the axis of a series is what is called time or
    /// list, else the last one; axes of one sample do not count.
    fn axes(&self, reading: &Reading) -> Result<([usize; 3], Frame)> {
        let directions = self.directions()?;
        let kinds: Vec<String> = self.fields.get("kinds").map(words).unwrap_or_default();
        let kind = |a: usize| kinds.get(a).map_or(String::new(), |k| k.to_lowercase());
        let in_space =
            |a: usize| directions.as_ref().is_none_or(|d| d[a].as_ref().is_some_and(|v| v[..3] != [0.0; 3]));
        let any = |a: usize| ["", "domain", "space", "none", "???"].contains(&kind(a).as_str());
        let spatial = |a: usize| any(a) && in_space(a);
        let single = |a: &usize| self.sizes[*a] == 1;
        // By its name, or by a vector that leads out of space.
        let timely = |a: &usize| {
            let out = directions.as_ref().is_some_and(|d| d[*a].is_some()) && !in_space(*a);
            out || ["time", "list"].contains(&kind(*a).as_str())
        };
        let declared = |a: &usize| in_space(*a) && (directions.is_some() || any(*a) && !kind(*a).is_empty());
        let mut axes: Vec<usize> = (0..self.sizes.len()).collect();
        let mut series = None;
        while axes.len() > 3 {
            let last = axes.len() - 1;
            if let Some(at) = axes.iter().position(|a| single(a) && !spatial(*a)) {
                axes.remove(at);
            } else if let (None, Some(at)) = (series, axes.iter().position(timely)) {
                series = Some(axes.remove(at));
            } else if single(&axes[last]) {
                axes.pop();
            } else if series.is_none() && axes.iter().all(declared) {
                series = axes.pop();
            } else if let Some(at) = axes.iter().rposition(single) {
                axes.remove(at);
            } else if series.is_none() && any(axes[last]) {
                series = axes.pop();
            } else {
                break;
            }
        }
        let Ok(axes) = <[usize; 3]>::try_from(axes) else {
            let problem = format!(
                "{} axes of sizes {:?}, expected a scalar volume of 3 (or 4: a series of them)",
                self.sizes.len(),
                self.sizes
            );
            return Err(bad(self.path(), "dimension", problem));
        };
        if let Some(a) = axes.into_iter().find(|a| !spatial(*a)) {
            let field = if in_space(a) { "kinds" } else { "space directions" };
            let problem =
                format!("axis {a} is not an axis of space (vectors or a list?), expected three that are");
            return Err(bad(self.path(), field, problem));
        }
        let axis = series.unwrap_or(self.sizes.len());
        let alone = |axes: &[u64]| axes.iter().all(|n| *n == 1);
        let (first, last) =
            (alone(&self.sizes[..axis]), alone(self.sizes.get(axis + 1..).unwrap_or_default()));
        if !first && !last {
            let problem = format!("axis {axis} is that of a series, expected it to be the first or the last");
            return Err(bad(self.path(), "kinds", problem));
        }
        let count = self.sizes.get(axis).copied().unwrap_or(1);
        let frame = Frame::choose(reading, count, !last).map_err(|p| bad(self.path(), "sizes", p))?;
        Ok((axes, frame))
    }

    fn grid(&self, axes: [usize; 3]) -> Result<Grid> {
        let (path, fields) = (self.path(), &self.fields);
        let world = self.space()?;
        let units = self.lengths_of_units("space units", world.axes)?;
        let mut field = "spacings";
        let mut grid = match self.directions()? {
            Some(directions) => {
                field = "space directions";
                if fields.get("spacings").is_some() {
                    return Err(bad(
                        path,
                        "spacings",
                        "given beside `space directions`, expected one of both",
                    ));
                }
                // `axes` made sure that these have vectors.
                let vectors = axes.map(|a| directions[a].clone().unwrap_or_default());
                if let Some(i) = (0..3).find(|i| vectors[*i].iter().skip(3).any(|x| *x != 0.0)) {
                    let problem =
                        format!("axis {} leads into the series, expected an axis of space", axes[i]);
                    return Err(bad(path, field, problem));
                }
                let vectors =
                    vectors.map(|v| std::array::from_fn(|i| v.get(i).map_or(0.0, |x| x * units[i])));
                let (spacing, directions) = grid::axes(vectors).map_err(|p| bad(path, field, p))?;
                Grid { directions, ..Grid::plain(spacing) }
            }
            None => Grid::plain(self.spacings(axes)?),
        };
        check_spacing(grid.spacing).map_err(|p| bad(path, field, p))?;
        if let Some(text) = fields.get("space origin").filter(|t| *t != "none") {
            let origin = vectors(text, world.axes).filter(|v| v.len() == 1).and_then(|mut v| v.remove(0));
            let origin = origin.filter(|o| o.iter().all(|x| x.is_finite()));
            let origin = origin.ok_or_else(|| {
                bad(path, "space origin", format!("{}, expected (x,y,z) of finite numbers", quoted(text)))
            })?;
            grid.origin = std::array::from_fn(|i| origin[i] * units[i]);
        }
        Ok(match world.flip {
            Some(flip) => grid.flipped(flip),
            None => grid,
        })
    }

    /// The space that is named, else of so many dimensions. One with time has a fourth, which only a series may have.
    fn space(&self) -> Result<World> {
        let most = self.sizes.len().max(3);
        if let Some([n]) = self.fields.array::<usize, 1>("space dimension", "3")? {
            if !(3..=most).contains(&n) {
                return Err(bad(self.path(), "space dimension", format!("{n}, expected 3")));
            }
            return Ok(World { axes: n, flip: None });
        }
        let Some(space) = self.fields.get("space") else { return Ok(World { axes: 3, flip: None }) };
        let name = space.to_lowercase();
        let (axes, name) = match name.strip_suffix("-time").or(match name.as_str() {
            "rast" | "last" | "lpst" => name.strip_suffix('t'),
            _ => None,
        }) {
            Some(name) if most > 3 => (4, name),
            _ => (3, name.as_str()),
        };
        let flip = match name {
            "right-anterior-superior" | "ras" => Some([1.0, 1.0, 1.0]),
            "left-anterior-superior" | "las" => Some([-1.0, 1.0, 1.0]),
            "left-posterior-superior" | "lps" => Some([-1.0, -1.0, 1.0]),
            "scanner-xyz" | "3d-right-handed" | "3d-left-handed" => None,
            _ => {
                let expected = "RAS, LAS, LPS, scanner-xyz, 3D-right-handed or 3D-left-handed (and for a series one with time)";
                return Err(bad(self.path(), "space", format!("{}, expected {expected}", quoted(space))));
            }
        };
        Ok(World { axes, flip })
    }

    /// Spacings in mm: as given, from the axes' ends, or 1.
    fn spacings(&self, axes: [usize; 3]) -> Result<[f64; 3]> {
        let dimension = self.sizes.len();
        let per_axis = |name: &str| -> Result<Option<Vec<f64>>> {
            let Some(numbers) = self.fields.numbers::<f64>(name, "a number for every axis")? else {
                return Ok(None);
            };
            if numbers.len() != dimension {
                return Err(bad(
                    self.path(),
                    name,
                    format!("{} numbers, expected {dimension}", numbers.len()),
                ));
            }
            Ok(Some(numbers))
        };
        let units = self.lengths_of_units("units", dimension)?;
        if let Some(spacings) = per_axis("spacings")? {
            return Ok(axes.map(|a| spacings[a] * units[a]));
        }
        let (Some(mins), Some(maxs)) = (per_axis("axis mins")?, per_axis("axis maxs")?) else {
            return Ok([1.0; 3]);
        };
        let centers = self.fields.get("centers").map(words).unwrap_or_default();
        Ok(axes.map(|a| {
            // Ends are outer faces of cells, or positions of the first and last node.
            let node = centers.get(a).is_some_and(|c| c.eq_ignore_ascii_case("node"));
            let steps = if node { self.sizes[a] as f64 - 1.0 } else { self.sizes[a] as f64 };
            (maxs[a] - mins[a]) / steps * units[a]
        }))
    }

    /// Millimetres of each quoted unit; units that are missing or not of length count as mm.
    fn lengths_of_units(&self, field: &str, count: usize) -> Result<Vec<f64>> {
        let Some(text) = self.fields.get(field) else { return Ok(vec![1.0; count]) };
        let units = words(text);
        if units.len() != count {
            return Err(bad(self.path(), field, format!("{} units, expected {count}", units.len())));
        }
        Ok(units.iter().map(|u| grid::millimetres(u).unwrap_or(1.0)).collect())
    }

    /// One vector an axis, `None` where the header has `none`.
    fn directions(&self) -> Result<Option<Vec<Option<Vec<f64>>>>> {
        let Some(text) = self.fields.get("space directions") else { return Ok(None) };
        let dimension = self.sizes.len();
        match vectors(text, self.space()?.axes) {
            Some(vectors) if vectors.len() == dimension => Ok(Some(vectors)),
            _ => {
                let problem = format!("{}, expected (x,y,z) or none, {dimension} times", quoted(text));
                Err(bad(self.path(), "space directions", problem))
            }
        }
    }

    fn payload(&self, frame: Frame) -> Result<Payload> {
        let (path, fields) = (self.path(), &self.fields);
        let kind = fields.require("type")?;
        let kind = Kind::parse(kind)
            .ok_or_else(|| bad(path, "type", format!("{}, expected {}", quoted(kind), Kind::EXPECTED)))?;
        let encoding = fields.require("encoding")?;
        let encoding = match encoding.to_ascii_lowercase().as_str() {
            "raw" => Encoding::Raw,
            "gz" | "gzip" => Encoding::Deflate,
            "txt" | "text" | "ascii" => Encoding::Ascii,
            _ => {
                return Err(bad(
                    path,
                    "encoding",
                    format!("{}, expected raw, gzip or ascii", quoted(encoding)),
                ));
            }
        };
        let endian = match fields.get("endian") {
            Some(name) => Endian::parse(name)
                .ok_or_else(|| bad(path, "endian", format!("{}, expected little or big", quoted(name))))?,
            // Nothing to order.
            None if kind.bytes() == 1 || encoding == Encoding::Ascii => Endian::Little,
            None => {
                return Err(bad(
                    path,
                    "endian",
                    format!("missing, expected little or big for {}", kind.name()),
                ));
            }
        };
        let [lines] = fields.array("line skip", "a number of lines")?.unwrap_or([0]);
        let [bytes] = fields.array::<i64, 1>("byte skip", "a number of bytes, or -1")?.unwrap_or([0]);
        let skip = match bytes {
            -1 if encoding == Encoding::Raw => Skip::AllButLast,
            -1 => return Err(bad(path, "byte skip", "-1 is possible with encoding raw only")),
            _ => {
                let bytes = bytes.try_into();
                let bytes =
                    bytes.map_err(|_| bad(path, "byte skip", "negative, expected 0 or more, or -1"))?;
                Skip::Ahead { lines, bytes }
            }
        };
        let parts = match fields.get("data file") {
            Some(value) => data_files(path, "data file", value, &self.list, &self.sizes)?,
            None => Parts::one(path.into(), self.end),
        };
        Ok(Payload { kind, endian, encoding, skip, parts, frame, exact: false })
    }
}

/// The free keys of a header, `key:=value`, in their order.
pub(crate) fn keys(path: &Path) -> Result<Vec<(String, String)>> {
    let mut lines = Lines::open(path)?;
    let mut keys = Vec::new();
    while let Some(line) = lines.next()?.filter(|line| !line.is_empty()) {
        if let (Some((key, value)), Some((_, None))) = (line.split_once(":="), split(&line)) {
            keys.push((key.into(), value.into()));
        }
    }
    Ok(keys)
}

/// `field: value`, or `key:=value` with no value returned, because keys are free and mean nothing here.
fn split(line: &str) -> Option<(&str, Option<&str>)> {
    let (name, value) = line.split_once(':')?;
    let free = value.starts_with('=') || (!value.starts_with(' ') && value.contains(":="));
    Some((name, (!free).then_some(value)))
}

/// The field's name as [`FIELDS`] spells it.
fn field(name: &str) -> Option<&'static str> {
    let squeeze = |s: &str| s.split_whitespace().collect::<String>().to_ascii_lowercase();
    let name = squeeze(name);
    let plain = FIELDS.iter().copied().find(|f| squeeze(f) == name);
    plain.or_else(|| MORE_FIELDS.iter().find(|(alias, _)| *alias == name).map(|(_, f)| *f))
}

/// Words, quoted ones with the white space in them.
fn words(text: &str) -> Vec<String> {
    if text.contains('"') {
        return text.split('"').skip(1).step_by(2).map(str::to_string).collect();
    }
    text.split_whitespace().map(str::to_string).collect()
}

/// `(x,y,z) none (x,y,z) …`, vectors of a space with so many axes; `None` when it is anything else.
fn vectors(text: &str, axes: usize) -> Option<Vec<Option<Vec<f64>>>> {
    let mut vectors = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            vectors.push(None);
            rest = after.trim_start();
            continue;
        }
        let (vector, after) = rest.strip_prefix('(')?.split_once(')')?;
        let numbers: Option<Vec<f64>> = vector.split(',').map(|n| n.trim().parse().ok()).collect();
        vectors.push(Some(numbers.filter(|n| n.len() == axes)?));
        rest = after.trim_start();
    }
    Some(vectors)
}
