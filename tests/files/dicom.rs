//! DICOM: whatever the transfer syntax, the same values; slices in the order of their places; what makes no volume is
//! refused by name; hostile lengths cost nothing. Files are made here, byte by byte, from PS3.5 and PS3.10; compressed
//! frames are what other programs' encoders (CharLS, libjpeg, OpenJPEG) made of the same values.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::places::along;
use cao_formats::Error;
use cao_model::volume::{Space, Volume};
use proptest::prelude::*;
use tempfile::TempDir;

type Tag = (u16, u16);

const ROWS: u16 = 5;
const COLUMNS: u16 = 6;
/// 12 bits of each of 5 × 6 pixels.
const STORED: [u16; 30] = [
    4095, 37, 74, 111, 148, 185, 101, 151, 201, 251, 301, 351, 404, 467, 530, 593, 656, 719, 909, 985, 1061,
    1137, 1213, 1289, 1616, 1705, 1794, 1883, 1972, 0,
];
const JPEG_LS: &str = "ffd8ffe800205350494646000200000100000005000000060a1006010000012c0000012cffe8000800000001ffd8fff7000b100005000601011100fff8000d01ffff0012004301140040ffda000801010000000000ff501ed224c4988f2280e69392324629823265c8fd1f27a9e23f7f2c863b198a92cb0d2ca5855d560eceffd9";
const JPEG_LOSSLESS: &str = "ffd8ffc4001a0001010003010100000000000000000000090607080c0a0bffc3000b0c0005000601001100ffda0008010000060000fbff00f012d2d2d2d2f032f41fe46c9b94f2d25fb4bb57b65b71b7efca148822e8ea49eb0d6f5d57c60be2f6ffd9";
const JPEG_2000: &str = "ff4fff5100290000000000060000000500000000000000000000000600000005000000000000000000010b0101ff52000c00000001000004040001ff5c00044060ff640025000143726561746564206279204f70656e4a5045472076657273696f6e20322e352e34ff90000a0000000000400001ff93dfe0bc4ca961ae67f2c924cec5b8422975d21c244744de27171b8d162b2f8fb6af2cb2c94e0cbeac8a0364ad7ad89ed083dfffd9";
/// 8 × 8 pixels of 77.
const JPEG: &str = "ffd8ffe000104a46494600010100000100010000ffdb00430001010101010101010101010101010101010101010101010101010101010101010101010101010101010101010101010101010101010101010101010101010101ffc0000b080008000801011100ffc4001f0000010501010101010100000000000000000102030405060708090a0bffc400b5100002010303020403050504040000017d01020300041105122131410613516107227114328191a1082342b1c11552d1f02433627282090a161718191a25262728292a3435363738393a434445464748494a535455565758595a636465666768696a737475767778797a838485868788898a92939495969798999aa2a3a4a5a6a7a8a9aab2b3b4b5b6b7b8b9bac2c3c4c5c6c7c8c9cad2d3d4d5d6d7d8d9dae1e2e3e4e5e6e7e8e9eaf1f2f3f4f5f6f7f8f9faffda0008010100003f00fc67afffd9";

fn hex(text: &str) -> Vec<u8> {
    (0..text.len()).step_by(2).map(|i| u8::from_str_radix(&text[i..i + 2], 16).unwrap()).collect()
}

/// The value of an element.
#[derive(Clone)]
enum Value {
    Bytes(Vec<u8>),
    U16(u16),
    Items(Vec<Vec<Element>>),
    /// Encapsulated frames, a fragment each.
    Fragments(Vec<Vec<u8>>),
}

