//! Data sets of DICOM files: elements, sequences, where the pixels begin (PS3.5 §7, PS3.10 §7).
//!
//! Read here and not by a library because every length in a file is a claim: one element of 184 bytes of file may say
//! that 4 GB follow, and readers that take memory first take it. Here a value is a slice of bytes that are there.

use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::Path;

use crate::binary::ordered;
use crate::volume::bad;
use crate::{Error, Result, file};
use cao_model::values::Endian;

/// Group and element.
pub(super) type Tag = (u16, u16);

pub(super) const ITEM: Tag = (0xfffe, 0xe000);
const ITEM_END: Tag = (0xfffe, 0xe00d);
pub(super) const SEQUENCE_END: Tag = (0xfffe, 0xe0dd);
/// Pixels as floating point, as double, as integers; what follows them is of no interest.
pub(super) const FLOAT_PIXELS: Tag = (0x7fe0, 0x0008);
pub(super) const DOUBLE_PIXELS: Tag = (0x7fe0, 0x0009);
const PIXELS: Tag = (0x7fe0, 0x0010);
const TRANSFER_SYNTAX: Tag = (0x0002, 0x0010);

/// Length of a sequence or item that ends by a delimiter.
const UNDEFINED: u32 = 0xffff_ffff;
/// Sequences within sequences; those of real images are some six deep.
const MAX_DEPTH: usize = 32;
/// Everything before the pixels: 10,000 frames of an enhanced image need some 20 MB.
const MAX_HEADER: u64 = 64 << 20;
/// A deflated file after decompression.
const MAX_INFLATED: u64 = 1 << 30;

/// How elements are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Coding {
    /// Elements do not say their type.
    implicit: bool,
    endian: Endian,
}

const EXPLICIT: Coding = Coding { implicit: false, endian: Endian::Little };
const IMPLICIT: Coding = Coding { implicit: true, endian: Endian::Little };
const EXPLICIT_BIG: Coding = Coding { implicit: false, endian: Endian::Big };

/// UIDs of transfer syntaxes that say how the data set is written.
const BIG_UID: &str = "1.2.840.10008.1.2.2";
const DEFLATED_UID: &str = "1.2.840.10008.1.2.1.99";

/// What the data set is read from: the file, or what was inflated.
pub(super) trait Source: Read + Seek {}
impl<T: Read + Seek> Source for T {}

/// A file up to its pixels.
pub(super) struct Header {
    bytes: Vec<u8>,
    coding: Coding,
    /// UID of the transfer syntax; empty where the file does not say.
    pub(super) syntax: String,
    /// Where the value of the pixels begins in the [`Source`]; none in files without an image.
    pub(super) pixels: Option<Pixels>,
    /// What is wrong after the elements that could be read.
    pub(super) fault: Option<Error>,
}

/// Where the pixels are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Pixels {
    pub(super) tag: Tag,
    pub(super) start: u64,
    /// `None`: encapsulated, in fragments.
    pub(super) length: Option<u64>,
    pub(super) endian: Endian,
}

/// Elements of one level, in the file's order.
pub(super) struct DataSet<'a> {
    elements: Vec<Element<'a>>,
}

/// A value that is there, and how elements within it are written.
#[derive(Clone, Copy)]
struct Element<'a> {
    tag: Tag,
    value: &'a [u8],
    coding: Coding,
}

/// Why reading stopped.
enum Stop {
    /// The bytes at hand end; the file may have more.
    More,
    Bad(String),
}

/// Whether a file begins as one with or without preamble or file meta information does.
pub(crate) fn is_dicom(head: &[u8]) -> bool {
    head.get(128..132) == Some(b"DICM") || bare(head).is_some()
}

/// The coding of a file that begins with an element rather than with the preamble.
fn bare(head: &[u8]) -> Option<Coding> {
    let first = head.first_chunk::<8>()?;
    let named = first[4].is_ascii_uppercase() && first[5].is_ascii_uppercase();
    match (&first[..2], named) {
        ([2 | 8, 0], true) if first[3] == 0 => Some(EXPLICIT),
        ([0, 8], true) if first[2] == 0 => Some(EXPLICIT_BIG),
        // Without a type to go by: a short value, and after it another element of the first groups.
        ([8, 0], false) if first[3] == 0 => {
            let length = u32::from_le_bytes([first[4], first[5], first[6], first[7]]) as usize;
            let next = head.get(8 + length..10 + length)?;
            (length <= 256 && matches!(next, [8 | 16, 0])).then_some(IMPLICIT)
        }
        _ => None,
    }
}

