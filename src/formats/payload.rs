//! The data part of every format: found, checked for size, decoded. Headers only say where and how.
//!
//! Sizes are exact everywhere: data that are shorter or longer than the header says are refused, because either means
//! that header and data do not belong together. Before memory is asked for, the file's length must make the promised
//! size possible, so an absurd header costs nothing.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::error::printable;
use crate::input;
use crate::volume::bad;
use crate::{Error, Result};
use cao_model::values::{Endian, Kind, Values};

/// How values are written in a data file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// Binary.
    Raw,
    /// Binary in a gzip or zlib stream; which of the two, its first bytes tell.
    Deflate,
    /// Decimal numbers between white space or commas.
    Ascii,
}

/// What stands before the values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Skip {
    /// Text lines of the file as stored, then bytes after decompression.
    Ahead { lines: u64, bytes: u64 },
    /// Everything but the last bytes, as many as the values need (raw only).
    AllButLast,
}

impl Skip {
    pub(crate) const NOTHING: Skip = Skip::Ahead { lines: 0, bytes: 0 };
}

/// A file that holds an equal share of the values, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Part {
    /// The file.
    pub(crate) path: PathBuf,
    /// Byte of the file as stored where the data, or what is to be skipped before them, begin.
    pub(crate) start: u64,
}

/// What a header says about the data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Payload {
    pub(crate) kind: Kind,
    pub(crate) endian: Endian,
    pub(crate) encoding: Encoding,
    pub(crate) skip: Skip,
    /// At least one; the number of values is a multiple of their number.
    pub(crate) parts: Vec<Part>,
}

/// No deflate stream expands further than this many times (RFC 1951: 258 bytes from 2 bits).
const DEFLATE_MAX_RATIO: u64 = 1032;

impl Payload {
    /// Reads `count` values. `header` and `field` (of the data file's name) are named when a data file is missing.
    pub(crate) fn read(&self, header: &Path, field: &str, count: usize) -> Result<Values> {
        let per_part = count / self.parts.len();
        let mut open = Vec::new();
        // The first and the last file stand for all here: thousands of slices must not all be open at once.
        for part in self.parts.iter().take(1).chain(self.parts.iter().skip(1).last()) {
            open.push(OpenPart::open(part, header, field)?.check_possible(self, per_part)?);
        }
        drop(open);
        let mut values = Values::with_capacity(self.kind, count).ok_or_else(|| {
            let bytes = count as u64 * self.kind.bytes() as u64;
            bad(header, field, format!("{bytes} bytes of values are more memory than the system gives"))
        })?;
        for part in &self.parts {
            OpenPart::open(part, header, field)?.check_possible(self, per_part)?.read(
                self,
                per_part,
                &mut values,
            )?;
        }
        Ok(values)
    }
}

/// A data file that is there.
struct OpenPart<'a> {
    path: &'a Path,
    start: u64,
    length: u64,
    file: BufReader<File>,
}

impl<'a> OpenPart<'a> {
    fn open(part: &'a Part, header: &Path, field: &str) -> Result<Self> {
        let missing = |why: String| bad(header, field, format!("data file {}: {why}", printable(&part.path)));
        let meta = std::fs::metadata(&part.path).map_err(|e| missing(e.to_string()))?;
        if !meta.is_file() {
            return Err(missing("not a regular file".into()));
        }
        let mut file = input::open(&part.path).map_err(|e| missing(e.to_string()))?;
        file.seek(SeekFrom::Start(part.start)).map_err(|e| missing(e.to_string()))?;
        let file = BufReader::with_capacity(1 << 16, file);
        Ok(Self { path: &part.path, start: part.start, length: meta.len(), file })
    }

    /// Refuses what cannot hold `count` values, whatever is in it.
    fn check_possible(self, payload: &Payload, count: usize) -> Result<Self> {
        let have = self.length.saturating_sub(self.start);
        let need = need_bytes(payload, count);
        let possible = match payload.encoding {
            Encoding::Raw => have >= need,
            Encoding::Deflate => have.saturating_mul(DEFLATE_MAX_RATIO) >= need,
            // A digit and a separator each, the last without.
            Encoding::Ascii => have >= (count as u64 * 2).saturating_sub(1),
        };
        if possible {
            return Ok(self);
        }
        let what = match payload.encoding {
            Encoding::Raw => format!("{have} bytes"),
            Encoding::Deflate => format!("{have} bytes of compressed data, which cannot hold that much"),
            Encoding::Ascii => format!("{have} bytes of text"),
        };
        Err(self.wrong_size(payload, count, what))
    }

    fn read(mut self, payload: &Payload, count: usize, values: &mut Values) -> Result<()> {
        let bytes = match payload.skip {
            Skip::Ahead { lines, bytes } => {
                self.skip_lines(lines)?;
                bytes
            }
            Skip::AllButLast => {
                let position = self.length.saturating_sub(need_bytes(payload, count));
                self.file.seek(SeekFrom::Start(position)).map_err(|source| self.io(source))?;
                0
            }
        };
        match payload.encoding {
            Encoding::Raw => self.read_raw(payload, count, bytes, values),
            Encoding::Deflate => self.read_deflate(payload, count, bytes, values),
            Encoding::Ascii => self.read_ascii(payload, count, bytes, values),
        }
    }

    fn skip_lines(&mut self, lines: u64) -> Result<()> {
        for line in 0..lines {
            if self.file.skip_until(b'\n').map_err(|source| self.io(source))? == 0 {
                return Err(bad(
                    self.path,
                    "line skip",
                    format!("{lines} lines, but the data file has only {line}"),
                ));
            }
        }
        Ok(())
    }