#[derive(Clone)]
struct Element(Tag, &'static [u8; 2], Value);

fn text(tag: Tag, kind: &'static [u8; 2], value: &str) -> Element {
    Element(tag, kind, Value::Bytes(value.as_bytes().to_vec()))
}

fn numbers(tag: Tag, values: &[f64]) -> Element {
    let words: Vec<String> = values.iter().map(f64::to_string).collect();
    text(tag, b"DS", &words.join("\\"))
}

fn number(tag: Tag, value: u16) -> Element {
    Element(tag, b"US", Value::U16(value))
}

#[derive(Clone, Copy, PartialEq)]
enum Coding {
    Implicit,
    Explicit,
    Big,
}

/// Elements as bytes; sequences end by delimiters.
fn written(elements: &[Element], coding: Coding) -> Vec<u8> {
    let u16 = |v: u16| if coding == Coding::Big { v.to_be_bytes() } else { v.to_le_bytes() };
    let u32 = |v: u32| if coding == Coding::Big { v.to_be_bytes() } else { v.to_le_bytes() };
    let head = |tag: Tag, length: u32| [&u16(tag.0)[..], &u16(tag.1), &u32(length)].concat();
    let mut out = Vec::new();
    for Element(tag, kind, value) in elements {
        let mut bytes = match value {
            Value::Bytes(bytes) => bytes.clone(),
            Value::U16(v) => u16(*v).to_vec(),
            Value::Items(items) => {
                let item = |item: &Vec<Element>| {
                    [head((0xfffe, 0xe000), u32::MAX), written(item, coding), head((0xfffe, 0xe00d), 0)]
                        .concat()
                };
                [items.iter().flat_map(item).collect(), head((0xfffe, 0xe0dd), 0)].concat()
            }
            Value::Fragments(frames) => {
                let fragment = |bytes: &Vec<u8>| {
                    let padded = [&bytes[..], &[0][..bytes.len() % 2]].concat();
                    [head((0xfffe, 0xe000), padded.len() as u32), padded].concat()
                };
                let table = head((0xfffe, 0xe000), 0);
                [table, frames.iter().flat_map(fragment).collect(), head((0xfffe, 0xe0dd), 0)].concat()
            }
        };
        let open = matches!(value, Value::Items(_) | Value::Fragments(_));
        if !open && bytes.len() % 2 == 1 {
            bytes.push(b' ');
        }
        let length = if open { u32::MAX } else { bytes.len() as u32 };
        out.extend([u16(tag.0), u16(tag.1)].concat());
        if coding == Coding::Implicit {
            out.extend(u32(length));
        } else if [b"OB", b"OW", b"SQ", b"UN"].contains(kind) {
            out.extend([&kind[..], &[0, 0], &u32(length)].concat());
        } else {
            out.extend([&kind[..], &u16(length as u16)].concat());
        }
        out.extend(bytes);
    }
    out
}

/// One file, to be changed before it is written.
#[derive(Clone)]
struct File {
    syntax: &'static str,
    coding: Coding,
    preamble: bool,
    meta: bool,
    elements: Vec<Element>,
}

const POSITION: Tag = (0x0020, 0x0032);
const ORIENTATION: Tag = (0x0020, 0x0037);
const PIXEL_SPACING: Tag = (0x0028, 0x0030);
const SERIES: Tag = (0x0020, 0x000e);
const PIXELS: Tag = (0x7fe0, 0x0010);
const FRAMES: Tag = (0x0028, 0x0008);
const EXPLICIT: &str = "1.2.840.10008.1.2.1";

impl File {
    /// A slice at z mm of a series "1.2", with `STORED + z` and the values' meaning `2 · stored − 1000`.
    fn slice(z: u16) -> Self {
        let pixels = STORED.iter().flat_map(|v| ((v + z) & 4095).to_le_bytes()).collect();
        let elements = vec![
            text((0x0008, 0x0018), b"UI", &format!("1.2.3.{z}")),
            text((0x0008, 0x0060), b"CS", "CT"),
            text((0x0008, 0x103e), b"LO", "Thorax"),
            numbers((0x0018, 0x0050), &[9.0]),
            text(SERIES, b"UI", "1.2"),
            numbers(POSITION, &[10.0, 20.0, f64::from(z)]),
            numbers(ORIENTATION, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
            number((0x0028, 0x0002), 1),
            text((0x0028, 0x0004), b"CS", "MONOCHROME2"),
            number((0x0028, 0x0010), ROWS),
            number((0x0028, 0x0011), COLUMNS),
            numbers(PIXEL_SPACING, &[0.75, 0.5]),
            number((0x0028, 0x0100), 16),
            number((0x0028, 0x0101), 12),
            number((0x0028, 0x0102), 11),
            number((0x0028, 0x0103), 0),
            numbers((0x0028, 0x1052), &[-1000.0]),
            numbers((0x0028, 0x1053), &[2.0]),
            Element(PIXELS, b"OW", Value::Bytes(pixels)),
        ];
        Self { syntax: EXPLICIT, coding: Coding::Explicit, preamble: true, meta: true, elements }
    }

    /// With an element replaced or added.
    fn with(mut self, element: Element) -> Self {
        self.elements.retain(|e| e.0 != element.0);
        let at = self.elements.partition_point(|e| e.0 < element.0);
        self.elements.insert(at, element);
        self
    }

    fn without(mut self, tag: Tag) -> Self {
        self.elements.retain(|e| e.0 != tag);
        self
    }

    fn at(self, position: [f64; 3]) -> Self {
        self.with(numbers(POSITION, &position))
    }

    /// With pixels of a compressed transfer syntax.
    fn compressed(mut self, syntax: &'static str, frames: Vec<Vec<u8>>) -> Self {
        self.syntax = syntax;
        self.with(Element(PIXELS, b"OB", Value::Fragments(frames)))
    }

    fn bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        if self.preamble {
            out.extend([&[0; 128][..], b"DICM"].concat());
        }
        if self.meta {
            let syntax = written(&[text((2, 0x0010), b"UI", self.syntax)], Coding::Explicit);
            out.extend(&[2, 0, 0, 0, b'U', b'L', 4, 0]);
            out.extend((syntax.len() as u32).to_le_bytes());
            out.extend(syntax);
        }
        let mut data = written(&self.elements, self.coding);
        if self.syntax == "1.2.840.10008.1.2.1.99" {
            let mut deflated = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::default());
            deflated.write_all(&data).unwrap();
            data = deflated.finish().unwrap();
        }
        out.extend(data);
        out
    }
}

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn put(&self, name: &str, file: &File) -> PathBuf {
        let path = self.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, file.bytes()).unwrap();
        path
    }

    /// A folder of these files, named against their order.
    fn of(files: &[File]) -> Self {
        let folder = Self::new();
        for (i, file) in files.iter().enumerate() {
            folder.put(&format!("im{:03}", 999 - i), file);
        }
        folder
    }

    fn read(&self) -> cao_formats::Result<Volume> {
        cao_formats::read(self.path())
    }
}

