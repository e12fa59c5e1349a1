//! A run kept for later: raw numbers, the summary that was printed, and how to repeat it.

use super::machine;
use anyhow::{Context, Result};
use cao_gpu::Gpu;
use std::fs;
use std::path::{Path, PathBuf};

/// A run's own folder.
pub struct Folder(PathBuf);

impl Folder {
    /// Makes it in `parent`: `<date>-<device>`, with a number where that is taken. Before anything long begins, so that what cannot
    /// be written is known early.
    pub fn new(parent: &Path, gpu: &Gpu) -> Result<Self> {
        let [year, month, day] = machine::today();
        let name = format!("{year:04}-{month:02}-{day:02}-{}", plain(&gpu.info().name));
        fs::create_dir_all(parent).with_context(|| format!("cannot make the folder {}", parent.display()))?;
        let mut path = parent.join(&name);
        let mut number = 1;
        loop {
            match fs::create_dir(&path) {
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
                    number += 1;
                    path = parent.join(format!("{name}-{number}"));
                }
                made => {
                    made.with_context(|| format!("cannot make the folder {}", path.display()))?;
                    return Ok(Self(path));
                }
            }
        }
    }

    /// Writes the three files and returns their paths; `machine` describes it as the run began.
    pub fn write(&self, gpu: &Gpu, machine: &str, csv: &str, summary: &str) -> Result<Vec<PathBuf>> {
        let files = [
            ("raw.csv", csv.to_owned()),
            ("summary", summary.to_owned()),
            ("README.md", readme(gpu, machine)),
        ];
        files
            .into_iter()
            .map(|(name, text)| {
                let path = self.0.join(name);
                fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
                Ok(path)
            })
            .collect()
    }
}

impl Drop for Folder {
    /// A run that failed leaves no empty folder; one that holds anything cannot be removed so.
    fn drop(&mut self) {
        let _ = fs::remove_dir(&self.0);
    }
}

fn readme(gpu: &Gpu, machine: &str) -> String {
    let info = gpu.info();
    let [major, minor, patch] = info.api_version;
    let [year, month, day] = machine::today();
    format!(
        "# {} on {year:04}-{month:02}-{day:02}\n\n\
         ```sh\n{}\n```\n\n\
         | | |\n|---|---|\n\
         | program | stereo-bench of cao {} |\n\
         | device | {} |\n\
         | driver | {}, Vulkan {major}.{minor}.{patch} |\n\
         | machine | {} |\n\n\
         `summary` is what was printed, `raw.csv` every frame that counts: times in ms, runs from 1, frames from 0. What a frame is, and the\n\
         path of head and clip, is in `stereo-bench --help`. Times of a busy machine or a software driver are good for ratios only; what is\n\
         compared took turns, frame by frame.\n",
        info.name,
        command(),
        env!("CARGO_PKG_VERSION"),
        info.name,
        info.driver,
        machine,
    )
}

/// The command line as a shell takes it, with the environment that changes what it does.
fn command() -> String {
    let environment = ["CAO_DEVICE", "CAO_VALIDATION"].into_iter().filter_map(|key| {
        let value = std::env::var(key).ok().filter(|value| !value.is_empty())?;
        Some(format!("{key}={}", quoted(&value)))
    });
    let arguments = std::env::args().skip(1).map(|argument| quoted(&argument));
    environment.chain(["stereo-bench".into()]).chain(arguments).collect::<Vec<_>>().join(" ")
}

/// A word of a shell's command.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./:,=+%@".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// The device's name as part of a file name: letters and digits up to the first parenthesis, the rest dashes.
fn plain(name: &str) -> String {
    let name = name.split('(').next().unwrap_or_default().to_lowercase();
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    match words.collect::<Vec<_>>().join("-") {
        words if words.is_empty() => "device".into(),
        words => words,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_devices_become_names_of_folders() {
        assert_eq!(plain("llvmpipe (LLVM 15.0.6, 256 bits)"), "llvmpipe");
        assert_eq!(plain("NVIDIA H100 80GB HBM3"), "nvidia-h100-80gb-hbm3");
        assert_eq!(plain("(?)"), "device");
    }

    #[test]
    fn words_survive_a_shell() {
        assert_eq!(quoted("--size"), "--size");
        assert_eq!(quoted("my head.nrrd"), "'my head.nrrd'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
    }
}
