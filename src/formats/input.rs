//! Which files were read.
//!
//! What a scene or a header names is read deep inside a reader, by names that the caller never sees. So that a program can spare all of
//! it, every file is remembered by identity, device and inode, whatever its name: links and other spellings are the same file.

use std::collections::BTreeSet;
use std::fs::Metadata;
use std::io;
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

/// Notes that a file is read; from then on [`was_read`] knows it.
///
/// # Errors
/// The system does not say which file it is.
pub(crate) fn remember(path: &Path, meta: &Metadata) -> io::Result<()> {
    let identity = identity(path, meta)?;
    READ.lock().unwrap_or_else(PoisonError::into_inner).insert(identity);
    Ok(())
}

/// Whether this process read the file through this crate, by this name or any other. A file that is not there was not.
pub fn was_read(path: &Path) -> bool {
    let identity = path.metadata().and_then(|meta| identity(path, &meta));
    identity.is_ok_and(|file| READ.lock().unwrap_or_else(PoisonError::into_inner).contains(&file))
}