#[track_caller]
fn refused(found: cao_formats::Result<Volume>, field: &str, says: &[&str]) {
    let error = found.expect_err(&format!("should be refused for {field}"));
    let text = error.to_string();
    assert!(
        matches!(&error, Error::File { field: found, .. } | Error::Choice { field: found, .. } if found == field),
        "{field}: {text}"
    );
    for part in says {
        assert!(text.contains(part), "{text:?} should say {part:?}");
    }
}

/// The stored values of slices at these z.
fn slices_at(places: &[u16]) -> Vec<f64> {
    places.iter().flat_map(|z| plus(*z)).map(f64::from).collect()
}

fn plus(z: u16) -> Vec<u16> {
    STORED.iter().map(|v| (v + z) & 4095).collect()
}

/// To the left, to the back, up: the axes of [`File::slice`].
const AXIAL: [[f64; 3]; 3] = [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];

/// Stored values in the order of these axes, and where the first voxel is.
#[track_caller]
fn seen(volume: &Volume, axes: [[f64; 3]; 3]) -> (Vec<f64>, [f64; 3]) {
    assert_eq!(volume.space, Space::Ras);
    let seen = along(volume, axes).unwrap();
    (seen.order.iter().map(|i| volume.values.get(*i)).collect(), seen.origin)
}

/// Stored values and their type, in the order of axial slices.
#[track_caller]
fn stored(volume: &Volume) -> (&'static str, Vec<f64>) {
    (volume.values.kind(), seen(volume, AXIAL).0)
}

// ------------------------------------------------------------------------------------------------------------ values

#[test]
fn a_folder_is_sorted_by_place_and_lies_where_it_says() {
    let volume = Folder::of(&[0, 6, 3].map(File::slice)).read().unwrap();
    assert_eq!(stored(&volume), ("uint16", slices_at(&[0, 3, 6])));
    assert_eq!((volume.slope, volume.intercept), (2.0, -1000.0));
    // Left and posterior in the file.
    let found = along(&volume, AXIAL).unwrap();
    assert_eq!((found.dims, found.spacing, found.origin), ([6, 5, 3], [0.5, 0.75, 3.0], [-10.0, -20.0, 0.0]));
    // Coronal: rows to the left, columns to the feet; the normal is then to the front.
    let coronal = numbers(ORIENTATION, &[1.0, 0.0, 0.0, 0.0, 0.0, -1.0]);
    let slice = |y: f64| File::slice(y as u16).with(coronal.clone()).at([0.0, y, 7.0]);
    let volume = Folder::of(&[slice(2.0), slice(0.0)]).read().unwrap();
    let axes = [[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]];
    assert_eq!(seen(&volume, axes), (slices_at(&[0, 2]), [0.0, 0.0, 7.0]));
    assert_eq!(along(&volume, axes).unwrap().spacing, [0.5, 0.75, 2.0]);
}

