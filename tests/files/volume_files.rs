//! Volume files: every format, type, byte order and encoding comes back as it went out, and what is wrong with a file
//! is said with the file and the field. All files are made here, byte by byte, from the formats' descriptions.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use cao_formats::{Error, NoNumbers, Reading};
use cao_model::values::{Endian, Values};
use cao_model::volume::{Space, Volume};
use proptest::prelude::*;
use tempfile::TempDir;

pub const DIMS: [usize; 3] = [5, 3, 2];
pub const COUNT: usize = 30;
const ENDIANS: [(Endian, &str); 2] = [(Endian::Little, "little"), (Endian::Big, "big")];

/// 30 values of every type, with both ends of its range.
fn all_types() -> Vec<Values> {
    macro_rules! ramp {
        ($t:ty, $variant:ident) => {
            Values::$variant(
                (0..COUNT).map(|i| [<$t>::MIN, <$t>::MAX].get(i).copied().unwrap_or((i * 3) as $t)).collect(),
            )
        };
    }
    vec![
        ramp!(u8, U8),
        ramp!(i8, I8),
        ramp!(u16, U16),
        ramp!(i16, I16),
        ramp!(u32, U32),
        ramp!(i32, I32),
        ramp!(u64, U64),
        ramp!(i64, I64),
        Values::F32(
            (0..COUNT).map(|i| [f32::MIN, f32::MAX, 0.1].get(i).copied().unwrap_or(i as f32)).collect(),
        ),
        Values::F64(
            (0..COUNT).map(|i| [f64::MIN, f64::MAX, 0.1].get(i).copied().unwrap_or(i as f64)).collect(),
        ),
    ]
}

pub fn bytes_of(values: &Values, endian: Endian) -> Vec<u8> {
    macro_rules! bytes {
        ($v:ident) => {
            match endian {
                Endian::Little => $v.iter().flat_map(|x| x.to_le_bytes()).collect(),
                Endian::Big => $v.iter().flat_map(|x| x.to_be_bytes()).collect(),
            }
        };
    }
    match values {
        Values::U8(v) => bytes!(v),
        Values::I8(v) => bytes!(v),
        Values::U16(v) => bytes!(v),
        Values::I16(v) => bytes!(v),
        Values::U32(v) => bytes!(v),
        Values::I32(v) => bytes!(v),
        Values::U64(v) => bytes!(v),
        Values::I64(v) => bytes!(v),
        Values::F32(v) => bytes!(v),
        Values::F64(v) => bytes!(v),
    }
}

pub fn text_of(values: &Values) -> Vec<u8> {
    macro_rules! text {
        ($v:ident) => {
            $v.iter().map(|x| format!("{x}\n")).collect::<String>().into_bytes()
        };
    }
    match values {
        Values::U8(v) => text!(v),
        Values::I8(v) => text!(v),
        Values::U16(v) => text!(v),
        Values::I16(v) => text!(v),
        Values::U32(v) => text!(v),
        Values::I32(v) => text!(v),
        Values::U64(v) => text!(v),
        Values::I64(v) => text!(v),
        Values::F32(v) => text!(v),
        Values::F64(v) => text!(v),
    }
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    out.write_all(bytes).unwrap();
    out.finish().unwrap()
}

pub fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut out = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    out.write_all(bytes).unwrap();
    out.finish().unwrap()
}

/// A folder with files, gone after the test.
pub struct Folder(pub TempDir);

impl Folder {
    pub fn new() -> Self {
        Folder(tempfile::tempdir().unwrap())
    }

    pub fn put(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    }

    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.0.path())
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

/// A text header followed by data.
pub fn joined(header: &str, data: &[u8]) -> Vec<u8> {
    [header.as_bytes(), data].concat()
}

/// Asserts that reading was refused for `field` of `file`, in words that hold all of `says`.
#[track_caller]
pub fn assert_refused<T: std::fmt::Debug>(
    result: cao_formats::Result<T>,
    file: &Path,
    field: &str,
    says: &[&str],
) {
    let error = result.expect_err(&format!("{} should be refused for {field}", file.display()));
    let text = error.to_string();
    match &error {
        Error::File { path, field: found, .. } => {
            assert_eq!(found, field, "{text}");
            assert_eq!(path, file, "{text}");
        }
        other => panic!("expected an error about {field} of {}, got {other:?}", file.display()),
    }
    for part in says {
        assert!(text.contains(part), "{text:?} should say {part:?}");
    }
}

/// A file's volume in the order of the file.
fn stored(path: &Path) -> Volume {
    cao_formats::read(path).unwrap().into_stored().unwrap()
}

#[track_caller]
pub fn assert_close(found: [f64; 3], expected: [f64; 3]) {
    for a in 0..3 {
        assert!((found[a] - expected[a]).abs() < 1e-6, "{found:?}, expected {expected:?}");
    }
}

// ---------------------------------------------------------------------------------------------------------- volume

#[test]
fn a_volume_counts_its_voxels_x_fastest_and_measures_in_mm_from_its_centre() {
    let mut volume = Volume::new(DIMS, [1.0, 2.0, 4.0], Values::U8((0..30).collect())).unwrap();
    assert_eq!(volume.len(), COUNT);
    assert_eq!(volume.at(1, 0, 0), 1.0);
    assert_eq!(volume.at(0, 1, 0), 5.0);
    assert_eq!(volume.at(0, 0, 1), 15.0);
    assert_eq!(volume.size_mm(), [5.0, 6.0, 8.0]);
    assert_eq!(volume.min_spacing(), 1.0);
    assert_eq!(volume.to_world([2.0, 1.0, 0.5]), [0.0; 3]);
    assert_eq!(volume.to_world([0.0; 3]), [-2.0, -2.0, -2.0]);
    (volume.slope, volume.intercept) = (-2.0, 10.0);
    assert_eq!(volume.value(29), -48.0);
    assert_eq!(volume.range(), (-48.0, 10.0));
}

#[test]
fn impossible_volumes_are_refused_by_name() {
    type Case = ([usize; 3], [f64; 3], Values, &'static str, &'static str);
    let cases: [Case; 6] = [
        ([0, 1, 1], [1.0; 3], Values::U8(vec![]), "dims", "0 × 1 × 1"),
        ([usize::MAX, 2, 2], [1.0; 3], Values::U8(vec![1]), "dims", "more than any memory"),
        ([1, 1, 1], [1.0, 0.0, 1.0], Values::U8(vec![1]), "spacing", "0 mm"),
        ([1, 1, 1], [1.0, f64::NAN, 1.0], Values::U8(vec![1]), "spacing", "NaN mm"),
        ([1, 1, 2], [1.0; 3], Values::U8(vec![1]), "values", "1 values, expected 2"),
        ([1, 1, 2], [1.0; 3], Values::F64(vec![1.0, f64::INFINITY]), "values", "(0, 0, 1)"),
    ];
    for (dims, spacing, values, name, says) in cases {
        let error = Volume::new(dims, spacing, values).unwrap_err();
        assert!(matches!(&error, cao_model::Error::Config { what, .. } if what == name), "{error}");
        assert!(error.to_string().contains(says), "{error}");
    }
}

// ------------------------------------------------------------------------------------------------------------ NRRD

/// A header of `fields`, with `changed` ones replaced (`None`: left out) or added.
pub fn nrrd_header(changed: &[(&str, Option<&str>)]) -> String {
    let mut fields: Vec<(&str, Option<&str>)> = vec![
        ("type", Some("int16")),
        ("dimension", Some("3")),
        ("sizes", Some("5 3 2")),
        ("spacings", Some("0.5 1 2")),
        ("endian", Some("little")),
        ("encoding", Some("raw")),
    ];
    for &(name, value) in changed {
        match fields.iter_mut().find(|(n, _)| *n == name) {
            Some(field) => field.1 = value,
            None => fields.push((name, value)),
        }
    }
    let lines: String = fields.iter().filter_map(|(n, v)| Some(format!("{n}: {}\n", (*v)?))).collect();
    format!("NRRD0004\n# made by a test\n{lines}key:=value: of no meaning\n")
}

pub fn nrrd_values() -> Values {
    Values::I16((0..30).map(|i| i * 100 - 1000).collect())
}

/// An attached file with 30 values of int16, raw, its header changed.
fn nrrd(folder: &Folder, changed: &[(&str, Option<&str>)]) -> PathBuf {
    let header = nrrd_header(changed) + "\n";
    folder.put("a.nrrd", &joined(&header, &bytes_of(&nrrd_values(), Endian::Little)))
}

