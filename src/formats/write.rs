//! Output files: whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::{Error, Result};
use cao_model::order::Layout;
use cao_model::volume::{IDENTITY, Space, Volume};

/// Writes one value a voxel of `like` as a NRRD file: 32-bit float, raw, little-endian, x fastest. The file has the order of
/// voxels, the dimensions and the spacing of the one that `like` was read from, and its origin, directions and space if it
/// has any, so that it lies on that file in every program. `content` becomes the field of that name.
///
/// Errors: [`cao_model::Error::Config`] when `data` has not `like.len()` values; [`Error::Io`] as [`write_atomic`].
pub fn write_nrrd(path: &Path, like: &Volume, data: &[f32], content: &str) -> Result<()> {
    if data.len() != like.len() {
        let problem = format!("{} values, expected {} as the volume has voxels", data.len(), like.len());
        return Err(Error::refused(&format!("values for {}", path.display()), problem));
    }
    write_atomic(path, |out| {
        out.write_all(header(like, content).as_bytes())?;
        const PIECE: usize = 1 << 16;
        let mut bytes = Vec::with_capacity(PIECE);
        like.stored_places().try_for_each(|place| {
            bytes.extend(data[place].to_le_bytes());
            if bytes.len() == PIECE {
                out.write_all(&bytes)?;
                bytes.clear();
            }
            Ok::<_, io::Error>(())
        })?;
        out.write_all(&bytes)
    })
}

fn header(like: &Volume, content: &str) -> String {
    let Layout { dims: [x, y, z], spacing, origin, directions } = like.stored_layout();
    let mut text = String::from("NRRD0004\n");
    // A line end would end the field, and an empty line the header.
    let content = content.split_whitespace().collect::<Vec<_>>().join(" ");
    if !content.is_empty() {
        text += &format!("content: {content}\n");
    }
    text += &format!("type: float\ndimension: 3\nsizes: {x} {y} {z}\n");
    let placed = like.space != Space::Unknown || origin != [0.0; 3] || directions != IDENTITY;
    if placed {
        // `space` must stand before the fields that use it.
        text += match like.space {
            Space::Ras => "space: right-anterior-superior\n",
            Space::Unknown => "space dimension: 3\n",
        };
        let axis = |a: usize| vector(directions[a].map(|d| d * spacing[a]));
        text += &format!("space directions: {} {} {}\n", axis(0), axis(1), axis(2));
        text += &format!("space origin: {}\n", vector(origin));
    } else {
        let [x, y, z] = spacing;
        text += &format!("spacings: {x} {y} {z}\n");
    }
    text + "kinds: domain domain domain\nendian: little\nencoding: raw\n\n"
}

fn vector([x, y, z]: [f64; 3]) -> String {
    format!("({x},{y},{z})")
}

/// Writes a file through `fill` into a temporary file of the same folder and then renames it: `path` has the old
/// content or all of the new, and nothing is left behind when `fill` or the system fails.
///
/// Errors: [`Error::Io`] naming `path`; also when `path` exists and is not a regular file.
pub fn write_atomic(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    replace(path, fill).map_err(|source| Error::Io { path: path.into(), source })
}

fn replace(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    // Through links, so that the file they lead to is replaced and not the link.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let name = target.file_name().ok_or_else(|| io::Error::other("not the name of a file"))?;
    if fs::metadata(&target).is_ok_and(|m| !m.is_file()) {
        return Err(io::Error::other("exists and is not a regular file"));
    }
    // Unique among processes and among this process's threads.
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let mut temporary = std::ffi::OsString::from(".");
    temporary.push(name);
    temporary.push(format!(".{}-{}.part", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed)));
    let temporary = Temporary(target.with_file_name(temporary));
    let file = OpenOptions::new().write(true).create_new(true).open(&temporary.0)?;
    let mut out = BufWriter::with_capacity(1 << 16, file);
    fill(&mut out)?;
    out.into_inner().map_err(|e| e.into_error()).map(drop::<File>)?;
    fs::rename(&temporary.0, &target)
}

/// Removes the file when dropped, also while a panic unwinds; after the rename there is none to remove.
struct Temporary(PathBuf);

impl Drop for Temporary {
    fn drop(&mut self) {
        // Nothing can be done about a failure here, and the one that led here is reported.
        let _ = fs::remove_file(&self.0);
    }
}
