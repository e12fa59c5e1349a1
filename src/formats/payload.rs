//! The data part of every format: found, checked for size, decoded. Headers only say where and how.
//!
//! Data that are shorter than the header says are refused. What follows them is ignored with a warning, as other readers do, and
//! without one where it is the zeros that fill a tape; only data that no header describes have to fit exactly. Before memory is
//! asked for, the files' lengths must make the promised size possible, so an absurd header costs nothing. Of a series one
//! frame is kept in memory.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::parts::Parts;
use crate::reading::Frame;
use crate::volume::bad;
use crate::{Error, Result, file, gzip};
use cao_model::error::{quoted, shown_path};
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

/// What a header says about the data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Payload {
    pub(crate) kind: Kind,
    pub(crate) endian: Endian,
    pub(crate) encoding: Encoding,
    pub(crate) skip: Skip,
    /// Files that hold an equal share of the values each, in order. The number of all values is a multiple of their number.
    pub(crate) parts: Parts,
    /// Which values are wanted.
    pub(crate) frame: Frame,
    /// Nothing may follow the values.
    pub(crate) exact: bool,
}

/// No deflate stream expands further than this many times (RFC 1951: 258 bytes from 2 bits).
const DEFLATE_MAX_RATIO: u64 = 1032;

/// Lines to be skipped are those of a foreign header; none is longer.
const MAX_SKIPPED_LINES_BYTES: u64 = 16 << 20;

/// Zeros behind compressed data are looked at up to here; a longer rest is warned of, whatever it is.
const MAX_PADDING_BYTES: u64 = 16 << 20;

/// A number in text, as long as the longest that a double needs when it is written out in full.
const MAX_WORD_BYTES: usize = 1100;

impl Payload {
    /// Reads the `count` values of the frame. `header` and `field` (of the data file's name) are named when a data file is missing.
    /// What follows the values becomes one of `warnings`.
    pub(crate) fn read(
        &self,
        header: &Path,
        field: &str,
        count: usize,
        warnings: &mut Vec<String>,
    ) -> Result<Values> {
        let too_large = |values: String| {
            let kind = self.kind.name();
            bad(
                header,
                field,
                format!("{values} values of type {kind} are more memory than the system gives"),
            )
        };
        let all = (count as u64).checked_mul(self.frame.count);
        let all =
            all.filter(|n| n.checked_mul(self.kind.bytes() as u64).is_some_and(|n| n < i64::MAX as u64));
        let all = all.ok_or_else(|| too_large(format!("{count} × {}", self.frame.count)))?;
        let share = all / self.parts.len();
        // The first and the last file stand for all here: thousands of slices must not all be open at once.
        for number in [0, self.parts.len() - 1] {
            OpenPart::open(&self.parts, number, header, field)?.check_possible(self, share)?;
        }
        let bytes = need_bytes(self, count as u64);
        if cao_model::memory::available().is_some_and(|available| bytes > available) {
            return Err(too_large(count.to_string()));
        }
        let mut values =
            Values::with_capacity(self.kind, count).ok_or_else(|| too_large(count.to_string()))?;
        let mut following: Option<String> = None;
        let mut more = 0;
        for number in 0..self.parts.len() {
            let span = Span::of(self.frame, count as u64, number * share, share);
            if span.take == 0 {
                continue;
            }
            let part = OpenPart::open(&self.parts, number, header, field)?.check_possible(self, share)?;
            match (part.read(self, span, &mut values)?, &following) {
                (None, _) => {}
                (found, None) => following = found,
                (Some(_), Some(_)) => more += 1,
            }
        }
        let and_more = if more > 0 { format!(" (and so in {more} more files)") } else { String::new() };
        warnings.extend(following.map(|found| found + &and_more));
        Ok(values)
    }
}

/// The wanted values among the `share` values of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Span {
    /// Values of the file.
    share: u64,
    /// Of these, the values before the first wanted one.
    before: u64,
    /// From one wanted value to the next.
    stride: u64,
    /// Wanted values.
    take: u64,
}