/// The data set of a file.
struct Opened {
    source: Box<dyn Source>,
    length: u64,
    /// Where its first element is.
    start: u64,
    coding: Coding,
    syntax: String,
}

fn open(path: &Path) -> Result<Opened> {
    let (mut file, length) = file::open(path).map_err(Error::io(path))?;
    let mut head = Vec::new();
    file.by_ref().take(1 << 16).read_to_end(&mut head).map_err(Error::io(path))?;
    let begin = if head.get(128..132) == Some(b"DICM") { 132 } else { 0 };
    let mut at = begin;
    let mut syntax = String::new();
    while head.get(at..at + 2) == Some(&[2, 0]) {
        let walk = Walk { bytes: &head, coding: EXPLICIT, at, end: length };
        let (element, next) = walk.element(0).map_err(|stop| stop.refusal(path, "file meta information"))?;
        if element.tag == TRANSFER_SYNTAX {
            syntax = text(element.value);
        }
        at = next;
    }
    let rest = head.get(at..).unwrap_or(&[]);
    let deflated = syntax == DEFLATED_UID;
    let coding = match syntax.as_str() {
        "" => bare(rest).unwrap_or(IMPLICIT),
        BIG_UID => EXPLICIT_BIG,
        // What a file says of itself and what it is differ now and then; no length looks like two capitals.
        _ if deflated || rest.get(4..6).is_some_and(|kind| kind.iter().all(u8::is_ascii_uppercase)) => {
            EXPLICIT
        }
        _ => IMPLICIT,
    };
    if !deflated {
        return Ok(Opened { source: Box::new(file), length, start: at as u64, coding, syntax });
    }
    file.seek(SeekFrom::Start(at as u64)).map_err(Error::io(path))?;
    let mut inflated = Vec::new();
    let outcome = flate2::read::DeflateDecoder::new(file).take(MAX_INFLATED + 1).read_to_end(&mut inflated);
    outcome.map_err(|e| bad(path, "data", format!("the deflated data set is truncated or damaged ({e})")))?;
    let length = inflated.len() as u64;
    if length > MAX_INFLATED {
        let problem = format!("more than {MAX_INFLATED} bytes after decompression, expected at most that");
        return Err(bad(path, "data", problem));
    }
    Ok(Opened { source: Box::new(Cursor::new(inflated)), length, start: 0, coding, syntax })
}

/// What the pixels are read from, and its length.
pub(super) fn source(path: &Path) -> Result<(Box<dyn Source>, u64)> {
    let Opened { source, length, .. } = open(path)?;
    Ok((source, length))
}

impl Header {
    /// Reads a file up to its pixels.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let Opened { mut source, length, start, coding, syntax } = open(path)?;
        let mut bytes = Vec::new();
        // Most headers are a few kB; what is larger is read in ever larger pieces.
        let mut want = 1 << 14;
        loop {
            source.seek(SeekFrom::Start(start)).map_err(Error::io(path))?;
            bytes.clear();
            source.by_ref().take(want).read_to_end(&mut bytes).map_err(Error::io(path))?;
            let end = length - start.min(length);
            let whole = bytes.len() as u64 >= end;
            let (used, found) = top(&bytes, coding, end);
            let (pixels, fault) = match found {
                Ok(pixels) => (pixels.map(|p| Pixels { start: p.start + start, ..p }), None),
                Err(Stop::More) if !whole && want < MAX_HEADER => {
                    want *= 4;
                    continue;
                }
                Err(Stop::More) if !whole => {
                    let problem =
                        format!("no pixels within {MAX_HEADER} bytes, expected a header of at most that");
                    (None, Some(bad(path, "header", problem)))
                }
                Err(stop) => (None, Some(stop.refusal(path, "header"))),
            };
            bytes.truncate(used);
            return Ok(Self { bytes, coding, syntax, pixels, fault });
        }
    }

    /// Its elements.
    pub(super) fn data_set(&self) -> DataSet<'_> {
        // Read once already, so nothing is wrong with them.
        DataSet { elements: level(&self.bytes, self.coding).unwrap_or_default() }
    }
}

