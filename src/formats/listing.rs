//! Files of a folder or of a pattern, in the order in which people number them.

use std::cmp::Ordering;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::volume::bad;
use crate::{Error, Result, file};

/// Folders within folders that are looked into.
const MAX_DEPTH: usize = 8;
/// Files of a folder: more than any scan has.
const MAX_FILES: usize = 100_000;
/// Enough of a file to know its format.
const HEAD_BYTES: u64 = 4096;

/// The beginning of a file, which only looks at it: whether it is read at all, that decides.
pub(crate) fn head(path: &Path) -> Result<Vec<u8>> {
    let mut head = Vec::new();
    let (file, _) = file::regular(path).map_err(Error::io(path))?;
    file.take(HEAD_BYTES).read_to_end(&mut head).map_err(Error::io(path))?;
    Ok(head)
}

/// All regular files of a folder and of the folders in it; hidden ones are left out.
pub(crate) fn folder(path: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    collect(path, MAX_DEPTH, &mut files)?;
    files.sort_by(|a, b| natural(a, b));
    Ok(files)
}

/// Regular files of this very folder.
pub(crate) fn beside(path: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    collect(path, 0, &mut files)?;
    files.sort_by(|a, b| natural(a, b));
    Ok(files)
}

fn collect(path: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<()> {
    for entry in fs::read_dir(path).map_err(Error::io(path))? {
        let entry = entry.map_err(Error::io(path))?;
        if entry.file_name().as_encoded_bytes().starts_with(b".") {
            continue;
        }
        let path = entry.path();
        // Of links what they point at; one that points at nothing is passed over.
        let Ok(meta) = fs::metadata(&path) else { continue };
        if meta.is_dir() && depth > 0 {
            collect(&path, depth - 1, files)?;
        } else if meta.is_file() {
            if files.len() == MAX_FILES {
                return Err(bad(
                    &path,
                    "files",
                    format!("the folder has more than {MAX_FILES}, expected fewer"),
                ));
            }
            files.push(path);
        }
    }
    Ok(())
}

/// Whether a path that is no file names several: `*` and `?` in its last part.
pub(crate) fn is_pattern(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().as_encoded_bytes();
    name.iter().any(|b| matches!(b, b'*' | b'?')) && !path.exists()
}

/// Files whose names fit a pattern.
pub(crate) fn matching(pattern: &Path) -> Result<Vec<PathBuf>> {
    let folder = pattern.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let wanted = pattern.file_name().unwrap_or_default().as_encoded_bytes();
    let mut files = beside(folder)?;
    files.retain(|file| fits(wanted, file.file_name().unwrap_or_default().as_encoded_bytes()));
    Ok(files)
}

/// Whether a name fits a pattern of `*` (anything) and `?` (one byte).
fn fits(pattern: &[u8], name: &[u8]) -> bool {
    let (mut p, mut n) = (0, 0);
    // Where the last star was, and where what it stands for ends so far.
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        match pattern.get(p) {
            Some(b'*') => {
                star = Some((p, n));
                p += 1;
            }
            Some(b) if *b == b'?' || *b == name[n] => {
                p += 1;
                n += 1;
            }
            _ => {
                let Some((at, end)) = star else { return false };
                star = Some((at, end + 1));
                (p, n) = (at + 1, end + 1);
            }
        }
    }
    pattern[p..].iter().all(|b| *b == b'*')
}

/// Order in which 9 comes before 10: runs of digits are compared as numbers.
fn natural(a: &Path, b: &Path) -> Ordering {
    let (mut x, mut y) = (a.as_os_str().as_encoded_bytes(), b.as_os_str().as_encoded_bytes());
    let digits = |s: &[u8]| s.iter().take_while(|c| c.is_ascii_digit()).count();
    loop {
        let (n, m) = (digits(x), digits(y));
        let order = if n > 0 && m > 0 {
            let number =
                |s: &[u8], n: usize| s[..n].iter().skip_while(|c| **c == b'0').copied().collect::<Vec<u8>>();
            let (p, q) = (number(x, n), number(y, m));
            (x, y) = (&x[n..], &y[m..]);
            p.len().cmp(&q.len()).then(p.cmp(&q))
        } else {
            match (x.split_first(), y.split_first()) {
                (Some((c, rest)), Some((d, other))) => {
                    (x, y) = (rest, other);
                    c.cmp(d)
                }
                // Equal as numbers: 01 and 1.
                (None, None) => return a.cmp(b),
                (c, d) => return c.is_some().cmp(&d.is_some()),
            }
        };
        if order != Ordering::Equal {
            return order;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_in_the_order_of_their_numbers() {
        let sorted = ["a/1", "a/2.tif", "a/02.tif", "a/10.tif", "a/10b", "a/b", "b/1"];
        for (i, x) in sorted.iter().enumerate() {
            for (j, y) in sorted.iter().enumerate() {
                // 02 and 2 are the same number: bytes decide.
                let expected = if (i, j) == (1, 2) {
                    Ordering::Greater
                } else if (i, j) == (2, 1) {
                    Ordering::Less
                } else {
                    i.cmp(&j)
                };
                assert_eq!(natural(Path::new(x), Path::new(y)), expected, "{x} {y}");
            }
        }
    }

    #[test]
    fn a_pattern_fits_whole_names() {
        for (pattern, name, expected) in [
            ("*.tif", "a.tif", true),
            ("*.tif", "a.tiff", false),
            ("s*_?.t*", "slice_1.tif", true),
            ("s*_?.t*", "slice_12.tif", false),
            ("*a*b", "xaxaxb", true),
            ("", "a", false),
            ("**", "", true),
        ] {
            assert_eq!(fits(pattern.as_bytes(), name.as_bytes()), expected, "{pattern} {name}");
        }
    }
}