impl Span {
    /// In a file that begins with value `start` of all.
    fn of(frame: Frame, count: u64, start: u64, share: u64) -> Span {
        let none = Span { share, before: 0, stride: 1, take: 0 };
        if frame.interleaved {
            let n = frame.count;
            let before = (frame.index + n - start % n) % n;
            return match before < share {
                true => Span { before, stride: n, take: (share - before - 1) / n + 1, ..none },
                false => none,
            };
        }
        let (first, end) = (frame.index * count, (frame.index + 1) * count);
        let (from, to) = (first.max(start), end.min(start + share));
        if from < to { Span { before: from - start, take: to - from, ..none } } else { none }
    }

    /// Values of the file up to and with the last wanted one.
    fn reach(&self) -> u64 {
        self.before + (self.take - 1) * self.stride + 1
    }
}

/// A data file that is there.
struct OpenPart {
    path: PathBuf,
    start: u64,
    length: u64,
    file: BufReader<File>,
}

impl OpenPart {
    fn open(parts: &Parts, number: u64, header: &Path, field: &str) -> Result<Self> {
        let path = parts.path(number);
        let missing = |e: io::Error| bad(header, field, format!("data file {}: {e}", shown_path(&path)));
        let (mut file, length) = file::open(&path).map_err(missing)?;
        file.seek(SeekFrom::Start(parts.start)).map_err(missing)?;
        let file = BufReader::with_capacity(1 << 16, file);
        Ok(Self { start: parts.start, length, file, path })
    }