#[test]
fn every_coding_and_codec_gives_the_same_values() {
    let native = |coding, syntax| {
        let words = |file: File, z: u16| match coding {
            Coding::Big => {
                let bytes = plus(z).iter().flat_map(|v| v.to_be_bytes()).collect();
                file.with(Element(PIXELS, b"OW", Value::Bytes(bytes)))
            }
            _ => file,
        };
        [0, 3].map(|z| File { coding, syntax, ..words(File::slice(z), z) })
    };
    let mut cases = vec![
        ("implicit", native(Coding::Implicit, "1.2.840.10008.1.2")),
        ("big", native(Coding::Big, "1.2.840.10008.1.2.2")),
        ("deflated", native(Coding::Explicit, "1.2.840.10008.1.2.1.99")),
        ("implicit, said to be explicit", native(Coding::Implicit, EXPLICIT)),
    ];
    for coding in [Coding::Implicit, Coding::Explicit, Coding::Big] {
        cases.push(("bare", native(coding, "").map(|f| File { preamble: false, meta: false, ..f })));
        cases.push(("no meta", native(coding, "").map(|f| File { meta: false, ..f })));
    }
    cases.push(("no preamble", native(Coding::Explicit, EXPLICIT).map(|f| File { preamble: false, ..f })));
    for (name, files) in cases {
        let volume = Folder::of(&files).read().unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(stored(&volume), ("uint16", slices_at(&[0, 3])), "{name}");
    }

    // Run lengths: a segment of high bytes and one of low bytes, in literal runs.
    let high: Vec<u8> = STORED.iter().map(|v| (v >> 8) as u8).collect();
    let low: Vec<u8> = STORED.iter().map(|v| *v as u8).collect();
    let mut runs: Vec<u8> = [2u32, 64, 64 + 34].iter().flat_map(|v| v.to_le_bytes()).collect();
    runs.resize(64, 0);
    // The first 26 high bytes as they are, with no-operation, then a run of what follows.
    runs.extend([&[25][..], &high[..26], &[128, 3][..], &high[26..]].concat());
    runs.resize(64 + 34, 128);
    runs.extend([&[29][..], &low].concat());
    let codecs = [
        ("1.2.840.10008.1.2.5", runs),
        ("1.2.840.10008.1.2.4.57", hex(JPEG_LOSSLESS)),
        ("1.2.840.10008.1.2.4.70", hex(JPEG_LOSSLESS)),
        ("1.2.840.10008.1.2.4.80", hex(JPEG_LS)),
        ("1.2.840.10008.1.2.4.81", hex(JPEG_LS)),
        ("1.2.840.10008.1.2.4.90", hex(JPEG_2000)),
        ("1.2.840.10008.1.2.4.91", hex(JPEG_2000)),
    ];
    let folder = Folder::new();
    for (syntax, frame) in codecs {
        let path = folder.put("a", &File::slice(0).compressed(syntax, vec![frame.clone()]));
        assert_eq!(stored(&cao_formats::read(&path).unwrap()), ("uint16", slices_at(&[0])), "{syntax}");
        // In two fragments.
        let (a, b) = frame.split_at(64);
        folder.put("a", &File::slice(0).compressed(syntax, vec![a.to_vec(), b.to_vec()]));
        assert_eq!(stored(&cao_formats::read(&path).unwrap()), ("uint16", slices_at(&[0])), "{syntax}");
    }
    // Encapsulated as it is, with padding.
    let raw = STORED.iter().flat_map(|v| v.to_le_bytes()).chain([0, 0]).collect();
    let path = folder.put("a", &File::slice(0).compressed("1.2.840.10008.1.2.1.98", vec![raw]));
    assert_eq!(stored(&cao_formats::read(&path).unwrap()), ("uint16", slices_at(&[0])));
    let grey = File::slice(0).compressed("1.2.840.10008.1.2.4.50", vec![hex(JPEG)]);
    let grey = [(0x0010, 8), (0x0011, 8), (0x0100, 8), (0x0101, 8), (0x0102, 7)]
        .into_iter()
        .fold(grey, |file, (element, value)| file.with(number((0x0028, element), value)));
    assert_eq!(stored(&cao_formats::read(&folder.put("a", &grey)).unwrap()), ("uint8", vec![77.0; 64]));
}

#[test]
fn only_the_bits_that_are_stored_count_and_the_highest_may_be_a_sign() {
    let signed = number((0x0028, 0x0103), 1);
    let expected: Vec<f64> = STORED.iter().map(|v| (((v << 4) as i16) >> 4).into()).collect();
    let with_bits = |shift: u16, noise: u16| {
        let bytes = STORED.iter().flat_map(|v| (v << shift | noise).to_le_bytes()).collect();
        File::slice(0).with(signed.clone()).with(Element(PIXELS, b"OW", Value::Bytes(bytes)))
    };
    let folder = Folder::new();
    let read = |file: File| stored(&cao_formats::read(&folder.put("a", &file)).unwrap());
    assert_eq!(read(with_bits(0, 0xa000)), ("int16", expected.clone()));
    // Four bits higher.
    assert_eq!(read(with_bits(4, 0x000b).with(number((0x0028, 0x0102), 15))), ("int16", expected.clone()));
    let compressed =
        |syntax, stream| File::slice(0).with(signed.clone()).compressed(syntax, vec![hex(stream)]);
    assert_eq!(read(compressed("1.2.840.10008.1.2.4.80", JPEG_LS)), ("int16", expected.clone()));
    assert_eq!(read(compressed("1.2.840.10008.1.2.4.90", JPEG_2000)), ("int16", expected.clone()));
    // A codestream that is signed itself codes value − 2048 with the same bits (A.5.1: Ssiz).
    let mut stream = hex(JPEG_2000);
    stream[42] |= 0x80;
    let file = File::slice(0).with(signed.clone()).compressed("1.2.840.10008.1.2.4.90", vec![stream]);
    assert_eq!(read(file), ("int16", STORED.iter().map(|v| f64::from(*v) - 2048.0).collect()));
}

#[test]
fn a_slope_of_each_slice_is_applied_to_it() {
    let slope = |z: u16, slope: f64| File::slice(z).with(numbers((0x0028, 0x1053), &[slope]));
    let volume = Folder::of(&[slope(0, 0.1), slope(3, 0.3)]).read().unwrap();
    let values =
        |z: u16, slope: f64| plus(z).iter().map(|v| slope * f64::from(*v) - 1000.0).collect::<Vec<_>>();
    assert_eq!(stored(&volume), ("float64", [values(0, 0.1), values(3, 0.3)].concat()));
    assert_eq!((volume.slope, volume.intercept), (1.0, 0.0));
}

