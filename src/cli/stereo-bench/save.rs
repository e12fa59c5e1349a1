//! A run kept for later: raw numbers, the summary that was printed, and how to repeat it.

use super::machine;
use anyhow::Result;
use cao_cli::targets::Targets;
use cao_gpu::Gpu;
use cao_model::error::shown_path;
use std::path::Path;

/// The run's own folder in `parent`: `<date>-<device>`, with a number where that is taken; and the files in it.
pub fn targets(parent: &Path, gpu: &Gpu) -> Result<Targets> {
    let [year, month, day] = machine::today();
    let name = format!("{year:04}-{month:02}-{day:02}-{}", plain(&gpu.info().name));
    let mut folder = parent.join(&name);
    let mut number = 1;
    while folder.symlink_metadata().is_ok() {
        number += 1;
        folder = parent.join(format!("{name}-{number}"));
    }
    Targets::in_folder(&folder, ["raw.csv", "summary", "README.md"].map(str::to_owned))
}

/// What is in the files; `machine` describes it as the run began.
pub fn contents(gpu: &Gpu, machine: &str, csv: String, summary: String) -> [String; 3] {
    [csv, summary, readme(gpu, machine)]
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
    let arguments = std::env::args_os().skip(1).map(|argument| quoted(&shown_path(argument)));
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