#[test]
fn nrrd_returns_every_type_byte_order_and_encoding_attached_and_detached() {
    let folder = Folder::new();
    for values in all_types() {
        for (endian, endian_name) in ENDIANS {
            for encoding in ["raw", "gzip", "ascii"] {
                let data = match encoding {
                    "raw" => bytes_of(&values, endian),
                    "gzip" => gzip(&bytes_of(&values, endian)),
                    _ => text_of(&values),
                };
                let header = nrrd_header(&[
                    ("type", Some(values.kind())),
                    ("endian", Some(endian_name)),
                    ("encoding", Some(encoding)),
                ]);
                let attached = folder.put("a.nrrd", &joined(&(header.clone() + "\n"), &data));
                folder.put("a file.raw", &data);
                let detached = folder.put("a.nhdr", (header + "data file: a file.raw\n").as_bytes());
                for path in [attached, detached] {
                    let volume = cao_formats::read(&path).unwrap();
                    assert_eq!(volume.values, values, "{} {endian_name} {encoding}", values.kind());
                    assert_eq!((volume.dims, volume.spacing), (DIMS, [0.5, 1.0, 2.0]));
                    assert_eq!((volume.slope, volume.intercept), (1.0, 0.0));
                }
            }
        }
    }
}

#[test]
fn nrrd_knows_every_name_of_every_type() {
    let names = [
        ("int8", "signed char, int8, int8_t"),
        ("uint8", "uchar, unsigned char, uint8, uint8_t"),
        ("int16", "short, short int, signed short, signed short int, int16, int16_t"),
        ("uint16", "ushort, unsigned short, unsigned short int, uint16, uint16_t"),
        ("int32", "int, signed int, int32, int32_t"),
        ("uint32", "uint, unsigned int, uint32, uint32_t"),
        (
            "int64",
            "longlong, long long, long long int, signed long long, signed long long int, int64, int64_t",
        ),
        ("uint64", "ulonglong, unsigned long long, unsigned long long int, uint64, uint64_t"),
        ("float32", "float, FLOAT"),
        ("float64", "double, Double"),
    ];
    let folder = Folder::new();
    for (kind, aliases) in names {
        for alias in aliases.split(", ") {
            let header =
                nrrd_header(&[("type", Some(alias)), ("encoding", Some("txt")), ("sizes", Some("1 1 1"))]);
            let path = folder.put("a.nrrd", &joined(&(header + "\n"), b"7"));
            let volume = cao_formats::read(&path).unwrap();
            assert_eq!((volume.values.kind(), volume.value(0)), (kind, 7.0), "{alias}");
        }
    }
}

#[test]
fn nrrd_accepts_dos_line_ends_any_case_second_names_and_all_versions() {
    let folder = Folder::new();
    for version in ["NRRD00.01", "NRRD0001", "NRRD0002", "NRRD0003", "NRRD0004", "NRRD0005"] {
        let header = format!(
            "{version}\r\nType: UCHAR\r\nDIMENSION: 3\r\nsizes: 2 1 1\r\nEncoding: RAW\r\ncenterings: cell cell cell\r\n\
             content:\r\nOldMin: 0\r\nlabels: \"x\" \"y\" \"the z\"\r\n\r\n"
        );
        let volume = cao_formats::read(&folder.put("a.nrrd", &joined(&header, &[8, 9]))).unwrap();
        assert_eq!(volume.values, Values::U8(vec![8, 9]));
        assert_eq!(volume.spacing, [1.0; 3]);
    }
}

#[test]
fn nrrd_joins_slices_from_lists_and_numbered_files() {
    let folder = Folder::new();
    let data = bytes_of(&nrrd_values(), Endian::Little);
    for (i, slice) in data.chunks(30).enumerate() {
        folder.put(&format!("slice{:03}.raw", 8 + 2 * i), slice);
        folder.put(&format!("down {}.raw.gz", 1 - i), &gzip(slice));
    }
    for (i, row) in data.chunks(10).enumerate() {
        folder.put(&format!("row%{i}.raw"), row);
    }
    folder.put("all.raw", &data);
    let raw = [
        "LIST\nslice008.raw\nslice010.raw\n",
        "LIST 2\r\nslice008.raw\r\n\r\nslice010.raw",
        "LIST 3\nslice008.raw\nslice010.raw\n",
        "LIST 3\nall.raw\n",
        "LIST 1\nrow%0.raw\nrow%1.raw\nrow%2.raw\nrow%3.raw\nrow%4.raw\nrow%5.raw\n",
        "slice%03d.raw 8 10 2\n",
        "slice%03d.raw 8 11 2 2\n",
        "row%%%d.raw 0 5 1 1\n",
    ];
    for value in raw {
        let path = folder.put("a.nhdr", (nrrd_header(&[]) + "data file: " + value).as_bytes());
        assert_eq!(cao_formats::read(&path).unwrap().values, nrrd_values(), "{value}");
    }
    let compressed = nrrd_header(&[("encoding", Some("gzip"))]);
    let list = compressed.clone() + "data file: LIST\ndown 1.raw.gz\ndown 0.raw.gz\n";
    assert_eq!(cao_formats::read(&folder.put("a.nhdr", list.as_bytes())).unwrap().values, nrrd_values());
}

#[test]
fn nrrd_skips_lines_and_bytes_before_the_data() {
    let folder = Folder::new();
    let data = bytes_of(&nrrd_values(), Endian::Little);
    let text = text_of(&nrrd_values());
    let cases = [
        ("raw", joined("one\ntwo\n123", &data), "2", "3"),
        ("raw", joined("any length of foreign header", &data), "0", "-1"),
        // Lines before decompression, bytes after it.
        ("gzip", joined("one\n", &gzip(&joined("123", &data))), "1", "3"),
        ("ascii", joined("one\n77 ", &text), "1", "3"),
    ];
    for (encoding, file, lines, bytes) in cases {
        let changes = [("encoding", Some(encoding)), ("line skip", Some(lines)), ("byte skip", Some(bytes))];
        folder.put("a.raw", &file);
        let detached = folder.put("a.nhdr", (nrrd_header(&changes) + "data file: a.raw\n").as_bytes());
        let attached = folder.put("a.nrrd", &joined(&(nrrd_header(&changes) + "\n"), &file));
        for path in [detached, attached] {
            assert_eq!(cao_formats::read(&path).unwrap().values, nrrd_values(), "{encoding} {lines} {bytes}");
        }
    }
}

#[test]
fn nrrd_turns_directions_and_units_into_millimetres_in_ras() {
    let folder = Folder::new();
    let path = nrrd(
        &folder,
        &[
            ("spacings", None),
            ("space", Some("left-posterior-superior")),
            ("space directions", Some("(0,50,0) (-100, 0, 0) (0,0,200)")),
            ("space units", Some("\"um\" \"um\" \"um\"")),
            ("space origin", Some("(1000,2000,3000)")),
        ],
    );
    let volume = stored(&path);
    assert_eq!(volume.space, Space::Ras);
    assert_close(volume.spacing, [0.05, 0.1, 0.2]);
    assert_close(volume.origin, [-1.0, -2.0, 3.0]);
    assert_close(volume.directions[0], [0.0, -1.0, 0.0]);
    assert_close(volume.directions[1], [1.0, 0.0, 0.0]);
    assert_close(volume.directions[2], [0.0, 0.0, 1.0]);

    let path = nrrd(&folder, &[("space", Some("LAS")), ("space origin", Some("(1,2,3)"))]);
    let volume = stored(&path);
    assert_close(volume.origin, [-1.0, 2.0, 3.0]);
    assert_close(volume.spacing, [0.5, 1.0, 2.0]);

    let scanner = [("space", Some("scanner-xyz")), ("space origin", Some("(1,2,3)"))];
    let volume = cao_formats::read(&nrrd(&folder, &scanner)).unwrap();
    assert_eq!((volume.space, volume.origin), (Space::Unknown, [1.0, 2.0, 3.0]));

    let volume = cao_formats::read(&nrrd(&folder, &[("units", Some("\"cm\" \"mm\" \"furlong\""))])).unwrap();
    assert_eq!(volume.spacing, [5.0, 1.0, 2.0]);

    let ends = [
        ("spacings", None),
        ("axis mins", Some("0 0 -1")),
        ("axis maxs", Some("5 4 1")),
        ("centers", Some("cell node cell")),
    ];
    assert_eq!(cao_formats::read(&nrrd(&folder, &ends)).unwrap().spacing, [1.0, 2.0, 1.0]);
}

#[test]
fn nrrd_drops_a_fourth_axis_of_one_sample() {
    let folder = Folder::new();
    let first = [
        ("dimension", Some("4")),
        ("sizes", Some("1 5 3 2")),
        ("spacings", None),
        ("space dimension", Some("3")),
        ("space directions", Some("none (1,0,0) (0,2,0) (0,0,3)")),
    ];
    let last = [
        ("dimension", Some("4")),
        ("sizes", Some("5 3 2 1")),
        ("spacings", Some("1 2 3 nan")),
        ("kinds", Some("domain domain domain list")),
    ];
    for changes in [&first[..], &last[..]] {
        let volume = cao_formats::read(&nrrd(&folder, changes)).unwrap();
        assert_eq!((volume.dims, volume.spacing), (DIMS, [1.0, 2.0, 3.0]));
        assert_eq!(volume.values, nrrd_values());
    }
}

