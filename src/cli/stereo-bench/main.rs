//! The program `stereo-bench`: what a frame costs, for one, two or four views, while head and clip move.
//!
//! A frame is what a host does for one: move the clips, record the update of the ambient volume and the drawing of all views into one
//! command buffer, submit it, wait. Every method has a renderer of its own and all take turns frame by frame (A B A B …) along the
//! same path ([`path`]), so that whatever slows the machine down slows all of them. Before each run a few frames are not counted. Times of stages
//! are GPU timestamps; the time of a frame is wall-clock time.

#![forbid(unsafe_code)]

mod args;
mod bars;
mod csv;
mod frames;
mod machine;
mod meshes;
mod networks;
mod path;
mod report;
mod save;
mod scale;
mod statistics;
mod suite;
mod way;

use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = match cao_cli::parse::<args::Cli>() {
        Ok((cli, _)) => cli,
        Err(code) => return code,
    };
    cao_cli::end("stereo-bench", if cli.bars.is_empty() { suite::run(&cli) } else { bars::run(&cli) })
}
