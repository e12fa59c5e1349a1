//! What the two text headers, NRRD and MetaImage, have in common.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use crate::parts::{Numbers, Parts};
use crate::volume::bad;
use crate::{Error, Result, file};
pub(crate) use cao_model::error::quoted;

/// Longest header that is read. Segmentation and diffusion files carry long ones, none this long.
const MAX_HEADER_BYTES: u64 = 16 << 20;

/// More slices than this are a mistake in the pattern.
const MAX_FILES: u64 = 1 << 20;

/// Lines of a text header, and the byte where the next one begins.
pub(crate) struct Lines<'a> {
    path: &'a Path,
    file: std::io::Take<BufReader<File>>,
    position: u64,
}

impl<'a> Lines<'a> {
    pub(crate) fn open(path: &'a Path) -> Result<Self> {
        let (file, _) = file::open(path).map_err(Error::io(path))?;
        Ok(Self { path, file: BufReader::new(file).take(MAX_HEADER_BYTES), position: 0 })
    }

    /// Next line without its end; `None` at the end of the file.
    pub(crate) fn next(&mut self) -> Result<Option<String>> {
        let mut line = Vec::new();
        let got = self
            .file
            .read_until(b'\n', &mut line)
            .map_err(|source| Error::Io { path: self.path.into(), source })?;
        self.position += got as u64;
        if self.position == MAX_HEADER_BYTES {
            return Err(bad(self.path, "header", format!("no end within {MAX_HEADER_BYTES} bytes")));
        }
        if got == 0 {
            return Ok(None);
        }
        while line.last().is_some_and(|b| *b == b'\n' || *b == b'\r') {
            line.pop();
        }
        Ok(Some(String::from_utf8_lossy(&line).into_owned()))
    }

    /// The rest of the header's lines that are not empty, trimmed: names of files.
    pub(crate) fn rest(&mut self) -> Result<Vec<String>> {
        let mut rest = Vec::new();
        while let Some(line) = self.next()? {
            if !line.trim().is_empty() {
                if rest.len() as u64 == MAX_FILES {
                    let problem = format!("more than {MAX_FILES} names after LIST");
                    return Err(bad(self.path, "header", problem));
                }
                rest.push(line.trim().to_string());
            }
        }
        Ok(rest)
    }

    /// Byte of the file after the last line that was returned.
    pub(crate) fn position(&self) -> u64 {
        self.position
    }
}

/// Header fields by name, each given once.
pub(crate) struct Fields<'a> {
    pub(crate) path: &'a Path,
    entries: BTreeMap<String, String>,
}

impl<'a> Fields<'a> {
    pub(crate) fn new(path: &'a Path) -> Self {
        Self { path, entries: BTreeMap::new() }
    }

    pub(crate) fn insert(&mut self, name: &str, value: &str) -> Result<()> {
        match self.entries.insert(name.to_string(), value.trim().to_string()) {
            Some(_) => Err(bad(self.path, name, "given twice, expected once")),
            None => Ok(()),
        }
    }

    pub(crate) fn get(&self, name: &str) -> Option<&str> {
        self.entries.get(name).map(String::as_str)
    }

    pub(crate) fn require(&self, name: &str) -> Result<&str> {
        self.get(name).ok_or_else(|| bad(self.path, name, "missing, expected in every header"))
    }

    /// Numbers between white space; `what` describes one of them in the error.
    pub(crate) fn numbers<T: std::str::FromStr>(&self, name: &str, what: &str) -> Result<Option<Vec<T>>> {
        let Some(value) = self.get(name) else { return Ok(None) };
        let numbers: Option<Vec<T>> = value.split_whitespace().map(|word| word.parse().ok()).collect();
        numbers.map(Some).ok_or_else(|| bad(self.path, name, format!("{}, expected {what}", quoted(value))))
    }

    /// Exactly `count` numbers.
    pub(crate) fn list<T: std::str::FromStr>(
        &self,
        name: &str,
        count: usize,
        what: &str,
    ) -> Result<Option<Vec<T>>> {
        match self.numbers::<T>(name, what)? {
            Some(numbers) if numbers.len() != count => {
                Err(bad(self.path, name, format!("{} numbers, expected {count}", numbers.len())))
            }
            numbers => Ok(numbers),
        }
    }

    /// Exactly `N` numbers.
    pub(crate) fn array<T: std::str::FromStr, const N: usize>(
        &self,
        name: &str,
        what: &str,
    ) -> Result<Option<[T; N]>> {
        Ok(self.list(name, N, what)?.and_then(|numbers| numbers.try_into().ok()))
    }
}

