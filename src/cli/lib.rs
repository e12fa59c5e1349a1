//! What the programs share: flags, what is printed, progress, how they end.

#![forbid(unsafe_code)]

pub mod args;
pub mod output;

use cao_model::error::shown;
use std::io::Write;
use std::process::ExitCode;

/// Exit code for a wrong command line, as clap's own.
const USAGE: u8 = 2;

/// Text for a terminal: line ends stay, whatever else commands it is escaped.
pub fn harmless(text: &str) -> String {
    text.split('\n').map(|line| shown(line, usize::MAX)).collect::<Vec<_>>().join("\n")
}

/// A message on standard error. Where that cannot be written to, nobody can be told.
pub fn say(message: &str) {
    let _ = writeln!(std::io::stderr(), "{}", harmless(message));
}

/// The exit code of a program; what went wrong is printed once, after the program's name.
pub fn end(program: &str, outcome: anyhow::Result<ExitCode>) -> ExitCode {
    outcome.unwrap_or_else(|error| {
        say(&format!("{program}: {error:#}"));
        match error.is::<args::Usage>() {
            true => ExitCode::from(USAGE),
            false => ExitCode::FAILURE,
        }
    })
}
