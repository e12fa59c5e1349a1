//! What the programs share: flags, what is printed, progress, how they end.

#![forbid(unsafe_code)]

pub mod args;
pub mod output;

use std::process::ExitCode;

/// Exit code for a wrong command line, as clap's own.
const USAGE: u8 = 2;

/// The exit code of a program; what went wrong is printed once, after the program's name.
pub fn end(program: &str, outcome: anyhow::Result<ExitCode>) -> ExitCode {
    outcome.unwrap_or_else(|error| {
        eprintln!("{program}: {error:#}");
        match error.is::<args::Usage>() {
            true => ExitCode::from(USAGE),
            false => ExitCode::FAILURE,
        }
    })
}