#[test]
fn which_way_a_display_shows_values_does_not_change_them() {
    let inverse = text((0x0028, 0x0004), b"CS", "MONOCHROME1");
    let volume = Folder::of(&[0, 3].map(|z| File::slice(z).with(inverse.clone()))).read().unwrap();
    assert_eq!(stored(&volume), ("uint16", slices_at(&[0, 3])));
}

// ------------------------------------------------------------------------------------------------------- many frames

/// Frames at these z, in one file.
fn enhanced(places: &[u16]) -> File {
    let sequence = |tag, items| Element(tag, b"SQ", Value::Items(items));
    let one = |tag, elements| sequence(tag, vec![elements]);
    let frame = |z: &u16| {
        let rescale = vec![numbers((0x0028, 0x1052), &[f64::from(*z)]), numbers((0x0028, 0x1053), &[1.0])];
        vec![
            one((0x0020, 0x9113), vec![numbers(POSITION, &[0.0, 0.0, f64::from(*z)])]),
            one((0x0028, 0x9145), rescale),
        ]
    };
    let shared = vec![
        one((0x0020, 0x9116), vec![numbers(ORIENTATION, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0])]),
        one((0x0028, 0x9110), vec![numbers(PIXEL_SPACING, &[0.75, 0.5])]),
    ];
    let pixels = places.iter().flat_map(|z| plus(*z)).flat_map(u16::to_le_bytes).collect();
    let mut file = File::slice(0);
    for tag in [POSITION, ORIENTATION, PIXEL_SPACING, (0x0028, 0x1052), (0x0028, 0x1053)] {
        file = file.without(tag);
    }
    file.with(text(FRAMES, b"IS", &places.len().to_string()))
        .with(sequence((0x5200, 0x9229), vec![shared]))
        .with(sequence((0x5200, 0x9230), places.iter().map(frame).collect()))
        .with(Element(PIXELS, b"OW", Value::Bytes(pixels)))
}

#[test]
fn an_enhanced_image_says_where_each_of_its_frames_lies() {
    let folder = Folder::new();
    for coding in [Coding::Implicit, Coding::Explicit] {
        let syntax = if coding == Coding::Implicit { "1.2.840.10008.1.2" } else { EXPLICIT };
        let path = folder.put("mr", &File { coding, syntax, ..enhanced(&[4, 0, 6, 2]) });
        let volume = cao_formats::read(&path).unwrap();
        let expected = [0, 2, 4, 6].map(|z| plus(z).iter().map(|v| f64::from(v + z)).collect::<Vec<_>>());
        assert_eq!(stored(&volume), ("float64", expected.concat()));
        assert_eq!(along(&volume, AXIAL).unwrap().spacing, [0.5, 0.75, 2.0]);
    }
    // Encapsulated, two fragments a frame: a table says where each begins.
    let frame = hex(JPEG_2000);
    let (a, b) = (frame[..64].to_vec(), frame[64..].to_vec());
    let file = enhanced(&[1, 0])
        .compressed("1.2.840.10008.1.2.4.90", vec![a.clone(), b.clone(), a.clone(), b.clone()]);
    refused(
        cao_formats::read(&folder.put("mr", &file)),
        "PixelData",
        &["4 fragments", "0 offsets", "2 frames"],
    );
    let second = (64 + 8 + frame.len() - 64 + 8) as u64;
    let table: Vec<u8> = [0, second].iter().flat_map(|v| v.to_le_bytes()).collect();
    let table = Element((0x7fe0, 0x0001), b"UN", Value::Bytes(table));
    let volume = cao_formats::read(&folder.put("mr", &file.with(table))).unwrap();
    let (first, values) = (f64::from(STORED[0]), stored(&volume).1);
    assert_eq!((values[0], values[30]), (first, first + 1.0));

    refused(
        cao_formats::read(&folder.put("mr", &enhanced(&[0, 2, 2]))),
        "ImagePositionPatient",
        &["frame 2 of mr", "frame 3 of mr", "time points"],
    );
    let fewer = enhanced(&[0, 2]).with(text(FRAMES, b"IS", "3"));
    refused(
        cao_formats::read(&folder.put("mr", &fewer)),
        "PerFrameFunctionalGroupsSequence",
        &["2 items, expected 3"],
    );
}