/// The data files that a header names: one, `LIST [n]` with `rest` as names, or a pattern `slice%03d.raw min max step
/// [n]`. Each holds an `n`-dimensional piece of the array of `sizes` (default: one dimension less).
///
/// Names are relative to the header's folder.
pub(crate) fn data_files(
    path: &Path,
    field: &str,
    value: &str,
    rest: &[String],
    sizes: &[u64],
) -> Result<Parts> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let words: Vec<&str> = value.split_whitespace().collect();
    let listed = || Parts::listed(folder, rest.to_vec());
    let (parts, piece): (Parts, Option<u64>) = match words.as_slice() {
        [] => return Err(bad(path, field, "empty, expected a file name, a pattern or LIST")),
        ["LIST"] => (listed(), None),
        // MetaIO writes the dimension as `2D`.
        ["LIST", n] if n.trim_end_matches('D').parse::<u64>().is_ok() => {
            (listed(), n.trim_end_matches('D').parse().ok())
        }
        [pattern, min, max, step, more @ ..] if pattern.contains('%') && more.len() <= 1 => {
            let piece = more.first().map(|n| n.parse());
            let (Ok(min), Ok(max), Ok(step), Ok(piece)) =
                (min.parse(), max.parse(), step.parse(), piece.transpose())
            else {
                let problem =
                    format!("{}, expected `pattern min max step` with whole numbers", quoted(value));
                return Err(bad(path, field, problem));
            };
            (Parts::numbered(folder, numbered(path, field, pattern, [min, max, step])?), piece)
        }
        _ => return Ok(Parts::one(folder.join(value), 0)),
    };
    let dimension = sizes.len() as u64;
    let piece = piece.unwrap_or(dimension - 1);
    if !(1..=dimension).contains(&piece) {
        return Err(bad(path, field, format!("pieces of dimension {piece}, expected 1 to {dimension}")));
    }
    // Pieces of full dimension are slabs along the slowest axis, however many.
    let slowest = sizes.last().copied().unwrap_or(1);
    let files = parts.len();
    let fits = if piece == dimension {
        files > 0 && slowest.is_multiple_of(files)
    } else {
        sizes[piece as usize..].iter().try_fold(1u64, |n, s| n.checked_mul(*s)) == Some(files)
    };
    if !fits || files == 0 {
        let problem = format!("{files} data files of dimension {piece} do not make up the sizes {sizes:?}");
        return Err(bad(path, field, problem));
    }
    Ok(parts)
}

/// Names of a pattern with one `%d`, `%3d` or `%03d` (also `i`, `u`; `%%` is a percent sign), from min to max.
fn numbered(path: &Path, field: &str, pattern: &str, [min, max, step]: [i64; 3]) -> Result<Numbers> {
    // i128, because the ends of i64 may be further apart than i64 reaches.
    let span = i128::from(max) - i128::from(min);
    if step == 0 || span.signum() * i128::from(step).signum() < 0 {
        return Err(bad(path, field, format!("{min} to {max} in steps of {step} never ends")));
    }
    let count = span / i128::from(step) + 1;
    let Some(count) = u64::try_from(count).ok().filter(|n| *n <= MAX_FILES) else {
        return Err(bad(path, field, format!("{count} data files, expected at most {MAX_FILES}")));
    };
    let Some((before, zeros, width, after)) = conversion(pattern) else {
        return Err(bad(path, field, format!("{}, expected one number such as %03d in it", quoted(pattern))));
    };
    Ok(Numbers { before, after, zeros, width, first: min, step, count })
}

/// Splits a pattern at its one number: text before, whether padded with zeros, width, text after.
fn conversion(pattern: &str) -> Option<(String, bool, usize, String)> {
    // `%%` is set aside as a character that no file name has.
    let text = pattern.replace("%%", "\0");
    let (before, rest) = text.split_once('%')?;
    let letter = rest.find(|c: char| !c.is_ascii_digit())?;
    let (digits, after) = rest.split_at(letter);
    let after = after.strip_prefix(['d', 'i', 'u'])?;
    if after.contains('%') || digits.len() > 2 {
        return None;
    }
    let percent = |s: &str| s.replace('\0', "%");
    let width = if digits.is_empty() { 0 } else { digits.parse().ok()? };
    Some((percent(before), digits.starts_with('0'), width, percent(after)))
}
