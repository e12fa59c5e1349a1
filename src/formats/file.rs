//! Opening files that others name: regular files only, and no more of them than is stated. What is not one is refused without
//! waiting for it: a pipe would block until somebody writes, a device may have no end.

use crate::{Error, Result, input};
use std::fs::{File, FileType, Metadata, OpenOptions};
use std::io::{self, Read};
use std::path::Path;

/// Longest text of a scene, a transfer function or a table of numbers. None is nearly this long.
pub const MAX_TEXT_BYTES: u64 = 4 << 20;

/// A regular file that is read, and its length in bytes. Links are followed.
pub(crate) fn open(path: &Path) -> io::Result<(File, u64)> {
    let (file, metadata) = regular(path)?;
    input::remember(path, &metadata)?;
    Ok((file, metadata.len()))
}

/// A regular file that is only looked at.
pub(crate) fn regular(path: &Path) -> io::Result<(File, Metadata)> {
    // Looked at before, because opening alone makes some devices do something; and after, because a name can change its file.
    check(std::fs::metadata(path)?.file_type())?;
    let mut options = OpenOptions::new();
    options.read(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, libc::O_NONBLOCK);
    let file = options.open(path)?;
    let metadata = file.metadata()?;
    check(metadata.file_type())?;
    Ok((file, metadata))
}

/// Everything in a regular file of at most `most` bytes.
///
/// # Errors
/// [`Error::Io`] when it cannot be read, [`Error::File`] when it is longer.
pub fn read_bytes(path: &Path, most: u64) -> Result<Vec<u8>> {
    let (file, length) = open(path).map_err(Error::io(path))?;
    let mut bytes = Vec::new();
    if length <= most {
        // The length is only what it was a moment ago.
        file.take(most + 1).read_to_end(&mut bytes).map_err(Error::io(path))?;
    }
    match length.max(bytes.len() as u64) {
        long if long > most => {
            Err(Error::file(path, "size", format!("{long} bytes, expected at most {most}")))
        }
        _ => Ok(bytes),
    }
}

/// The text in a regular file of at most [`MAX_TEXT_BYTES`].
///
/// # Errors
/// As [`read_bytes`]; [`Error::File`] also when it is not UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    String::from_utf8(read_bytes(path, MAX_TEXT_BYTES)?).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        Error::file(path, "text", format!("byte {at} is not UTF-8, expected text in UTF-8"))
    })
}

fn check(kind: FileType) -> io::Result<()> {
    if kind.is_file() {
        return Ok(());
    }
    Err(io::Error::other(format!("not a regular file but {}", name(kind))))
}

fn name(kind: FileType) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kinds = [
            (kind.is_fifo(), "a pipe"),
            (kind.is_socket(), "a socket"),
            (kind.is_char_device() || kind.is_block_device(), "a device"),
        ];
        if let Some((_, name)) = kinds.into_iter().find(|(is, _)| *is) {
            return name;
        }
    }
    if kind.is_dir() { "a folder" } else { "something else" }
}