    /// Refuses what cannot hold `count` values, whatever is in it.
    fn check_possible(self, payload: &Payload, count: u64) -> Result<Self> {
        let have = self.length.saturating_sub(self.start);
        let need = need_bytes(payload, count);
        let possible = match payload.encoding {
            Encoding::Raw => have >= need,
            Encoding::Deflate => have.saturating_mul(DEFLATE_MAX_RATIO) >= need,
            // A digit and a separator each, the last without.
            Encoding::Ascii => have >= count.saturating_mul(2).saturating_sub(1),
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

    /// Appends the wanted values; says what follows the last value of the file.
    fn read(mut self, payload: &Payload, span: Span, values: &mut Values) -> Result<Option<String>> {
        let bytes = match payload.skip {
            Skip::Ahead { lines, bytes } => {
                self.skip_lines(lines)?;
                bytes
            }
            Skip::AllButLast => {
                let position = self.length.saturating_sub(need_bytes(payload, span.share));
                self.seek(position)?;
                0
            }
        };
        let following = match payload.encoding {
            Encoding::Raw => self.read_raw(payload, span, bytes, values),
            Encoding::Deflate => self.read_deflate(payload, span, bytes, values),
            Encoding::Ascii => self.read_ascii(payload, span, bytes, values),
        }?;
        Ok(following.map(|what| bad(&self.path, "data", format!("{what}, ignored")).to_string()))
    }

    fn skip_lines(&mut self, lines: u64) -> Result<()> {
        let mut ahead = self.file.by_ref().take(MAX_SKIPPED_LINES_BYTES);
        for line in 0..lines {
            if ahead.skip_until(b'\n').map_err(Error::io(&self.path))? == 0 {
                let problem = format!(
                    "{lines} lines, but the data file has only {line} in its first {MAX_SKIPPED_LINES_BYTES} bytes"
                );
                return Err(bad(&self.path, "line skip", problem));
            }
        }
        Ok(())
    }

    fn position(&mut self) -> Result<u64> {
        self.file.stream_position().map_err(Error::io(&self.path))
    }

    fn seek(&mut self, position: u64) -> Result<()> {
        self.file.seek(SeekFrom::Start(position)).map(drop).map_err(Error::io(&self.path))
    }

    /// Goes ahead by bytes of the file as stored.
    fn skip_bytes(&mut self, skip: u64) -> Result<()> {
        let position = self.position()?;
        let begin = position.checked_add(skip).filter(|&b| b <= self.length);
        let Some(begin) = begin else {
            let problem = format!("{skip}, but only {} bytes follow", self.length.saturating_sub(position));
            return Err(bad(&self.path, "byte skip", problem));
        };
        self.seek(begin)
    }

    fn read_raw(
        &mut self,
        payload: &Payload,
        span: Span,
        skip: u64,
        values: &mut Values,
    ) -> Result<Option<String>> {
        self.skip_bytes(skip)?;
        let begin = self.position()?;
        let (have, need) = (self.length - begin, need_bytes(payload, span.share));
        if have < need || (payload.exact && have > need) {
            return Err(self.wrong_size(payload, span.share, format!("{have} bytes")));
        }
        self.seek(begin + need_bytes(payload, span.before))?;
        let got = append(&mut self.file, payload, span, values).map_err(Error::io(&self.path))?;
        if got < need_bytes(payload, span.take) {
            return Err(self.wrong_size(payload, span.take, format!("{got} bytes")));
        }
        Ok((have > need).then(|| format!("{} bytes after the {need} bytes of values", have - need)))
    }

    fn read_deflate(
        &mut self,
        payload: &Payload,
        span: Span,
        skip: u64,
        values: &mut Values,
    ) -> Result<Option<String>> {
        let gzip = gzip::is_next(&mut self.file).map_err(Error::io(&self.path))?;
        let outcome = if gzip {
            inflate(gzip::Members::new(&mut self.file), payload, span, skip, values)
        } else {
            inflate(flate2::bufread::ZlibDecoder::new(&mut self.file), payload, span, skip, values)
        };
        let need = need_bytes(payload, span.share);
        match outcome {
            Ok(Inflated::Whole) => {}
            // The stream is left where it is: what it holds more may be without end.
            Ok(Inflated::Long) => {
                return Ok(Some(format!("more than {need} bytes after decompression, the rest")));
            }
            Ok(Inflated::SkipTooLong(have)) => {
                let problem = format!("{skip}, but the decompressed data are only {have} bytes");
                return Err(bad(&self.path, "byte skip", problem));
            }
            Ok(Inflated::Short(got)) => {
                return Err(self.wrong_size(payload, span.share, format!("{got} bytes after decompression")));
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
                return Err(bad(&self.path, "data", problem));
            }
            Err(source) => return Err(Error::io(&self.path)(source)),
        }
        let rest = self.length.saturating_sub(self.position()?);
        let padding = rest <= MAX_PADDING_BYTES && self.only_zeros().map_err(Error::io(&self.path))?;
        Ok((!padding).then(|| format!("{rest} bytes after the end of the compressed data")))
    }

    fn only_zeros(&mut self) -> io::Result<bool> {
        loop {
            let next = self.file.fill_buf()?;
            match next.len() {
                0 => return Ok(true),
                _ if next.iter().any(|b| *b != 0) => return Ok(false),
                got => self.file.consume(got),
            }
        }
    }

    fn read_ascii(
        &mut self,
        payload: &Payload,
        span: Span,
        skip: u64,
        values: &mut Values,
    ) -> Result<Option<String>> {
        self.skip_bytes(skip)?;
        let mut word = Vec::new();
        let mut next = |word: &mut Vec<u8>| next_word(&mut self.file, word).map_err(Error::io(&self.path));
        for found in 0..span.share {
            if !next(&mut word)? {
                return Err(self.wrong_size(payload, span.share, format!("{found} numbers")));
            }
            let wanted = found >= span.before
                && found < span.reach()
                && (found - span.before).is_multiple_of(span.stride);
            if wanted && !std::str::from_utf8(&word).is_ok_and(|word| values.append_text(word)) {
                let word = String::from_utf8_lossy(&word);
                let problem = format!(
                    "value {found} is {}, expected a number of type {}",
                    quoted(&word),
                    payload.kind.name()
                );
                return Err(bad(&self.path, "data", problem));
            }
        }
        Ok(next(&mut word)?.then(|| format!("more than {} numbers, the rest", span.share)))
    }

    fn wrong_size(&self, payload: &Payload, count: u64, found: String) -> Error {
        let (kind, need) = (payload.kind.name(), need_bytes(payload, count));
        let expected = match payload.encoding {
            Encoding::Ascii => format!("expected {count} numbers of type {kind}"),
            _ => format!("expected exactly {need} bytes ({count} values of type {kind})"),
        };
        bad(&self.path, "data", format!("{found}, {expected}"))
    }
}

/// [`Payload::read`] made sure that the values of all files fit 63 bits.
fn need_bytes(payload: &Payload, count: u64) -> u64 {
    count * payload.kind.bytes() as u64
}

/// Appends the wanted values from the first of them on; returns the bytes of those that came.
fn append(from: &mut dyn BufRead, payload: &Payload, span: Span, values: &mut Values) -> io::Result<u64> {
    let take = span.take as usize;
    if span.stride == 1 {
        return values.append(&mut { from }, take, payload.endian);
    }
    let keep = payload.kind.bytes() as u64;
    values.append(&mut Every { from, keep, skip: (span.stride - 1) * keep, at: 0 }, take, payload.endian)
}

/// `keep` bytes, then not the next `skip`, and so on; stands behind the last byte that was asked for.
struct Every<'a> {
    from: &'a mut dyn BufRead,
    keep: u64,
    skip: u64,
    /// Bytes since the last value that is kept began.
    at: u64,
}

impl Read for Every<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut got = 0;
        while got < buffer.len() {
            let next = self.from.fill_buf()?;
            if next.is_empty() {
                break;
            }
            let now;
            if self.at < self.keep {
                now = next.len().min(buffer.len() - got).min((self.keep - self.at) as usize);
                buffer[got..got + now].copy_from_slice(&next[..now]);
                got += now;
            } else {
                now = (next.len() as u64).min(self.keep + self.skip - self.at) as usize;
            }
            self.from.consume(now);
            self.at = (self.at + now as u64) % (self.keep + self.skip);
        }
        Ok(got)
    }
}