#[test]
fn nrrd_says_which_field_of_the_header_is_wrong() {
    type Change<'a> = (&'a str, Option<&'a str>);
    let directions =
        |text| vec![("spacings", None), ("space dimension", Some("3")), ("space directions", Some(text))];
    let cases: Vec<(Vec<Change>, &str, &[&str])> = vec![
        (vec![("type", Some("block"))], "type", &["\"block\"", "uint8", "float64"]),
        (vec![("type", None)], "type", &["missing"]),
        (vec![("encoding", Some("bzip2"))], "encoding", &["bzip2", "expected raw, gzip or ascii"]),
        (vec![("encoding", None)], "encoding", &["missing"]),
        (vec![("endian", None)], "endian", &["missing", "int16"]),
        (vec![("endian", Some("middle"))], "endian", &["middle", "little or big"]),
        (vec![("dimension", None)], "dimension", &["missing"]),
        (vec![("dimension", Some("x"))], "dimension", &["\"x\""]),
        (
            vec![("dimension", Some("2")), ("sizes", Some("5 6"))],
            "dimension",
            &["2 axes", "expected a scalar volume"],
        ),
        (vec![("dimension", Some("4")), ("sizes", Some("5 3 1 2"))], "kinds", &["axis 0"]),
        (vec![("dimension", Some("4")), ("sizes", Some("3 5 1 2"))], "kinds", &["axis 0"]),
        (vec![("sizes", None)], "sizes", &["missing"]),
        (vec![("sizes", Some("5 3"))], "sizes", &["2 numbers, expected 3"]),
        (vec![("sizes", Some("5 -3 2"))], "sizes", &["5 -3 2"]),
        (vec![("sizes", Some("5 0 2"))], "sizes", &["5 × 0 × 2", "at least 1"]),
        (vec![("sizes", Some("4000000000 4000000000 4000000000"))], "sizes", &["more than any memory"]),
        (vec![("sizes", Some("99999 99999 9999"))], "data", &["60 bytes", "199976000419998 bytes"]),
        (vec![("spacings", Some("1 0 1"))], "spacings", &["0 mm", "positive"]),
        (vec![("spacings", Some("1 -2 1"))], "spacings", &["-2 mm"]),
        (vec![("spacings", Some("1 nan 1"))], "spacings", &["NaN mm"]),
        (vec![("spacings", Some("1 1e30 1"))], "spacings", &["expected a positive distance"]),
        (vec![("spacings", Some("1 1"))], "spacings", &["2 numbers, expected 3"]),
        (vec![("spacing", Some("1 1 1"))], "spacing", &["not a field of the format"]),
        (vec![("space", Some("sideways"))], "space", &["sideways", "LPS"]),
        (vec![("space", Some("RAST"))], "space", &["RAST"]),
        (vec![("space dimension", Some("2"))], "space dimension", &["2, expected 3"]),
        (vec![("space origin", Some("(1,2)"))], "space origin", &["(1,2)"]),
        (vec![("space origin", Some("(1,2,inf)"))], "space origin", &["finite"]),
        (
            vec![("space directions", Some("(1,0,0) (0,1,0) (0,0,1)"))],
            "spacings",
            &["beside `space directions`"],
        ),
        (directions("none (0,1,0) (0,0,1)"), "space directions", &["axis 0", "vectors"]),
        (directions("(1,0,0) (0,1,0)"), "space directions", &["3 times"]),
        (directions("(1,0,0) (0,1,0) (0,0,0)"), "space directions", &["axis 2"]),
        (directions("(1,0,0) (0,1,0) (0,nan,0)"), "space directions", &["axis 2"]),
        (directions("(1,0,0) (0,1,0) (0,1,1)"), "space directions", &["axes 1 and 2", "45.0°", "resampled"]),
        (vec![("kinds", Some("RGB-color domain domain"))], "kinds", &["axis 0"]),
        (vec![("byte skip", Some("-2"))], "byte skip", &["negative"]),
        (vec![("byte skip", Some("99"))], "byte skip", &["99", "only 60 bytes"]),
        (vec![("line skip", Some("9999999999999"))], "line skip", &["9999999999999 lines"]),
        (vec![("encoding", Some("gzip")), ("byte skip", Some("-1"))], "byte skip", &["raw only"]),
        (vec![("units", Some("mm"))], "units", &["1 units, expected 3"]),
    ];
    let folder = Folder::new();
    for (changes, field, says) in cases {
        let mut changes = changes;
        if field == "kinds" && changes[0].0 == "dimension" {
            changes.extend([("spacings", Some("1 1 1 1")), ("kinds", Some("vector domain domain domain"))]);
        }
        let path = nrrd(&folder, &changes);
        assert_refused(cao_formats::read(&path), &path, field, says);
    }
    let path = folder.put("a.nrrd", b"NRRD0009\n\n");
    assert_refused(cao_formats::read(&path), &path, "magic", &["NRRD0009", "NRRD0005"]);
    let path = folder.put("a.nrrd", b"");
    assert_refused(cao_formats::read(&path), &path, "magic", &["expected NRRD0001"]);
    let path = folder.put("a.nrrd", b"NRRD0004\ntype uint8\n\n");
    assert_refused(cao_formats::read(&path), &path, "header", &["type uint8", "field: value"]);
    let path = folder.put("a.nrrd", (nrrd_header(&[]) + "type: float\n\n").as_bytes());
    assert_refused(cao_formats::read(&path), &path, "type", &["given twice"]);
}

#[test]
fn nrrd_says_what_is_wrong_with_the_data() {
    let folder = Folder::new();
    let data = bytes_of(&nrrd_values(), Endian::Little);
    let packed = gzip(&data);
    let noise: Vec<u8> = (0..200u32).map(|i| ((i * i * 37) >> 3) as u8).collect();
    let mut flipped = packed.clone();
    *flipped.last_mut().unwrap() ^= 1;
    let checksum = packed.len() - 5;
    let mut wrong_sum = packed.clone();
    wrong_sum[checksum] ^= 0x40;
    let cases: Vec<(&str, Vec<u8>, &[&str])> = vec![
        ("raw", data[..59].to_vec(), &["59 bytes", "exactly 60 bytes", "30 values of type int16"]),
        ("raw", vec![], &["0 bytes", "exactly 60 bytes"]),
        ("gzip", vec![], &["0 bytes of compressed data", "60 bytes"]),
        ("gzip", packed[..packed.len() / 2].to_vec(), &["truncated or damaged", "60 bytes"]),
        ("gzip", packed[..packed.len() - 2].to_vec(), &["truncated or damaged"]),
        ("gzip", gzip(&data[..50]), &["50 bytes after decompression", "exactly 60 bytes"]),
        ("gzip", flipped, &["truncated or damaged"]),
        ("gzip", wrong_sum, &["truncated or damaged"]),
        ("gzip", noise, &["truncated or damaged"]),
        ("ascii", b"1 2 3".to_vec(), &["5 bytes of text", "30 numbers"]),
        ("ascii", b"1 ".repeat(29), &["58 bytes of text"]),
        ("ascii", b"1,\t".repeat(29), &["29 numbers, expected 30"]),
        ("ascii", b"1 40000 ".repeat(15), &["value 1", "40000", "int16"]),
        ("ascii", b"1 x ".repeat(15), &["value 1", "\"x\""]),
        ("ascii", b"1 \xff ".repeat(15), &["value 1"]),
    ];
    for (encoding, data, says) in cases {
        let header = nrrd_header(&[("encoding", Some(encoding))]);
        let attached = folder.put("a.nrrd", &joined(&(header.clone() + "\n"), &data));
        assert_refused(cao_formats::read(&attached), &attached, "data", says);
        // Detached data: the data file is the one at fault.
        let detached = folder.put("a.nhdr", (header + "data file: a.raw\n").as_bytes());
        let file = folder.put("a.raw", &data);
        assert_refused(cao_formats::read(&detached), &file, "data", says);
    }
}

