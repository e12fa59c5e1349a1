//! Files that the programs write: refused before the work where they cannot be written or would replace what was read; then all of them
//! are written or none.

use super::args::usage;
use anyhow::{Context, Result};
use cao_formats::{Outputs, input};
use cao_model::error::shown_path;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag::{register_conditional_default, register_usize};
use signal_hook::low_level::emulate_default_handler;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// What a program is to write.
pub struct Targets {
    files: Vec<PathBuf>,
    /// Folders to be made first, the innermost first.
    folders: Vec<PathBuf>,
}

impl Targets {
    /// Files whose names the user gave, if with an extension then with this one.
    ///
    /// # Errors
    /// A name that cannot be written, or not in this format, or twice.
    pub fn files<'a>(files: impl IntoIterator<Item = &'a PathBuf>, extension: &str) -> Result<Self> {
        let files: Vec<PathBuf> = files.into_iter().cloned().collect();
        let mut taken = Vec::new();
        for file in &files {
            let shown = shown_path(file);
            if file.file_name().is_none() {
                return Err(usage(format!("{shown}: expected the name of a file to write")));
            }
            if file.extension().is_some_and(|found| !found.eq_ignore_ascii_case(extension)) {
                return Err(usage(format!(
                    "{shown}: expected a name that ends in .{extension}, the format written"
                )));
            }
            let place = Outputs::check(file)?;
            if taken.contains(&place) {
                return Err(usage(format!("{shown}: would be written twice; expected different names")));
            }
            taken.push(place);
        }
        Ok(Self { files, folders: Vec::new() })
    }

    /// Files of these names in a folder, which is made, with those around it, where there is none.
    ///
    /// # Errors
    /// A file that cannot be written, or a folder that cannot be made.
    pub fn in_folder(folder: &Path, names: impl IntoIterator<Item = String>) -> Result<Self> {
        let there = |folder: &Path| folder.symlink_metadata().is_ok();
        let is_missing = |folder: &&Path| **folder != *"" && !there(folder);
        let folders: Vec<PathBuf> =
            folder.ancestors().take_while(is_missing).map(Path::to_path_buf).collect();
        let files: Vec<PathBuf> = names.into_iter().map(|name| folder.join(name)).collect();
        match folders.last() {
            // Where a file can be written, a folder can.
            Some(outermost) => drop(Outputs::check(outermost)?),
            None if !folder.is_dir() => {
                return Err(usage(format!("{}: is a file, expected a folder", shown_path(folder))));
            }
            None => files.iter().try_for_each(|file| Outputs::check(file).map(drop))?,
        }
        Ok(Self { files, folders })
    }

    /// These and others, together.
    pub fn and(mut self, others: Self) -> Self {
        self.files.extend(others.files);
        self.folders.extend(others.folders);
        self
    }

    /// The files.
    pub fn paths(&self) -> &[PathBuf] {
        &self.files
    }

    /// Refuses to replace a file that was read, whatever its name: when all has been read and the work is about to begin.
    ///
    /// # Errors
    /// The first such file.
    pub fn spare_inputs(&self) -> Result<()> {
        match self.files.iter().find(|file| input::was_read(file)) {
            Some(file) => {
                Err(usage(format!("{}: would replace an input; expected another name", shown_path(file))))
            }
            None => Ok(()),
        }
    }

    /// Writes all files or, where anything fails, none. A signal ends the program when what was begun is gone; once the files get their
    /// names, all get them.
    ///
    /// # Errors
    /// Those of `fill`; a file that cannot be written, or that is an input by now.
    pub fn write(&self, fill: impl FnOnce(&mut Outputs) -> Result<()>) -> Result<()> {
        let held = Held::begin()?;
        let written = self.make_folders().and_then(|()| {
            let mut outputs = Outputs::until(|| CAUGHT.load(Ordering::SeqCst) != 0);
            fill(&mut outputs)?;
            self.spare_inputs()?;
            Ok(outputs.commit()?)
        });
        if written.is_err() {
            // Those that are empty; a failure to tidy up hides no other.
            self.folders.iter().for_each(|folder| drop(std::fs::remove_dir(folder)));
            held.obey()?;
        }
        written
    }

    /// As [`Targets::write`], a content a file.
    ///
    /// # Errors
    /// As [`Targets::write`].
    pub fn write_all(&self, contents: &[impl AsRef<[u8]>]) -> Result<()> {
        self.write(|outputs| {
            let mut files = self.files.iter().zip(contents);
            files.try_for_each(|(path, content)| {
                Ok(outputs.write(path, |file| file.write_all(content.as_ref()))?)
            })
        })
    }

    fn make_folders(&self) -> Result<()> {
        let Some(folder) = self.folders.first() else { return Ok(()) };
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", shown_path(folder)))
    }
}

/// Signals that end a program, unless it does something about them.
const ENDING: &[i32] = &[
    #[cfg(unix)]
    signal_hook::consts::SIGHUP,
    SIGINT,
    SIGTERM,
];

/// The one that came while they were held.
static CAUGHT: AtomicUsize = AtomicUsize::new(0);
/// Whether they end this program.
static END: AtomicBool = AtomicBool::new(true);

/// While this lives, signals that end a program do not: they are remembered.
struct Held;

impl Held {
    fn begin() -> Result<Self> {
        END.store(false, Ordering::SeqCst);
        CAUGHT.store(0, Ordering::SeqCst);
        let held = Self;
        for signal in heard() {
            register_usize(signal, &CAUGHT, signal as usize)?;
            register_conditional_default(signal, &END)?;
        }
        Ok(held)
    }

    /// Ends the program as the signal would have, if there was one.
    fn obey(self) -> Result<()> {
        match CAUGHT.load(Ordering::SeqCst) {
            0 => Ok(()),
            signal => Ok(emulate_default_handler(signal as i32)?),
        }
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        END.store(true, Ordering::SeqCst);
    }
}

/// Those that are not to be ignored, as `nohup` and shells ask of what they start.
fn heard() -> impl Iterator<Item = i32> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    // A bit for each signal, from 1.
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok()).unwrap_or(0);
    ENDING.iter().copied().filter(move |signal| ignored >> (signal - 1) & 1 == 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use signal_hook::low_level::raise;

    /// Without it the test program dies.
    #[test]
    fn signals_are_held_and_remembered() {
        let _held = Held::begin().unwrap();
        for signal in heard() {
            raise(signal).unwrap();
            assert_eq!(CAUGHT.load(Ordering::SeqCst), signal as usize);
        }
    }
}