/// The next word between white space or commas; `false` at the end. A word is cut where it is too long to be a number.
fn next_word(from: &mut dyn BufRead, word: &mut Vec<u8>) -> io::Result<bool> {
    word.clear();
    loop {
        let next = from.fill_buf()?;
        let mut used = 0;
        for byte in next {
            let separates = byte.is_ascii_whitespace() || *byte == b',';
            if word.len() == MAX_WORD_BYTES || (separates && !word.is_empty()) {
                from.consume(used);
                return Ok(true);
            }
            used += 1;
            if !separates {
                word.push(*byte);
            }
        }
        if used == 0 {
            return Ok(!word.is_empty());
        }
        from.consume(used);
    }
}

enum Inflated {
    /// All values, and the stream ended after them.
    Whole,
    /// The stream ended after so many bytes, within those to be skipped.
    SkipTooLong(u64),
    /// So many bytes of values came.
    Short(u64),
    /// All values, and more.
    Long,
}

/// Never takes more from `stream` than one byte beyond what is needed: a stream that would go on forever is cut off.
fn inflate(
    stream: impl Read,
    payload: &Payload,
    span: Span,
    skip: u64,
    values: &mut Values,
) -> io::Result<Inflated> {
    let mut stream = BufReader::new(stream);
    let pass = |bytes: u64, stream: &mut dyn Read| io::copy(&mut stream.take(bytes), &mut io::sink());
    let skipped = pass(skip, &mut stream)?;
    if skipped < skip {
        return Ok(Inflated::SkipTooLong(skipped));
    }
    let before = need_bytes(payload, span.before);
    let passed = pass(before, &mut stream)?;
    if passed < before {
        return Ok(Inflated::Short(passed));
    }
    let got = append(&mut stream, payload, span, values)?;
    if got < need_bytes(payload, span.take) {
        return Ok(Inflated::Short(before + got));
    }
    let (reach, need) = (need_bytes(payload, span.reach()), need_bytes(payload, span.share));
    let after = pass(need - reach, &mut stream)?;
    if reach + after < need {
        return Ok(Inflated::Short(reach + after));
    }
    // Reading to the end also checks the stream's checksum.
    let beyond = pass(1, &mut stream)?;
    Ok(if beyond > 0 { Inflated::Long } else { Inflated::Whole })
}