#[test]
fn nrrd_says_which_data_file_is_missing_or_does_not_fit() {
    let folder = Folder::new();
    folder.put("one.raw", &[0; 30]);
    fs::create_dir(folder.0.path().join("folder")).unwrap();
    let cases: [(&str, &[&str]); 12] = [
        ("gone.raw", &["gone.raw", "No such file"]),
        ("folder", &["not a regular file"]),
        ("", &["empty"]),
        ("LIST\none.raw\ngone.raw\n", &["gone.raw", "No such file"]),
        ("LIST\none.raw\n", &["1 data files", "[5, 3, 2]"]),
        ("LIST 0\none.raw\n", &["dimension 0"]),
        ("LIST 4\none.raw\n", &["dimension 4"]),
        ("LIST 3\n", &["0 data files"]),
        ("one%d.raw 1 2 0", &["never ends"]),
        ("one%d.raw -9223372036854775808 9223372036854775807 1", &["at most"]),
        ("one%d.raw 9223372036854775807 -9223372036854775808 9223372036854775807", &["never ends"]),
        ("one%s.raw 1 2 1", &["one%s.raw", "%03d"]),
    ];
    for (value, says) in cases {
        let path = folder.put("a.nhdr", (nrrd_header(&[]) + "data file: " + value + "\n").as_bytes());
        assert_refused(cao_formats::read(&path), &path, "data file", says);
    }
}

#[test]
fn absurd_promises_cost_nothing_and_bombs_are_cut_off() {
    let folder = Folder::new();
    // 10¹⁵ bytes from a short file: refused before memory is asked for, whatever the encoding.
    for encoding in ["raw", "gzip", "ascii"] {
        let path = nrrd(&folder, &[("encoding", Some(encoding)), ("sizes", Some("100000 100000 50000"))]);
        assert_refused(cao_formats::read(&path), &path, "data", &["60 bytes"]);
    }
    // 64 MiB of zeros where 60 bytes are expected.
    let header = nrrd_header(&[("encoding", Some("gzip"))]) + "\n";
    let path = folder.put("bomb.nrrd", &joined(&header, &gzip(&vec![0; 64 << 20])));
    let start = std::time::Instant::now();
    assert_eq!(cao_formats::read(&path).unwrap().values, Values::I16(vec![0; COUNT]));
    assert!(start.elapsed().as_secs_f64() < 0.2, "what follows the 60 bytes is not decompressed");
    // The same for a data file beside the header.
    let header = nrrd_header(&[("sizes", Some("5 3 20000000000"))]);
    let path = folder.put("a.nhdr", (header + "data file: bomb.nrrd\n").as_bytes());
    assert_refused(
        cao_formats::read(&path),
        &folder.0.path().join("bomb.nrrd"),
        "data",
        &["600000000000 bytes"],
    );
}

#[test]
fn values_that_are_no_numbers_are_refused_with_their_place_and_count() {
    let folder = Folder::new();
    let mut numbers = vec![1.0f32; COUNT];
    (numbers[16], numbers[29]) = (f32::NAN, f32::NEG_INFINITY);
    let values = Values::F32(numbers);
    let says = ["2 of 30 values", "(NaN)", "voxel (1, 0, 1)", "finite", "--nan VALUE|transparent"];
    for encoding in ["raw", "ascii"] {
        let data = if encoding == "raw" { bytes_of(&values, Endian::Big) } else { text_of(&values) };
        let changes = [("type", Some("float")), ("endian", Some("big")), ("encoding", Some(encoding))];
        let path = folder.put("a.nrrd", &joined(&(nrrd_header(&changes) + "\n"), &data));
        assert_refused(cao_formats::read(&path), &path, "data", &says);
    }
    let path = folder.put("a.raw", &bytes_of(&values, Endian::Little));
    assert_refused(
        cao_formats::read_raw(&path, DIMS, "float", Endian::Little, [1.0; 3]),
        &path,
        "data",
        &says,
    );
    let path = folder.put(
        "a.mha",
        &joined(&meta_header(&[("ElementType", "MET_FLOAT")]), &bytes_of(&values, Endian::Little)),
    );
    assert_refused(cao_formats::read(&path), &path, "data", &says);
    let path = folder.put("a.nii", &Nifti::new(1, &values, Endian::Big).file());
    assert_refused(cao_formats::read(&path), &path, "data", &says);
}

// ----------------------------------------------------------------------------------------------------------- NIfTI

/// A header of 348 or 540 bytes and its data, fields by their offsets in the format's description.
#[derive(Clone)]
pub struct Nifti {
    pub header: Vec<u8>,
    pub data: Vec<u8>,
    endian: Endian,
    version: u8,
}

impl Nifti {
    pub fn new(version: u8, values: &Values, endian: Endian) -> Self {
        let code: i16 = match values.kind() {
            "uint8" => 2,
            "int16" => 4,
            "int32" => 8,
            "float32" => 16,
            "float64" => 64,
            "int8" => 256,
            "uint16" => 512,
            "uint32" => 768,
            "int64" => 1024,
            _ => 1280,
        };
        let size = if version == 1 { 348 } else { 540 };
        let mut nifti = Nifti { header: vec![0; size], data: bytes_of(values, endian), endian, version };
        nifti.put(0, &(size as i32).to_le_bytes());
        let magic =
            if version == 1 { (344, b"n+1\0".as_slice()) } else { (4, b"n+2\0\r\n\x1a\n".as_slice()) };
        nifti.header[magic.0..magic.0 + magic.1.len()].copy_from_slice(magic.1);
        nifti.put(if version == 1 { 70 } else { 12 }, &code.to_le_bytes());
        nifti.dim(&[3, 5, 3, 2, 1, 1, 1, 1]);
        nifti.reals((76, 104), &[1.0, 0.5, 1.0, 2.0]);
        nifti.offset(size as f64 + 4.0);
        nifti
    }

    /// Bytes in little-endian order into the file's order.
    fn put(&mut self, at: usize, bytes: &[u8]) {
        let mut bytes = bytes.to_vec();
        if self.endian == Endian::Big {
            bytes.reverse();
        }
        self.header[at..at + bytes.len()].copy_from_slice(&bytes);
    }

    pub fn dim(&mut self, dim: &[i64]) {
        for (i, d) in dim.iter().enumerate() {
            match self.version {
                1 => self.put(40 + 2 * i, &(*d as i16).to_le_bytes()),
                _ => self.put(16 + 8 * i, &d.to_le_bytes()),
            }
        }
    }

    fn reals(&mut self, at: (usize, usize), values: &[f64]) {
        for (i, v) in values.iter().enumerate() {
            match self.version {
                1 => self.put(at.0 + 4 * i, &(*v as f32).to_le_bytes()),
                _ => self.put(at.1 + 8 * i, &v.to_le_bytes()),
            }
        }
    }

    pub fn offset(&mut self, offset: f64) {
        match self.version {
            1 => self.put(108, &(offset as f32).to_le_bytes()),
            _ => self.put(168, &(offset as i64).to_le_bytes()),
        }
    }

    fn codes(&mut self, qform: i16, sform: i16) {
        match self.version {
            1 => {
                self.put(252, &qform.to_le_bytes());
                self.put(254, &sform.to_le_bytes());
            }
            _ => {
                self.put(344, &i32::from(qform).to_le_bytes());
                self.put(348, &i32::from(sform).to_le_bytes());
            }
        }
    }

    fn units(&mut self, code: u8) {
        match self.version {
            1 => self.put(123, &[code]),
            _ => self.put(500, &i32::from(code).to_le_bytes()),
        }
    }

    fn sform(&mut self, rows: [[f64; 4]; 3]) {
        for (at, row) in [(280, 400), (296, 432), (312, 464)].into_iter().zip(rows) {
            self.reals(at, &row);
        }
    }

    pub fn file(&self) -> Vec<u8> {
        [self.header.as_slice(), &[0; 4], &self.data].concat()
    }
}

const SLOPE: (usize, usize) = (112, 176);
const PIXDIM: (usize, usize) = (76, 104);
const QUATERN: (usize, usize) = (256, 352);
const QOFFSET: (usize, usize) = (268, 376);

#[test]
fn nifti_returns_every_type_and_byte_order_of_both_versions_compressed_and_in_pairs() {
    let folder = Folder::new();
    for values in all_types() {
        for (endian, name) in ENDIANS {
            for version in [1, 2] {
                let mut nifti = Nifti::new(version, &values, endian);
                let mut paths = vec![
                    folder.put("a.nii", &nifti.file()),
                    folder.put("a.nii.gz", &gzip(&nifti.file())),
                    // The content says what it is, whatever the name.
                    folder.put("a.dat", &nifti.file()),
                ];
                let magic = if version == 1 { 345 } else { 5 };
                nifti.header[magic] = b'i';
                nifti.offset(0.0);
                paths.push(folder.put("pair.hdr", &nifti.header));
                paths.push(folder.put("pair.img", &nifti.data));
                paths.push(folder.put("zipped.hdr.gz", &gzip(&nifti.header)));
                paths.push(folder.put("zipped.img.gz", &gzip(&nifti.data)));
                for path in paths {
                    let volume = cao_formats::read(&path).unwrap();
                    assert_eq!(
                        volume.values,
                        values,
                        "{} {name} {version} {}",
                        values.kind(),
                        path.display()
                    );
                    assert_eq!((volume.dims, volume.spacing), (DIMS, [0.5, 1.0, 2.0]));
                    assert_eq!((volume.space, volume.origin), (Space::Unknown, [0.0; 3]));
                }
            }
        }
    }
}