    fn read_raw(mut self, payload: &Payload, count: usize, skip: u64, values: &mut Values) -> Result<()> {
        let position = self.file.stream_position().map_err(|source| self.io(source))?;
        let begin = position.checked_add(skip).filter(|&b| b <= self.length);
        let Some(begin) = begin else {
            return Err(bad(
                self.path,
                "byte skip",
                format!("{skip}, but only {} bytes follow", self.length - position),
            ));
        };
        self.file.seek(SeekFrom::Start(begin)).map_err(|source| self.io(source))?;
        let have = self.length - begin;
        let need = need_bytes(payload, count);
        if have == need {
            let got =
                values.append(&mut self.file, count, payload.endian).map_err(|source| self.io(source))?;
            if got == need {
                return Ok(());
            }
        }
        Err(self.wrong_size(payload, count, format!("{have} bytes")))
    }

    fn read_deflate(mut self, payload: &Payload, count: usize, skip: u64, values: &mut Values) -> Result<()> {
        let gzip =
            self.file.fill_buf().map(|b| b.starts_with(&[0x1f, 0x8b])).map_err(|source| self.io(source))?;
        let outcome = if gzip {
            let mut stream = flate2::bufread::MultiGzDecoder::new(&mut self.file);
            inflate(&mut stream, payload, count, skip, values)
        } else {
            let mut stream = flate2::bufread::ZlibDecoder::new(&mut self.file);
            inflate(&mut stream, payload, count, skip, values)
        };
        let need = need_bytes(payload, count);
        match outcome {
            Ok(Inflated::Exact) => {}
            Ok(Inflated::SkipTooLong(have)) => {
                let problem = format!("{skip}, but the decompressed data are only {have} bytes");
                return Err(bad(self.path, "byte skip", problem));
            }
            Ok(Inflated::Short(got)) => {
                return Err(self.wrong_size(payload, count, format!("{got} bytes after decompression")));
            }
            Ok(Inflated::Long) => {
                return Err(self.wrong_size(
                    payload,
                    count,
                    format!("more than {need} bytes after decompression"),
                ));
            }
            // Damage shows as one of these; the rest is the system's.
            Err(e)
                if matches!(
                    e.kind(),
                    io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput
                ) =>
            {
                let problem = format!(
                    "the compressed data are truncated or damaged ({e}), expected {need} bytes in them"
                );
                return Err(bad(self.path, "data", problem));
            }
            Err(source) => return Err(self.io(source)),
        }
        let rest = io::copy(&mut self.file, &mut io::sink()).map_err(|source| self.io(source))?;
        if rest > 0 {
            return Err(bad(
                self.path,
                "data",
                format!("{rest} bytes after the end of the compressed data, expected none"),
            ));
        }
        Ok(())
    }

    fn read_ascii(mut self, payload: &Payload, count: usize, skip: u64, values: &mut Values) -> Result<()> {
        let skipped = io::copy(&mut self.file.by_ref().take(skip), &mut io::sink())
            .map_err(|source| self.io(source))?;
        if skipped < skip {
            return Err(bad(self.path, "byte skip", format!("{skip}, but only {skipped} bytes follow")));
        }
        let mut text = Vec::new();
        self.file.read_to_end(&mut text).map_err(|source| self.io(source))?;
        let words = text.split(|b| b.is_ascii_whitespace() || *b == b',').filter(|w| !w.is_empty());
        let mut found = 0;
        for word in words {
            if found == count {
                return Err(self.wrong_size(payload, count, format!("more than {count} numbers")));
            }
            if !std::str::from_utf8(word).is_ok_and(|word| values.append_text(word)) {
                let word = String::from_utf8_lossy(&word[..word.len().min(32)]).into_owned();
                let problem =
                    format!("value {found} is {word:?}, expected a number of type {}", payload.kind.name());
                return Err(bad(self.path, "data", problem));
            }
            found += 1;
        }
        if found < count {
            return Err(self.wrong_size(payload, count, format!("{found} numbers")));
        }
        Ok(())
    }

    fn wrong_size(&self, payload: &Payload, count: usize, found: String) -> Error {
        let (kind, need) = (payload.kind.name(), need_bytes(payload, count));
        let expected = match payload.encoding {
            Encoding::Ascii => format!("expected {count} numbers of type {kind}"),
            _ => format!("expected exactly {need} bytes ({count} values of type {kind})"),
        };
        bad(self.path, "data", format!("{found}, {expected}"))
    }

    fn io(&self, source: io::Error) -> Error {
        Error::Io { path: self.path.to_path_buf(), source }
    }
}

fn need_bytes(payload: &Payload, count: usize) -> u64 {
    count as u64 * payload.kind.bytes() as u64
}

enum Inflated {
    Exact,
    /// The stream ended after so many bytes, within those to be skipped.
    SkipTooLong(u64),
    /// So many bytes of values came.
    Short(u64),
    Long,
}

/// Never takes more from `stream` than one byte beyond what is needed: a stream that would go on forever is cut off.
fn inflate(
    stream: &mut dyn Read,
    payload: &Payload,
    count: usize,
    skip: u64,
    values: &mut Values,
) -> io::Result<Inflated> {
    let skipped = io::copy(&mut stream.take(skip), &mut io::sink())?;
    if skipped < skip {
        return Ok(Inflated::SkipTooLong(skipped));
    }
    let got = values.append(stream, count, payload.endian)?;
    if got < need_bytes(payload, count) {
        return Ok(Inflated::Short(got));
    }
    // Reading to the end also checks the stream's checksum.
    let beyond = io::copy(&mut stream.take(1), &mut io::sink())?;
    Ok(if beyond > 0 { Inflated::Long } else { Inflated::Exact })
}