/// Walks the outermost level up to the pixels: bytes of whole elements, and where the pixels are.
fn top(bytes: &[u8], coding: Coding, end: u64) -> (usize, Result<Option<Pixels>, Stop>) {
    let mut at = 0;
    let mut next = || -> Result<Option<Pixels>, Stop> {
        while (at as u64) < end {
            let walk = Walk { bytes, coding, at, end };
            let (tag, length, value) = walk.head()?;
            if [FLOAT_PIXELS, DOUBLE_PIXELS, PIXELS].contains(&tag) {
                let length = (length != UNDEFINED).then_some(length.into());
                return Ok(Some(Pixels { tag, start: value as u64, length, endian: coding.endian }));
            }
            // Only padding follows the pixels, and overlays precede them.
            if tag > PIXELS {
                break;
            }
            at = walk.element(0)?.1;
        }
        Ok(None)
    };
    let found = next();
    (at, found)
}

/// Elements of one level.
fn level(bytes: &[u8], coding: Coding) -> Result<Vec<Element<'_>>, Stop> {
    let mut elements = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let (element, next) = Walk { bytes, coding, at, end: bytes.len() as u64 }.element(0)?;
        elements.push(element);
        at = next;
    }
    Ok(elements)
}

/// A place in the bytes at hand; `end` is where the data set ends, perhaps beyond them.
#[derive(Clone, Copy)]
struct Walk<'a> {
    bytes: &'a [u8],
    coding: Coding,
    at: usize,
    end: u64,
}

impl<'a> Walk<'a> {
    fn slice(&self, at: usize, length: usize) -> Result<&'a [u8], Stop> {
        let end = at.checked_add(length).filter(|end| *end as u64 <= self.end);
        let Some(end) = end else {
            return Err(Stop::Bad(format!(
                "{length} bytes at byte {at} of the data set, which has {}",
                self.end
            )));
        };
        self.bytes.get(at..end).ok_or(Stop::More)
    }

    fn u16(&self, at: usize) -> Result<u16, Stop> {
        let bytes = self.slice(at, 2)?;
        Ok(u16::from_le_bytes(ordered([bytes[0], bytes[1]], self.coding.endian)))
    }

    fn u32(&self, at: usize) -> Result<u32, Stop> {
        let bytes = self.slice(at, 4)?;
        Ok(u32::from_le_bytes(ordered([bytes[0], bytes[1], bytes[2], bytes[3]], self.coding.endian)))
    }

    fn tag(&self) -> Result<Tag, Stop> {
        Ok((self.u16(self.at)?, self.u16(self.at + 2)?))
    }

    /// Tag, length and where the value begins.
    fn head(&self) -> Result<(Tag, u32, usize), Stop> {
        let (tag, at) = (self.tag()?, self.at);
        // Items and delimiters have no type.
        if self.coding.implicit || tag.0 == 0xfffe {
            return Ok((tag, self.u32(at + 4)?, at + 8));
        }
        let kind = self.slice(at + 4, 2)?;
        match kind {
            b"OB" | b"OD" | b"OF" | b"OL" | b"OV" | b"OW" | b"SQ" | b"SV" | b"UC" | b"UN" | b"UR" | b"UT"
            | b"UV" => Ok((tag, self.u32(at + 8)?, at + 12)),
            [a, b] if a.is_ascii_uppercase() && b.is_ascii_uppercase() => {
                Ok((tag, self.u16(at + 6)?.into(), at + 8))
            }
            _ => Err(Stop::Bad(format!(
                "{} has type {}, expected two capitals",
                name(tag),
                kind.escape_ascii()
            ))),
        }
    }

    /// An element and where the next begins. A value without length ends before its delimiter.
    fn element(&self, depth: usize) -> Result<(Element<'a>, usize), Stop> {
        let (tag, length, value) = self.head()?;
        // What a value of unknown type holds is in implicit coding (PS3.5 §6.2.2).
        let unknown = !self.coding.implicit && self.slice(self.at + 4, 2)? == b"UN";
        let coding = if unknown { IMPLICIT } else { self.coding };
        if length != UNDEFINED {
            let bytes = self.slice(value, length as usize).map_err(|stop| match stop {
                Stop::Bad(problem) => Stop::Bad(format!("{}: {problem}", name(tag))),
                more => more,
            })?;
            return Ok((Element { tag, value: bytes, coding }, value + length as usize));
        }
        let (end, next) = Walk { at: value, coding, ..*self }.sequence_end(depth + 1)?;
        Ok((Element { tag, value: &self.bytes[value..end], coding }, next))
    }

    /// From the first item of a sequence without length to its delimiter: where that begins and ends.
    fn sequence_end(&self, depth: usize) -> Result<(usize, usize), Stop> {
        if depth > MAX_DEPTH {
            return Err(Stop::Bad(format!("sequences nested deeper than {MAX_DEPTH}")));
        }
        let mut walk = *self;
        loop {
            let (tag, length, value) = walk.head()?;
            match tag {
                SEQUENCE_END => return Ok((walk.at, value)),
                ITEM => walk.at = walk.item(length, value, depth)?.1,
                other => return Err(Stop::Bad(format!("{} in a sequence, expected an item", name(other)))),
            }
        }
    }

    /// Where the elements of an item end, and where what follows it begins.
    fn item(&self, length: u32, value: usize, depth: usize) -> Result<(usize, usize), Stop> {
        if length != UNDEFINED {
            self.slice(value, length as usize)?;
            return Ok((value + length as usize, value + length as usize));
        }
        let mut walk = Walk { at: value, ..*self };
        loop {
            if walk.tag()? == ITEM_END {
                return Ok((walk.at, walk.head()?.2));
            }
            walk.at = walk.element(depth)?.1;
        }
    }
}