#[test]
fn nifti_keeps_stored_values_and_scales_on_access() {
    let folder = Folder::new();
    for version in [1, 2] {
        for (slope, intercept, expected) in
            [(2.0, -1024.0, (2.0, -1024.0)), (0.0, 5.0, (1.0, 0.0)), (f64::NAN, f64::NAN, (1.0, 0.0))]
        {
            let mut nifti = Nifti::new(version, &nrrd_values(), Endian::Big);
            nifti.reals(SLOPE, &[slope, intercept]);
            let volume = cao_formats::read(&folder.put("a.nii", &nifti.file())).unwrap();
            assert_eq!((volume.slope, volume.intercept), expected);
            assert_eq!(volume.values, nrrd_values());
            assert_eq!(volume.value(3), expected.0 * -700.0 + expected.1);
        }
    }
}

#[test]
fn a_slope_that_leads_beyond_all_numbers_is_refused() {
    let folder = Folder::new();
    let mut nifti = Nifti::new(2, &nrrd_values(), Endian::Little);
    nifti.reals(SLOPE, &[1e308, 0.0]);
    let path = folder.put("a.nii", &nifti.file());
    assert_refused(cao_formats::read(&path), &path, "data", &["slope", "finite"]);
}

#[test]
fn nifti_places_the_grid_by_sform_qform_and_units() {
    let folder = Folder::new();
    for version in [1, 2] {
        let mut nifti = Nifti::new(version, &nrrd_values(), Endian::Little);
        nifti.reals(PIXDIM, &[-1.0, 0.5, -1.0, 2.0]);
        // A quarter turn about z: x → y, y → −x; the third axis turned round by pixdim[0].
        nifti.reals(QUATERN, &[0.0, 0.0, 0.5f64.sqrt()]);
        nifti.reals(QOFFSET, &[1.0, 2.0, 3.0]);
        nifti.codes(1, 0);
        let volume = stored(&folder.put("a.nii", &nifti.file()));
        assert_eq!(volume.space, Space::Ras);
        assert_close(volume.spacing, [0.5, 1.0, 2.0]);
        assert_close(volume.origin, [1.0, 2.0, 3.0]);
        assert_close(volume.directions[0], [0.0, 1.0, 0.0]);
        assert_close(volume.directions[1], [-1.0, 0.0, 0.0]);
        assert_close(volume.directions[2], [0.0, 0.0, -1.0]);

        nifti.sform([[0.0, 1.0, 0.0, 7.0], [0.0, 0.0, 2.0, 8.0], [0.5, 0.0, 0.0, 9.0]]);
        nifti.codes(1, 2);
        for (unit, factor) in [(0, 1.0), (1, 1000.0), (2, 1.0), (3, 1e-3), (2 + 8, 1.0)] {
            nifti.units(unit);
            let volume = stored(&folder.put("a.nii", &nifti.file()));
            assert_close(volume.spacing.map(|s| s / factor), [0.5, 1.0, 2.0]);
            assert_close(volume.origin.map(|o| o / factor), [7.0, 8.0, 9.0]);
            assert_close(volume.directions[0], [0.0, 0.0, 1.0]);
            assert_close(volume.directions[1], [1.0, 0.0, 0.0]);
            assert_close(volume.directions[2], [0.0, 1.0, 0.0]);
        }
        // What pixdim says is rounding or a registration's business; points of the patient are the sform's.
        nifti.units(2);
        nifti.sform([[0.0, 1.0, 0.0, 7.0], [0.0, 0.0, 2.2, 8.0], [0.5, 0.0, 0.0, 9.0]]);
        assert_close(stored(&folder.put("a.nii", &nifti.file())).spacing, [0.5, 1.0, 2.2]);
        // An sform that is announced and left blank gives way to the qform.
        nifti.sform([[0.0; 4]; 3]);
        assert_close(stored(&folder.put("a.nii", &nifti.file())).directions[0], [0.0, 1.0, 0.0]);
    }
}

#[test]
fn a_sheared_sform_is_refused_and_no_qform_hides_it() {
    let folder = Folder::new();
    // A gantry tilted by 15° and by 0.3°.
    for (shift, says) in [(0.536, "75.0°"), (0.0105, "89.7°")] {
        for (version, qform, sform) in [(1, 0, 1), (1, 1, 1), (2, 1, 2), (2, 2, 4)] {
            let mut nifti = Nifti::new(version, &nrrd_values(), Endian::Little);
            nifti.codes(qform, sform);
            nifti.sform([[0.5, 0.0, 0.0, 7.0], [0.0, 1.0, shift, 8.0], [0.0, 0.0, 2.0, 9.0]]);
            let path = folder.put("a.nii", &nifti.file());
            assert_refused(
                cao_formats::read(&path),
                &path,
                "srow",
                &["axes 1 and 2", says, "gantry", "resampled"],
            );
        }
    }
}

#[test]
fn nifti_accepts_a_fourth_dimension_of_one_and_extensions_before_the_data() {
    let folder = Folder::new();
    for version in [1, 2] {
        let mut nifti = Nifti::new(version, &nrrd_values(), Endian::Little);
        nifti.dim(&[4, 5, 3, 2, 1]);
        nifti.offset(nifti.header.len() as f64 + 4.0 + 16.0);
        nifti.data.splice(0..0, [9; 16]);
        for (name, file) in [("a.nii", nifti.file()), ("a.nii.gz", gzip(&nifti.file()))] {
            assert_eq!(cao_formats::read(&folder.put(name, &file)).unwrap().values, nrrd_values());
        }
    }
}

#[test]
fn nifti_says_which_field_is_wrong() {
    type Change = fn(&mut Nifti);
    let cases: Vec<(Change, &str, &[&str])> = vec![
        (|n| n.dim(&[2, 5, 6]), "dim[0]", &["2 dimensions", "expected 3"]),
        (|n| n.dim(&[4, 5, 3, 2, 7]), "dim[4]", &["a series of 7 volumes", "--frame-index 0 … 6"]),
        (|n| n.dim(&[5, 5, 3, 2, 1, 3]), "dim[5]", &["3, expected 1"]),
        (|n| n.dim(&[3, 5, -3, 2]), "dim[2]", &["-3"]),
        (|n| n.dim(&[3, 5, 0, 2]), "dim", &["5 × 0 × 2"]),
        (|n| n.dim(&[3, 32767, 32767, 32767]), "data", &["60 bytes", "70362301923326 bytes"]),
        (|n| n.reals(PIXDIM, &[1.0, 1.0, 0.0, 1.0]), "pixdim", &["0 mm"]),
        (|n| n.reals(PIXDIM, &[1.0, 1.0, f64::NAN, 1.0]), "pixdim", &["NaN mm"]),
        (|n| n.reals(PIXDIM, &[1.0, 1.0, 1e20, 1.0]), "pixdim", &["expected a positive distance"]),
        (
            |n| n.put(if n.version == 1 { 70 } else { 12 }, &128i16.to_le_bytes()),
            "datatype",
            &["128", "scalar"],
        ),
        (|n| n.reals(SLOPE, &[f64::INFINITY, 0.0]), "scl_slope", &["inf"]),
        (|n| n.units(7), "xyzt_units", &["7"]),
        (|n| n.reals(SLOPE, &[1.0, f64::NAN]), "scl_inter", &["NaN"]),
        (|n| n.units(4), "xyzt_units", &["4"]),
        (|n| n.offset(100.0), "vox_offset", &["100", "at least"]),
        (|n| n.offset(1e9), "data", &["0 bytes", "exactly 60 bytes"]),
        (|n| n.codes(0, 1), "srow", &["axis 0"]),
        (|n| (n.codes(1, 0), n.reals(QUATERN, &[f64::NAN])).0, "quatern", &["NaN"]),
        (|n| (n.codes(1, 0), n.reals(QOFFSET, &[f64::INFINITY])).0, "qoffset", &["inf"]),
        (|n| n.data.truncate(59), "data", &["59 bytes", "exactly 60 bytes"]),
        (|n| n.header[if n.version == 1 { 344 } else { 4 }] = b'x', "magic", &["x+"]),
        (|n| n.header[0..4].fill(1), "sizeof_hdr", &["16843009", "348", "540"]),
        (|n| (n.header.truncate(300), n.data.truncate(10)).0, "header", &["314 bytes"]),
    ];
    let folder = Folder::new();
    for version in [1, 2] {
        for (endian, _) in ENDIANS {
            for (change, field, says) in &cases {
                let mut nifti = Nifti::new(version, &nrrd_values(), endian);
                change(&mut nifti);
                let path = folder.put("a.nii", &nifti.file());
                assert_refused(cao_formats::read(&path), &path, field, says);
            }
        }
        let mut pair = Nifti::new(version, &nrrd_values(), Endian::Little);
        pair.header[if version == 1 { 345 } else { 5 }] = b'i';
        let path = folder.put("lonely.hdr", &pair.header);
        assert_refused(cao_formats::read(&path), &path, "data", &["lonely.img", "No such file"]);
        let packed = gzip(&Nifti::new(version, &nrrd_values(), Endian::Little).file());
        let path = folder.put("a.nii.gz", &packed[..packed.len() - 9]);
        assert_refused(cao_formats::read(&path), &path, "data", &["truncated or damaged"]);
        let path = folder.put("a.nii.gz", &packed[..15]);
        assert_refused(cao_formats::read(&path), &path, "header", &[]);
    }
}

