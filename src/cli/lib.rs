//! What the programs share: flags, what is printed, what is written, progress, how they end.

#![forbid(unsafe_code)]

pub mod args;
pub mod output;
pub mod targets;

use cao_model::error::shown;
use cao_model::error::shown_path;
use clap::{ArgMatches, Parser};
use std::io::{ErrorKind, Write, stdout};
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

/// The command line as it was understood and as it was typed; or the exit code, for whom only help was printed or what is wrong.
pub fn parse<C: Parser>() -> Result<(C, ArgMatches), ExitCode> {
    let matches = C::command().try_get_matches();
    let parsed = matches.and_then(|matches| Ok((C::from_arg_matches(&matches)?, matches)));
    parsed.map_err(|answer| {
        if answer.use_stderr() {
            // Clap shows words as they were typed.
            match std::env::args_os().any(|word| shown_path(&word) != word.to_string_lossy()) {
                true => say(&answer.render().to_string()),
                false => drop(answer.print()),
            }
            return ExitCode::from(USAGE);
        }
        let printed = answer.print().and_then(|()| stdout().flush());
        match printed {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => {
                let program = C::command().get_name().to_owned();
                say(&format!("{program}: cannot write to standard output: {error}"));
                ExitCode::FAILURE
            }
            _ => ExitCode::SUCCESS,
        }
    })
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