#[test]
fn frames_without_a_place_are_refused_but_those_of_a_dose_grid_have_one() {
    let pixels = [0, 1].iter().flat_map(|z| plus(*z)).flat_map(u16::to_le_bytes).collect();
    let two = File::slice(0)
        .with(text(FRAMES, b"IS", "2"))
        .with(Element(PIXELS, b"OW", Value::Bytes(pixels)))
        .without((0x0028, 0x1052))
        .without((0x0028, 0x1053));
    let folder = Folder::new();
    refused(cao_formats::read(&folder.put("us", &two)), "NumberOfFrames", &["2, but nothing says where"]);
    let dose = two.with(numbers((0x3004, 0x000c), &[0.0, -2.5])).with(numbers((0x3004, 0x000e), &[0.5]));
    let volume = cao_formats::read(&folder.put("us", &dose)).unwrap();
    assert_eq!((volume.spacing[2], volume.slope), (2.5, 0.5));
    assert_eq!(seen(&volume, AXIAL), (slices_at(&[1, 0]), [-10.0, -20.0, -2.5]));
}

// ------------------------------------------------------------------------------------------------------------ series

#[test]
fn a_series_is_chosen_and_others_beside_it_do_not_matter() {
    let folder = Folder::new();
    let other = |z: u16| {
        let file = File::slice(z).with(text(SERIES, b"UI", "1.9")).with(text((0x0020, 0x0011), b"IS", "7"));
        file.with(text((0x0008, 0x103e), b"LO", "Scout\x1b[31m"))
    };
    for z in [0, 3] {
        folder.put(&format!("a/thorax{z}"), &File::slice(z));
        folder.put(&format!("b/scout{z}"), &other(z + 100));
    }
    fs::write(folder.path().join("readme.txt"), "not an image").unwrap();
    let (thorax, scout) = (slices_at(&[0, 3]), slices_at(&[100, 103]));
    let listed = [
        "2 in this folder",
        "--series",
        "1: CT \"Thorax\", 2 images of 6 × 5, 1.2",
        "2: CT \"Scout\\u{1b}[31m\", 2 images of 6 × 5, 1.9",
    ];
    refused(folder.read(), "series", &listed);
    for (name, expected) in [("1", &thorax), ("1.2", &thorax), ("2", &scout), ("1.9", &scout)] {
        assert_eq!(stored(&cao_formats::read_series(folder.path(), name).unwrap()).1, *expected, "{name}");
    }
    for name in ["0", "3", "1.2.3", "Thorax"] {
        refused(cao_formats::read_series(folder.path(), name), "series", &[name, "none of them", "1: CT"]);
    }
    // A file is of its series, also where all lie in one folder; a pattern and the directory file name many.
    for z in [0, 3] {
        folder.put(&format!("all/thorax{z}"), &File::slice(z));
        folder.put(&format!("all/scout{z}"), &other(z + 100));
    }
    let all = folder.path().join("all");
    assert_eq!(stored(&cao_formats::read(&all.join("thorax3")).unwrap()).1, thorax);
    assert_eq!(stored(&cao_formats::read(&all.join("scout0")).unwrap()).1, scout);
    assert_eq!(stored(&cao_formats::read(&all.join("s*")).unwrap()).1, scout);
    assert_eq!(stored(&cao_formats::read_series(&all.join("scout0"), "1.2").unwrap()).1, thorax);
    let directory = File::slice(0).without(PIXELS).without((0x0028, 0x0010));
    let directory = folder.put("all/DICOMDIR", &directory);
    refused(cao_formats::read(&directory), "series", &["2 in this folder"]);
    refused(
        cao_formats::read(&folder.put("report", &File::slice(0).without(PIXELS))),
        "PixelData",
        &["without an image"],
    );
    let nrrd = folder.path().join("a.nrrd");
    fs::write(&nrrd, "NRRD0004\n").unwrap();
    refused(cao_formats::read_series(&nrrd, "1"), "series", &["only DICOM"]);
}

