//! Files that are read: the one place that opens them, and remembers which they are.
//!
//! What a scene or a header names is read deep inside a reader, by names that the caller never sees. So that a program can spare all of
//! it, every file is remembered by identity, device and inode, whatever its name: links and other spellings are the same file.

use std::collections::BTreeSet;
use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

#[cfg(unix)]
type Identity = (u64, u64);
#[cfg(not(unix))]
type Identity = std::path::PathBuf;

static READ: Mutex<BTreeSet<Identity>> = Mutex::new(BTreeSet::new());

#[cfg(unix)]
fn identity(_: &Path, meta: &Metadata) -> io::Result<Identity> {
    use std::os::unix::fs::MetadataExt;
    Ok((meta.dev(), meta.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path, _: &Metadata) -> io::Result<Identity> {
    path.canonicalize()
}

/// Opens a file to read it; from then on [`was_read`] knows it.
///
/// # Errors
/// The system's.
pub fn open(path: &Path) -> io::Result<File> {
    let file = File::open(path)?;
    remember(path, &file.metadata()?)?;
    Ok(file)
}

fn remember(path: &Path, meta: &Metadata) -> io::Result<()> {
    let identity = identity(path, meta)?;
    READ.lock().unwrap_or_else(PoisonError::into_inner).insert(identity);
    Ok(())
}

/// All bytes of a file.
pub(crate) fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// All text of a file.
///
/// # Errors
/// The system's, or that the file is not UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    io::read_to_string(open(path)?)
}

/// Whether this process read the file through this crate, by this name or any other. A file that is not there was not.
pub fn was_read(path: &Path) -> bool {
    let identity = path.metadata().and_then(|meta| identity(path, &meta));
    identity.is_ok_and(|file| READ.lock().unwrap_or_else(PoisonError::into_inner).contains(&file))
}
