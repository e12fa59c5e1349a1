//! Output files: all of them whole, or none of them.
//!
//! Content goes into files without a name where the system has such (Linux, most file systems): nothing stays behind, however the program
//! ends. Elsewhere it goes into files with random names, which a program leaves that ends without dropping them. The files' own names come
//! last.

use std::fs::OpenOptions;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::{Error, Result};
use atomic_write_file::AtomicWriteFile;
use cao_model::error::shown_path;

/// A file on its way. What goes wrong is an error of the system, without the file's name.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    out: BufWriter<Stoppable>,
}

impl Output {
    /// The name that it is to have.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// Files that are written together.
#[derive(Debug)]
pub struct Outputs {
    files: Vec<(PathBuf, AtomicWriteFile)>,
    stop: fn() -> bool,
}

impl Default for Outputs {
    fn default() -> Self {
        Self::until(|| false)
    }
}

impl Outputs {
    /// Writing fails from the moment that `stop` says so: a program that is to end can drop its files before it does.
    pub fn until(stop: fn() -> bool) -> Self {
        Self { files: Vec::new(), stop }
    }

    /// Finds out, by trying and without leaving a trace, whether a file of this name can be written; says where it will be, links followed.
    ///
    /// # Errors
    /// [`Error::Io`] naming `path`: there is no such folder, the name is too long or that of something other than a file, or the system
    /// does not permit it.
    pub fn check(path: &Path) -> Result<PathBuf> {
        let check = || {
            let place = place(path)?;
            if place.exists() {
                // Who may not write into a file may often replace it all the same; its owner did not mean that.
                OpenOptions::new().append(true).open(&place)?;
            }
            // As long as the longest name that it has on the way.
            let mut longest = place.file_name().unwrap_or_default().to_owned();
            longest.push("........");
            match place.with_file_name(longest).symlink_metadata() {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => AtomicWriteFile::open(&place)?.discard()?,
            }
            Ok(place)
        };
        check().map_err(Error::io(path))
    }

    /// Writes a file's content through `fill`; it gets its name in [`Outputs::commit`]. Where a file of this name is, the new one will have
    /// its mode.
    ///
    /// # Errors
    /// [`Error::Io`] naming `path`; also when it exists and is not a regular file.
    pub fn write(&mut self, path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
        let mut output = self.open(path)?;
        fill(&mut output).map_err(Error::io(path))?;
        self.keep(output)
    }

    /// Begins a file, for who writes several at a time; [`Outputs::keep`] takes it when it is complete.
    ///
    /// # Errors
    /// As [`Outputs::write`].
    pub fn open(&self, path: &Path) -> Result<Output> {
        let open = || AtomicWriteFile::open(place(path)?);
        let file = open().map_err(Error::io(path))?;
        let out = BufWriter::with_capacity(1 << 16, Stoppable { file, stop: self.stop });
        Ok(Output { path: path.into(), out })
    }

    /// Takes a complete file; it gets its name in [`Outputs::commit`].
    ///
    /// # Errors
    /// As [`Outputs::write`].
    pub fn keep(&mut self, Output { path, out }: Output) -> Result<()> {
        let written = out.into_inner().map_err(|error| error.into_error()).map_err(Error::io(&path))?;
        self.files.push((path, written.file));
        Ok(())
    }

    /// Refuses to go on from the moment that writing fails: between long pieces of work.
    ///
    /// # Errors
    /// That it was interrupted.
    pub fn go_on(&self) -> io::Result<()> {
        match (self.stop)() {
            true => Err(io::Error::other("interrupted")),
            false => Ok(()),
        }
    }

    /// Gives all files their names. Everything that takes room on the disk has happened before the first has its own.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file.
    pub fn commit(self) -> Result<()> {
        for (path, file) in &self.files {
            // Some file systems notice only now that they are full.
            file.sync_all().and_then(|()| place(path)).map_err(Error::io(path))?;
        }
        for (path, file) in self.files {
            file.commit().map_err(Error::io(&path))?;
        }
        Ok(())
    }
}

#[derive(Debug)]
struct Stoppable {
    file: AtomicWriteFile,
    stop: fn() -> bool,
}

impl Write for Stoppable {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match (self.stop)() {
            true => Err(io::Error::other("interrupted")),
            false => self.file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// The place that a name stands for: through links, so that the file they lead to is replaced and not the link.
fn place(path: &Path) -> io::Result<PathBuf> {
    let not_there = |error: &io::Error| error.kind() == io::ErrorKind::NotFound;
    match path.symlink_metadata() {
        Ok(_) => {
            let real = path.canonicalize().map_err(|error| match not_there(&error) {
                true => io::Error::other("is a link to a file that is not there"),
                false => error,
            })?;
            let meta = real.metadata()?;
            if meta.is_dir() {
                return Err(io::Error::other("is a folder, not a regular file"));
            }
            if !meta.is_file() {
                return Err(io::Error::other("is a device, a pipe or a socket, not a regular file"));
            }
            Ok(real)
        }
        Err(error) if not_there(&error) => {
            let name = path.file_name().ok_or_else(|| io::Error::other("is not the name of a file"))?;
            let folder = path.parent().filter(|folder| *folder != "").unwrap_or(Path::new("."));
            let real = folder.canonicalize().map_err(|error| match not_there(&error) {
                true => io::Error::other(format!("there is no folder {}", shown_path(folder))),
                false => error,
            })?;
            Ok(real.join(name))
        }
        Err(error) => Err(error),
    }
}

/// Writes one file through `fill`: `path` has the old content or all of the new, and nothing is left behind when `fill` or the system fails.
///
/// # Errors
/// As [`Outputs::write`].
pub fn write_atomic(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let mut outputs = Outputs::default();
    outputs.write(path, fill)?;
    outputs.commit()
}