#[test]
fn what_makes_no_volume_is_refused_by_name() {
    let place = "ImagePositionPatient";
    let at = |z: &[f64]| z.iter().map(|z| File::slice(*z as u16).at([0.0, 0.0, *z])).collect::<Vec<_>>();
    let second = |element: Element| vec![File::slice(0), File::slice(3).with(element)];
    let both = |element: Element| [0, 3].map(|z| File::slice(z).with(element.clone())).to_vec();
    let tilt = |z: f64| File::slice(z as u16).at([0.0, 0.3 * z, z]);
    let oblique = numbers(ORIENTATION, &[0.8, 0.6, 0.0, -0.6, 0.8, 0.0]);
    let cases: Vec<(Vec<File>, &str, &[&str])> = vec![
        (
            at(&[0.0, 1.0, 2.0, 5.0, 6.0]),
            place,
            &["a gap of 3.0000 mm between im997 and im996", "1.0000 mm apart", "about 2"],
        ),
        (at(&[0.0, 1.0, 2.0, 3.2]), place, &["uneven spacing", "1.0000 to 1.2000 mm", "resample"]),
        (at(&[0.0, 1.0, 1.0, 2.0]), place, &["1 of 4 slices", "im998", "im997", "the same image twice"]),
        (
            vec![File::slice(0), File::slice(1).at([10.0, 20.0, 0.0]), File::slice(3)],
            place,
            &["1 of 3", "time points, echoes"],
        ),
        ([0.0, 1.0, 2.0].map(tilt).to_vec(), place, &["gantry tilt of 16.7°"]),
        (
            vec![File::slice(0), File::slice(3).at([12.0, 20.0, 3.0]), File::slice(6)],
            place,
            &["beside each other", "im998"],
        ),
        (second(oblique), "ImageOrientationPatient", &["mixed", "im998", "im999", "localizer"]),
        (second(numbers(PIXEL_SPACING, &[0.75, 0.6])), "PixelSpacing", &["mixed", "im998"]),
        (both(numbers(PIXEL_SPACING, &[0.0, 0.6])), "PixelSpacing", &["above 0"]),
        (
            both(numbers(ORIENTATION, &[2.0, 0.0, 0.0, 0.0, 1.0, 0.0])),
            "ImageOrientationPatient",
            &["length 1"],
        ),
        (
            both(numbers(ORIENTATION, &[1.0, 0.0, 0.0, 1.0, 0.0, 0.0])),
            "ImageOrientationPatient",
            &["right angles"],
        ),
        (
            [0.0, 1e12].map(|z| File::slice(0).at([0.0, 0.0, z])).to_vec(),
            "PixelSpacing or ImagePositionPatient",
            &["mm"],
        ),
        (both(text(PIXEL_SPACING, b"DS", "a\\b")), "PixelSpacing", &["2 finite numbers"]),
        (
            second(number((0x0028, 0x0010), 6)),
            "size",
            &["mixed: 6 × 6 uint16 in im998, 6 × 5 uint16 in im999"],
        ),
        (second(number((0x0028, 0x0103), 1)), "size", &["mixed: 6 × 5 int16 in im998"]),
        (vec![File::slice(0).without(POSITION)], place, &["missing, expected 3"]),
        (vec![File::slice(0).without((0x0018, 0x0050))], "SliceThickness", &["missing", "only one slice"]),
        (
            vec![File::slice(0).with(numbers((0x0028, 0x1053), &[0.0]))],
            "RescaleSlope",
            &["0, expected another"],
        ),
        (
            vec![File::slice(0).with(number((0x0028, 0x0002), 3)).with(text((0x0028, 0x0004), b"CS", "RGB"))],
            "PhotometricInterpretation",
            &["RGB, colour"],
        ),
        (
            vec![File::slice(0).with(text((0x0028, 0x0004), b"CS", "PALETTE COLOR"))],
            "PhotometricInterpretation",
            &["PALETTE COLOR"],
        ),
        (
            vec![File::slice(0).with(Element((0x0028, 0x3000), b"SQ", Value::Items(vec![vec![]])))],
            "ModalityLUTSequence",
            &["a table"],
        ),
        (
            vec![File::slice(0).with(number((0x0028, 0x0100), 1))],
            "BitsAllocated",
            &["1, expected 8, 16 or 32"],
        ),
        (vec![File::slice(0).with(number((0x0028, 0x0101), 17))], "BitsStored", &["17, expected 1 to 16"]),
        (vec![File::slice(0).with(number((0x0028, 0x0102), 10))], "HighBit", &["10, expected 11 to 15"]),
        (
            vec![File::slice(0).with(number((0x0028, 0x0103), 2))],
            "PixelRepresentation",
            &["2, expected 0 or 1"],
        ),
        (vec![File::slice(0).with(number((0x0028, 0x0010), 0))], "Rows", &["0, expected 1 or more"]),
        (
            vec![File::slice(0).with(number((0x0028, 0x0010), 6))],
            "PixelData",
            &["60 bytes, expected 72 or more (1 frames of 6 × 6 values of type uint16)"],
        ),
    ];
    for (files, field, says) in cases {
        refused(Folder::of(&files).read(), field, says);
    }
    let wrong = File::slice(0).compressed("1.2.840.10008.1.2.4.90", vec![hex(JPEG_LS)]);
    refused(Folder::of(&[wrong]).read(), "PixelData", &["frame 1, transfer syntax 1.2.840.10008.1.2.4.90"]);
    for (syntax, name) in [
        ("1.2.840.10008.1.2.4.201", "High-Throughput JPEG 2000"),
        ("1.2.840.10008.1.2.4.110", "JPEG XL"),
        ("1.2.840.10008.1.2.4.102", "MPEG"),
        ("1.2.3", "unknown"),
    ] {
        let file = File::slice(0).compressed(syntax, vec![vec![1, 2]]);
        refused(Folder::of(&[file]).read(), "TransferSyntaxUID", &[syntax, name, "gdcmconv"]);
    }
    // A damaged file of the series may be a slice of it.
    let folder = Folder::of(&[0, 3].map(File::slice));
    let cut = File::slice(6).bytes();
    fs::write(folder.path().join("cut"), &cut[..cut.len() - 150]).unwrap();
    refused(folder.read(), "header", &["cut: header", "of the data set, which has"]);
    let other = File::slice(6).with(text(SERIES, b"UI", "1.9")).bytes();
    fs::write(folder.path().join("cut"), &other[..other.len() - 150]).unwrap();
    assert_eq!(stored(&cao_formats::read(&folder.path().join("im999")).unwrap()).1, slices_at(&[0, 3]));
}