impl Stop {
    fn refusal(self, path: &Path, field: &str) -> Error {
        match self {
            Stop::More => bad(path, field, "ends within an element: the file is cut off"),
            Stop::Bad(problem) => bad(path, field, problem),
        }
    }
}

impl<'a> DataSet<'a> {
    /// An element that is not empty.
    fn element(&self, tag: Tag) -> Option<Element<'a>> {
        self.elements.iter().copied().find(|e| e.tag == tag && !e.value.is_empty())
    }

    /// Whether an element is there and not empty.
    pub(super) fn has(&self, tag: Tag) -> bool {
        self.element(tag).is_some()
    }

    /// Text, without padding.
    pub(super) fn text(&self, tag: Tag) -> Option<String> {
        self.element(tag).map(|e| text(e.value)).filter(|text| !text.is_empty())
    }

    /// An unsigned integer of 16 bits.
    pub(super) fn u16(&self, tag: Tag) -> Option<u16> {
        let Element { value, coding, .. } = self.element(tag)?;
        Some(u16::from_le_bytes(ordered(*value.first_chunk()?, coding.endian)))
    }

    /// Decimal numbers, written as text with backslashes between them; what is none is NaN, which every use refuses.
    pub(super) fn numbers(&self, tag: Tag) -> Option<Vec<f64>> {
        let text = self.text(tag)?;
        Some(text.split('\\').map(|word| word.trim().parse().unwrap_or(f64::NAN)).collect())
    }

    /// Unsigned integers of 64 bits.
    pub(super) fn u64s(&self, tag: Tag) -> Option<Vec<u64>> {
        let Element { value, coding, .. } = self.element(tag)?;
        Some(value.as_chunks().0.iter().map(|c| u64::from_le_bytes(ordered(*c, coding.endian))).collect())
    }

    /// Items of a sequence; none when it is missing. What is wrong within one ends the list.
    pub(super) fn items(&self, tag: Tag) -> Vec<DataSet<'a>> {
        let Some(Element { value: bytes, coding, .. }) = self.element(tag) else { return Vec::new() };
        let mut walk = Walk { bytes, coding, at: 0, end: bytes.len() as u64 };
        let mut items = Vec::new();
        while let Ok((ITEM, length, value)) = walk.head()
            && let Ok((end, next)) = walk.item(length, value, 0)
            && let Ok(elements) = level(&bytes[value..end], coding)
        {
            items.push(DataSet { elements });
            walk.at = next;
        }
        items
    }

    /// The first item of a sequence.
    pub(super) fn item(&self, tag: Tag) -> Option<DataSet<'a>> {
        self.items(tag).into_iter().next()
    }
}

/// A tag as the standard writes it.
pub(super) fn name(tag: Tag) -> String {
    format!("({:04X},{:04X})", tag.0, tag.1)
}

/// Text of a value: names and identifiers only, so what is not ASCII does not matter.
fn text(value: &[u8]) -> String {
    String::from_utf8_lossy(value).trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned()
}