// ------------------------------------------------------------------------------------------------------- MetaImage

/// A header ending with the data file's line, its values replaced or added before that; `""` leaves a key out.
pub fn meta_header(changed: &[(&str, &str)]) -> String {
    let mut fields = vec![
        ("ObjectType", "Image"),
        ("NDims", "3"),
        ("BinaryData", "True"),
        ("BinaryDataByteOrderMSB", "False"),
        ("DimSize", "5 3 2"),
        ("ElementSpacing", "0.5 1 2"),
        ("ElementType", "MET_SHORT"),
        ("ElementDataFile", "LOCAL"),
    ];
    for &(key, value) in changed {
        match fields.iter_mut().find(|(k, _)| *k == key) {
            Some(field) => field.1 = value,
            None => fields.insert(fields.len() - 1, (key, value)),
        }
    }
    fields.iter().filter(|(_, v)| !v.is_empty()).map(|(k, v)| format!("{k} = {v}\n")).collect()
}

fn meta(folder: &Folder, changed: &[(&str, &str)]) -> PathBuf {
    folder.put("a.mha", &joined(&meta_header(changed), &bytes_of(&nrrd_values(), Endian::Little)))
}

#[test]
fn metaimage_returns_every_type_byte_order_and_encoding_attached_and_detached() {
    let folder = Folder::new();
    for values in all_types() {
        let names: &[&str] = match values.kind() {
            "uint8" => &["MET_UCHAR"],
            "int8" => &["MET_CHAR"],
            "uint16" => &["MET_USHORT"],
            "int16" => &["MET_SHORT"],
            "uint32" => &["MET_UINT", "MET_ULONG"],
            "int32" => &["MET_INT", "MET_LONG"],
            "uint64" => &["MET_ULONG_LONG"],
            "int64" => &["MET_LONG_LONG"],
            "float32" => &["MET_FLOAT"],
            _ => &["MET_DOUBLE"],
        };
        for (endian, _) in ENDIANS {
            let big = if endian == Endian::Big { "True" } else { "False" };
            for (encoding, data) in [
                ("raw", bytes_of(&values, endian)),
                ("zlib", zlib(&bytes_of(&values, endian))),
                ("gzip", gzip(&bytes_of(&values, endian))),
                ("ascii", text_of(&values)),
            ] {
                let size = data.len().to_string();
                for name in names {
                    let mut changes = vec![("ElementType", *name), ("BinaryDataByteOrderMSB", big)];
                    match encoding {
                        "raw" => {}
                        "ascii" => changes.push(("BinaryData", "False")),
                        _ => changes.extend([("CompressedData", "True"), ("CompressedDataSize", &size)]),
                    }
                    let local = folder.put("a.mha", &joined(&meta_header(&changes), &data));
                    folder.put("a.data", &data);
                    changes.push(("ElementDataFile", "a.data"));
                    let detached = folder.put("a.mhd", meta_header(&changes).as_bytes());
                    for path in [local, detached] {
                        let volume = cao_formats::read(&path).unwrap();
                        assert_eq!(volume.values, values, "{name} {big} {encoding}");
                        assert_eq!((volume.dims, volume.spacing), (DIMS, [0.5, 1.0, 2.0]));
                        assert_eq!(volume.space, Space::Unknown);
                    }
                }
            }
        }
    }
}

#[test]
fn metaimage_joins_slices_and_skips_foreign_headers() {
    let folder = Folder::new();
    let data = bytes_of(&nrrd_values(), Endian::Little);
    for (i, slice) in data.chunks(30).enumerate() {
        folder.put(&format!("slice{:02}.raw", i + 1), slice);
        folder.put(&format!("head{i}.raw"), &joined("foreign", slice));
    }
    for (file, size) in [
        ("slice%02d.raw 1 2 1", "0"),
        ("LIST\nslice01.raw\nslice02.raw", "0"),
        ("LIST 2D\nslice01.raw\nslice02.raw", "0"),
        ("head%d.raw 0 1 1", "7"),
        ("head%d.raw 0 1 1", "-1"),
    ] {
        let header = meta_header(&[("ElementDataFile", file), ("HeaderSize", size)]);
        let path = folder.put("a.mhd", header.as_bytes());
        assert_eq!(cao_formats::read(&path).unwrap().values, nrrd_values(), "{file}");
    }
}

#[test]
fn metaimage_turns_lps_into_ras_and_units_into_millimetres() {
    let folder = Folder::new();
    for (position, matrix) in
        [("Offset", "TransformMatrix"), ("Position", "Orientation"), ("Origin", "Rotation")]
    {
        let path = meta(
            &folder,
            &[
                ("ElementSpacing", ""),
                ("ElementSize", "0.05 0.1 0.2"),
                ("DistanceUnits", "cm"),
                (position, "1 2 3"),
                (matrix, "0 1 0 -1 0 0 0 0 1"),
                ("ElementToIntensityFunctionSlope", "2"),
                ("ElementToIntensityFunctionOffset", "-5"),
                ("AnatomicalOrientation", "RAI"),
                ("SomebodysKey", "any = thing"),
            ],
        );
        let volume = stored(&path);
        assert_eq!(volume.space, Space::Ras);
        assert_close(volume.spacing, [0.5, 1.0, 2.0]);
        assert_close(volume.origin, [-10.0, -20.0, 30.0]);
        assert_close(volume.directions[0], [0.0, -1.0, 0.0]);
        assert_close(volume.directions[1], [1.0, 0.0, 0.0]);
        assert_close(volume.directions[2], [0.0, 0.0, 1.0]);
        assert_eq!((volume.slope, volume.intercept, volume.value(0)), (2.0, -5.0, -2005.0));
    }
}