// ----------------------------------------------------------------------------------------------------------- hostile

/// The largest amount of memory that this process has held, in kB.
fn peak() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

#[test]
fn lengths_and_sizes_that_are_not_there_cost_nothing() {
    let folder = Folder::new();
    let before = peak();
    let head = [&[0; 128][..], b"DICM"].concat();
    let claim = |tag: [u8; 4], kind: &[u8]| [&tag[..], kind, &[0, 0], &0xffff_fff0u32.to_le_bytes()].concat();
    let refused = |name: &str, bytes: &[u8], says: &str| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let text = cao_formats::read(&path).expect_err(name).to_string();
        assert!(text.contains(says), "{name}: {text}");
        fs::remove_file(path).unwrap();
    };
    refused("meta", &[&head[..], &claim([2, 0, 1, 0], b"OB")].concat(), "4294967280 bytes");
    refused("text", &[&head[..], &claim([8, 0, 5, 0], b"UT")].concat(), "4294967280 bytes");
    let nested: Vec<u8> = (0..10_000)
        .flat_map(|_| {
            [8, 0, 6, 0, b'S', b'Q', 0, 0, 255, 255, 255, 255, 0xfe, 0xff, 0, 0xe0, 255, 255, 255, 255]
        })
        .collect();
    refused("nested", &[&head[..], &nested].concat(), "nested deeper");
    let large = |file: File| file.with(number((0x0028, 0x0010), 65535)).with(number((0x0028, 0x0011), 65535));
    refused("native", &large(File::slice(0)).bytes(), "8589672450 bytes of values are more than");
    // Where a codestream says its height and width.
    for (syntax, stream, size) in [
        ("1.2.840.10008.1.2.4.70", JPEG_LOSSLESS, &[0, 5, 0, 6][..]),
        ("1.2.840.10008.1.2.4.80", JPEG_LS, &[0, 5, 0, 6]),
        ("1.2.840.10008.1.2.4.90", JPEG_2000, &[0, 6, 0, 0, 0, 5]),
    ] {
        let file = large(File::slice(0)).compressed(syntax, vec![hex(stream)]);
        refused(syntax, &file.bytes(), "8589672450 bytes of values are more than");
        // The codestream says it, not the data set.
        let mut stream = hex(stream);
        let at = stream.windows(size.len()).position(|w| w == size).unwrap();
        stream[at] = 0xff;
        refused(syntax, &File::slice(0).compressed(syntax, vec![stream]).bytes(), syntax);
    }
    let many = enhanced(&[0, 2]).with(text(FRAMES, b"IS", "4000000000"));
    refused("frames", &many.bytes(), "2 items, expected 4000000000");
    let dose =
        File::slice(0).with(text(FRAMES, b"IS", "99999999999")).with(numbers((0x3004, 0x000c), &[0.0, 1.0]));
    refused("dose", &dose.bytes(), "2 numbers, expected 99999999999");
    if let (Some(before), Some(after)) = (before, peak()) {
        assert!(after - before < 300_000, "{} kB more", after - before);
    }
}

/// Files of every coding and codec, for the mutations below.
fn samples() -> Vec<Vec<u8>> {
    let compressed = |syntax, stream| File::slice(0).compressed(syntax, vec![hex(stream)]).bytes();
    vec![
        File::slice(0).bytes(),
        File { coding: Coding::Implicit, syntax: "1.2.840.10008.1.2", ..enhanced(&[0, 2]) }.bytes(),
        enhanced(&[0, 2]).bytes(),
        File { syntax: "1.2.840.10008.1.2.1.99", ..File::slice(0) }.bytes(),
        compressed("1.2.840.10008.1.2.5", JPEG_LS),
        compressed("1.2.840.10008.1.2.4.70", JPEG_LOSSLESS),
        compressed("1.2.840.10008.1.2.4.80", JPEG_LS),
        compressed("1.2.840.10008.1.2.4.90", JPEG_2000),
        compressed("1.2.840.10008.1.2.4.50", JPEG),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_mutation_makes_it_panic(
        which in 0..9usize,
        changes in proptest::collection::vec((0.0..1.0f64, any::<u8>(), 1..5usize), 1..6),
        cut in proptest::option::of(0.0..1.0f64),
    ) {
        let mut bytes = samples()[which].clone();
        for (at, value, count) in changes {
            // Pixels are at the end, and their codecs are the most intricate.
            let at = 132 + ((bytes.len() - 132) as f64 * at) as usize;
            let end = (at + count).min(bytes.len());
            bytes[at..end].fill(value);
        }
        if let Some(share) = cut {
            bytes.truncate((bytes.len() as f64 * share) as usize);
        }
        let folder = Folder::new();
        let path = folder.path().join("a");
        fs::write(&path, bytes).unwrap();
        let _ = cao_formats::read(&path);
    }
}