#[test]
fn metaimage_says_which_field_is_wrong() {
    type Case<'a> = (&'a [(&'a str, &'a str)], &'a str, &'a [&'a str]);
    let cases: [Case; 27] = [
        (&[("ObjectType", "Scene")], "ObjectType", &["Scene", "expected Image"]),
        (&[("NDims", "2")], "NDims", &["2, expected 3"]),
        (&[("NDims", "x")], "NDims", &["\"x\""]),
        (&[("ElementNumberOfChannels", "3")], "ElementNumberOfChannels", &["3, expected 1"]),
        (&[("DimSize", "")], "DimSize", &["missing"]),
        (&[("DimSize", "5 3")], "DimSize", &["2 numbers, expected 3"]),
        (&[("DimSize", "5 -3 2")], "DimSize", &["5 -3 2"]),
        (&[("DimSize", "5 0 2")], "DimSize", &["5 × 0 × 2"]),
        (&[("DimSize", "9999999999 9999999999 9999999999")], "DimSize", &["more than any memory"]),
        (&[("DimSize", "50000 50000 50000")], "data", &["60 bytes", "250000000000000 bytes"]),
        (&[("ElementSpacing", "1 0 1")], "ElementSpacing", &["0 mm"]),
        (&[("ElementSpacing", "1 -1 1")], "ElementSpacing", &["-1 mm"]),
        (&[("ElementSpacing", "1 nan 1")], "ElementSpacing", &["NaN mm"]),
        (&[("DistanceUnits", "parsec")], "DistanceUnits", &["parsec"]),
        (&[("Offset", "1 2")], "Offset", &["2 numbers, expected 3"]),
        (&[("Offset", "1 2 inf")], "Offset", &["not finite"]),
        (&[("TransformMatrix", "1 0 0 0 1 0 0 1 1")], "TransformMatrix", &["45.0°"]),
        (&[("ElementType", "MET_STRING")], "ElementType", &["MET_STRING", "MET_DOUBLE"]),
        (&[("ElementType", "")], "ElementType", &["missing"]),
        (&[("BinaryDataByteOrderMSB", "maybe")], "BinaryDataByteOrderMSB", &["maybe", "True or False"]),
        (&[("BinaryData", "False"), ("CompressedData", "True")], "CompressedData", &["BinaryData"]),
        (
            &[("CompressedData", "True"), ("CompressedDataSize", "61")],
            "CompressedDataSize",
            &["61 bytes", "holds 60"],
        ),
        (&[("CompressedData", "True"), ("HeaderSize", "-1")], "HeaderSize", &["-1"]),
        (&[("HeaderSize", "-2")], "HeaderSize", &["-2"]),
        (&[("HeaderSize", "99999")], "data", &["0 bytes"]),
        (&[("ElementToIntensityFunctionSlope", "nan")], "ElementToIntensityFunctionSlope", &["NaN"]),
        (&[("ElementDataFile", "gone.raw")], "ElementDataFile", &["gone.raw", "No such file"]),
    ];
    let folder = Folder::new();
    for (changes, field, says) in cases {
        let path = meta(&folder, changes);
        assert_refused(cao_formats::read(&path), &path, field, says);
    }
    let path = folder.put("a.mha", b"NDims = 3\n");
    assert_refused(cao_formats::read(&path), &path, "ElementDataFile", &["missing", "last line"]);
    let path = folder.put("a.mha", b"NDims = 3\nNDims = 3\n");
    assert_refused(cao_formats::read(&path), &path, "NDims", &["given twice"]);
    let path = folder.put("a.mha", b"\x00\x01\x02");
    assert_refused(cao_formats::read(&path), &path, "header", &["expected `Key = value`"]);
    let data = bytes_of(&nrrd_values(), Endian::Little);
    let path = folder.put("a.mha", &joined(&meta_header(&[]), &data[..58]));
    assert_refused(cao_formats::read(&path), &path, "data", &["58 bytes", "exactly 60 bytes"]);
    let packed = zlib(&data);
    let path = folder
        .put("a.mha", &joined(&meta_header(&[("CompressedData", "True")]), &packed[..packed.len() - 3]));
    assert_refused(cao_formats::read(&path), &path, "data", &["truncated or damaged"]);
}

// ------------------------------------------------------------------------------------------- raw, unknown, open, write

#[test]
fn raw_returns_every_type_and_byte_order() {
    let folder = Folder::new();
    for values in all_types() {
        for (endian, name) in ENDIANS {
            let path = folder.put("a.raw", &bytes_of(&values, endian));
            let volume = cao_formats::read_raw(&path, DIMS, values.kind(), endian, [1.0, 2.0, 3.0]).unwrap();
            assert_eq!(volume.values, values, "{name}");
            assert_eq!((volume.dims, volume.spacing), (DIMS, [1.0, 2.0, 3.0]));
        }
    }
}

#[test]
fn raw_names_what_does_not_fit() {
    let folder = Folder::new();
    for (length, found) in [(59, "59 bytes"), (61, "61 bytes")] {
        let path = folder.put("a.raw", &vec![0; length]);
        let result = cao_formats::read_raw(&path, DIMS, "i16", Endian::Little, [1.0; 3]);
        assert_refused(result, &path, "data", &[found, "exactly 60 bytes"]);
    }
    let path = folder.put("a.raw", &[0; 60]);
    let cases: [([usize; 3], &str, f64, &str); 4] = [
        ([5, 0, 2], "i16", 1.0, "dims: 5 × 0 × 2"),
        ([usize::MAX; 3], "i16", 1.0, "dims"),
        (DIMS, "i17", 1.0, "type: \"i17\" is unknown, expected uint8"),
        (DIMS, "i16", -1.0, "spacing: -1 mm"),
    ];
    for (dims, kind, spacing, says) in cases {
        let error = cao_formats::read_raw(&path, dims, kind, Endian::Little, [spacing; 3]).unwrap_err();
        assert!(matches!(error, Error::Model(cao_model::Error::Config { .. })), "{error:?}");
        assert!(error.to_string().starts_with(says), "{error}");
    }
    let gone = folder.0.path().join("gone.raw");
    let result = cao_formats::read_raw(&gone, DIMS, "u8", Endian::Little, [1.0; 3]);
    assert_refused(result, &gone, "data", &["No such file"]);
}

#[test]
fn unknown_content_is_refused_with_the_formats_that_are_known() {
    let folder = Folder::new();
    let path = folder.put("a.xyz", b"\x89XYZ\r\n\x1a\n");
    let known = ["NRRD", "NIfTI", "ANALYZE", "MetaImage", "TIFF", "DICOM", "raw"];
    assert_refused(cao_formats::read(&path), &path, "format", &known);
    let path = folder.put("empty", b"");
    assert_refused(cao_formats::read(&path), &path, "format", &["NRRD"]);
    let path = folder.put("a.gz", &gzip(b"something else"));
    assert_refused(cao_formats::read(&path), &path, "format", &["NRRD"]);
}

#[test]
fn a_file_that_cannot_be_opened_is_named() {
    let folder = Folder::new();
    let path = folder.0.path().join("gone.nrrd");
    let error = cao_formats::open(path.to_str().unwrap()).unwrap_err();
    assert!(matches!(&error, Error::Io { path: found, .. } if *found == path), "{error:?}");
}

#[test]
fn open_takes_a_file_and_refuses_a_malformed_built_in() {
    let folder = Folder::new();
    let path = nrrd(&folder, &[]);
    assert_eq!(cao_formats::open(path.to_str().unwrap()).unwrap().values, nrrd_values());
    for spec in [
        "builtin:",
        "builtin:engine",
        "builtin:engine:",
        "builtin:engine:0",
        "builtin:engine:-3",
        "builtin:engine:x",
    ] {
        let error = cao_formats::open(spec).unwrap_err();
        assert!(
            matches!(&error, Error::Model(cao_model::Error::Config { what, .. }) if what == spec),
            "{error:?}"
        );
        assert!(error.to_string().contains("builtin:NAME:SIZE"), "{error}");
    }
}

#[test]
fn a_written_volume_reads_back_with_its_grid() {
    let folder = Folder::new();
    let data: Vec<f32> = (0..COUNT).map(|i| 0.1 * i as f32).collect();
    let mut like = Volume::new(DIMS, [0.957031, 0.1, 3.0], nrrd_values()).unwrap();
    let path = folder.0.path().join("out.nrrd");
    let check = |like: &Volume| {
        cao_formats::write_nrrd(&path, like, &data, "ambient\noccupancy: x").unwrap();
        let back = stored(&path);
        assert_eq!(back.values, Values::F32(data.clone()));
        assert_eq!((back.dims, back.space), (like.dims, like.space));
        assert_close(back.spacing, like.spacing);
        assert_close(back.origin, like.origin);
        (0..3).for_each(|a| assert_close(back.directions[a], like.directions[a]));
        String::from_utf8_lossy(&fs::read(&path).unwrap()).into_owned()
    };
    let text = check(&like);
    assert!(text.contains("\ncontent: ambient occupancy: x\n"));
    assert!(
        text.contains("\nspacings: 0.957031 0.1 3\n") && !text.contains("space"),
        "no place, none written"
    );
    like.origin = [1.5, -2.0, 1e-3];
    like.directions = [[0.0, -1.0, 0.0], [0.6, 0.0, 0.8], [-0.8, 0.0, 0.6]];
    assert!(check(&like).contains("\nspace dimension: 3\n"));
    like.space = Space::Ras;
    assert!(check(&like).contains("\nspace: right-anterior-superior\n"));
    assert_eq!(folder.names(), ["out.nrrd"]);
}

#[test]
fn a_failed_write_leaves_the_old_file_and_nothing_else() {
    let folder = Folder::new();
    let like = Volume::new(DIMS, [1.0; 3], nrrd_values()).unwrap();
    let path = folder.put("out.nrrd", b"old");
    let error = cao_formats::write_nrrd(&path, &like, &[0.0; 29], "").unwrap_err();
    assert!(error.to_string().contains("29 values, expected 30"), "{error}");
    let error = cao_formats::write_atomic(&path, |out| {
        out.write_all(&[0; 100_000])?;
        Err(std::io::Error::other("disk full"))
    });
    let error = error.unwrap_err();
    assert!(matches!(&error, Error::Io { path: found, .. } if *found == path), "{error:?}");
    let panicked = std::panic::catch_unwind(|| cao_formats::write_atomic(&path, |_| panic!("in the middle")));
    assert!(panicked.is_err());
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(folder.names(), ["out.nrrd"]);

    let nowhere = folder.0.path().join("nowhere").join("out.nrrd");
    assert!(
        matches!(cao_formats::write_nrrd(&nowhere, &like, &[0.0; 30], ""), Err(Error::Io { path, .. }) if path == nowhere)
    );
    let error = cao_formats::write_nrrd(folder.0.path(), &like, &[0.0; 30], "").unwrap_err();
    let cause = std::error::Error::source(&error).unwrap().to_string();
    assert!(cause.contains("not a regular file"), "{error}: {cause}");
    assert_eq!(folder.names(), ["out.nrrd"]);
}

// ----------------------------------------------------------------------------------------------------------- noise

const SPECIMENS: usize = 16;

/// Whole files of every format and encoding, small.
fn specimens() -> Vec<(&'static str, Vec<u8>)> {
    let values = nrrd_values();
    let little = bytes_of(&values, Endian::Little);
    let space = [
        ("spacings", None),
        ("space", Some("LPS")),
        ("space directions", Some("(1,0,0) (0,2,0) (0,0,3)")),
        ("space origin", Some("(1,2,3)")),
        ("space units", Some("\"mm\" \"mm\" \"mm\"")),
    ];
    let in_series = |kinds, sizes| {
        [
            ("dimension", Some("4")),
            ("sizes", Some(sizes)),
            ("spacings", Some("1 1 1 1")),
            ("kinds", Some(kinds)),
        ]
    };
    let mut in_time = Nifti::new(1, &values, Endian::Little);
    in_time.dim(&[4, 5, 3, 1, 2]);
    let mut placed = Nifti::new(1, &values, Endian::Little);
    placed.codes(1, 0);
    vec![
        ("a.nrrd", joined(&(nrrd_header(&[]) + "\n"), &little)),
        ("a.nrrd", joined(&(nrrd_header(&space) + "\n"), &little)),
        ("a.nrrd", joined(&(nrrd_header(&[("encoding", Some("gzip"))]) + "\n"), &gzip(&little))),
        ("a.nrrd", joined(&(nrrd_header(&[("encoding", Some("ascii"))]) + "\n"), &text_of(&values))),
        ("a.nhdr", (nrrd_header(&[]) + "data file: x%03d.raw 1 2 1 2\n").into_bytes()),
        ("a.nhdr", (nrrd_header(&[]) + "data file: LIST 2\nx001.raw\nx002.raw\n").into_bytes()),
        ("a.nii", placed.file()),
        ("a.nii", Nifti::new(2, &values, Endian::Big).file()),
        ("a.nii.gz", gzip(&Nifti::new(1, &values, Endian::Big).file())),
        ("a.mha", joined(&meta_header(&[("Offset", "1 2 3"), ("HeaderSize", "0")]), &little)),
        ("a.mha", joined(&meta_header(&[("CompressedData", "True")]), &zlib(&little))),
        ("a.mhd", meta_header(&[("ElementDataFile", "x%03d.raw 1 2 1")]).into_bytes()),
        (
            "a.nrrd",
            joined(&(nrrd_header(&in_series("list domain domain domain", "2 5 3 1")) + "\n"), &little),
        ),
        (
            "a.nrrd",
            joined(&(nrrd_header(&in_series("domain domain domain time", "5 3 1 2")) + "\n"), &gzip(&little)),
        ),
        (
            "a.mha",
            joined(
                &meta_header(&[("NDims", "4"), ("DimSize", "5 1 3 2"), ("ElementSpacing", "1 1 1 1")]),
                &little,
            ),
        ),
        ("a.nii.gz", gzip(&in_time.file())),
    ]
}

/// Reads a damaged file; a volume that comes out all the same must be whole.
fn read_damaged(name: &str, bytes: &[u8]) -> Result<(), TestCaseError> {
    let folder = Folder::new();
    folder.put("x001.raw", &[1; 30]);
    folder.put("x002.raw", &[2; 30]);
    let path = folder.put(name, bytes);
    let read = cao_formats::read(&path);
    // A series: the last of its two, and holes in it.
    let chosen = Reading { frame_index: Some(1), no_numbers: NoNumbers::Value(0.5) };
    let read = read.or_else(|_| Ok(cao_formats::read_as(&path, &chosen)?.volume));
    match read {
        Ok(volume) => {
            prop_assert_eq!(volume.len(), volume.dims.iter().product::<usize>());
            prop_assert!(volume.spacing.iter().all(|s| *s > 0.0 && s.is_finite()));
            prop_assert!((0..volume.len()).all(|i| volume.values.get(i).is_finite()));
        }
        Err(error) => {
            prop_assert!(matches!(error, Error::File { .. } | Error::Io { .. }), "{:?}", error);
            let text = error.to_string();
            prop_assert!(text.len() < 3000 && !text.contains(char::is_control), "{:?}", text);
            prop_assert!(text.contains(name) || text.contains("x00"), "no file is named: {:?}", text);
        }
    }
    Ok(())
}

#[test]
fn specimens_are_sound_before_they_are_damaged() {
    assert_eq!(specimens().len(), SPECIMENS);
    for (name, bytes) in specimens() {
        let folder = Folder::new();
        folder.put("x001.raw", &[1; 30]);
        folder.put("x002.raw", &[2; 30]);
        let path = folder.put(name, &bytes);
        let chosen = Reading { frame_index: Some(1), ..Reading::default() };
        let found = cao_formats::read(&path).or_else(|_| Ok(cao_formats::read_as(&path, &chosen)?.volume));
        let found = found.unwrap_or_else(|e: Error| panic!("{e}"));
        assert!([COUNT, COUNT / 2].contains(&found.len()), "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn truncated_files_never_panic(which in 0..SPECIMENS, keep in any::<prop::sample::Index>()) {
        let (name, bytes) = specimens().swap_remove(which);
        read_damaged(name, &bytes[..keep.index(bytes.len())])?;
    }

    #[test]
    fn changed_bytes_never_panic(
        which in 0..SPECIMENS,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
    ) {
        let (name, mut bytes) = specimens().swap_remove(which);
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        read_damaged(name, &bytes)?;
    }

    #[test]
    fn numbers_swapped_for_absurd_ones_never_panic(which in 0..SPECIMENS, word in any::<prop::sample::Index>(), absurd in 0..8usize) {
        const ABSURD: [&str; 8] =
            ["0", "-1", "18446744073709551615", "-9223372036854775808", "1e308", "nan", "-inf", "99999999999999999999999"];
        let (name, bytes) = specimens().swap_remove(which);
        // Only the header has words; what follows is kept as it is.
        let starts: Vec<usize> = (1..bytes.len().min(300)).filter(|&i| bytes[i].is_ascii_digit() && !bytes[i - 1].is_ascii_digit()).collect();
        prop_assume!(!starts.is_empty());
        let start = starts[word.index(starts.len())];
        let end = start + bytes[start..].iter().take_while(|b| b.is_ascii_digit()).count();
        let bytes = [&bytes[..start], ABSURD[absurd].as_bytes(), &bytes[end..]].concat();
        read_damaged(name, &bytes)?;
    }

    #[test]
    fn inserted_and_removed_pieces_never_panic(
        which in 0..SPECIMENS,
        at in any::<prop::sample::Index>(),
        remove in 0..40usize,
        insert in prop::collection::vec(any::<u8>(), 0..40),
    ) {
        let (name, mut bytes) = specimens().swap_remove(which);
        let at = at.index(bytes.len());
        let end = (at + remove).min(bytes.len());
        bytes.splice(at..end, insert);
        read_damaged(name, &bytes)?;
    }

    #[test]
    fn noise_never_panics(which in 0..SPECIMENS, head in 0..400usize, noise in prop::collection::vec(any::<u8>(), 0..600)) {
        let (name, bytes) = specimens().swap_remove(which);
        let bytes = [&bytes[..head.min(bytes.len())], noise.as_slice()].concat();
        read_damaged(name, &bytes)?;
    }
}

// ------------------------------------------------------------------------------------------------------- real files

/// Files in `$CAO_DATA/volumes` are named `NAME_XxYxZ_TYPE.EXT`.
#[test]
fn real_files_have_the_size_and_type_in_their_names() {
    let Some(data) = std::env::var_os("CAO_DATA").filter(|data| !data.is_empty()) else {
        eprintln!("skipped: set CAO_DATA=FOLDER, with FOLDER/volumes/NAME_XxYxZ_TYPE.nrrd in it");
        return;
    };
    let folder = Path::new(&data).join("volumes");
    let mut read = 0;
    for entry in fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        if !path.extension().is_some_and(|e| ["nrrd", "nhdr", "mha", "mhd", "nii"].iter().any(|k| e == *k)) {
            continue;
        }
        let stem = path.file_stem().unwrap().to_str().unwrap();
        let mut parts = stem.rsplit('_');
        let kind = parts.next().unwrap();
        let dims: Vec<usize> = parts.next().unwrap().split('x').map(|d| d.parse().unwrap()).collect();
        let start = std::time::Instant::now();
        let volume = cao_formats::read(&path).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        assert_eq!(volume.dims.as_slice(), dims, "{}", path.display());
        assert_eq!(volume.values.kind(), kind, "{}", path.display());
        let (low, high) = volume.range();
        assert!(low < high, "{}: all values are {low}", path.display());
        eprintln!("{stem}: {:?} mm, {low} … {high}, {seconds:.2} s", volume.spacing);
        read += 1;
    }
    assert!(read > 0, "{} holds no volumes", folder.display());
}
