//! What can go wrong with a file, said so that the user knows what to do next.

use cao_model::error::{MOST_NAMED, MOST_SAID, shown, shown_path};
use std::path::{Path, PathBuf};

/// Result with the crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A file that cannot be read or written. Messages name the file, the field and what was expected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused a file.
    #[error("cannot access {}", shown_path(path))]
    Io {
        /// File that was read or written.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file's content is not what its format or its header says.
    #[error("{}: {}: {}", shown_path(path), shown(field, MOST_NAMED), shown(problem, MOST_SAID))]
    File {
        /// The file.
        path: PathBuf,
        /// Header field, key or part of the file.
        field: String,
        /// What was found and what was expected.
        problem: String,
    },
    /// A file or a folder has several of what only one can be used of.
    #[error(
        "{}: {}: {}{}",
        shown_path(path),
        shown(field, MOST_NAMED),
        shown(problem, MOST_SAID),
        listed(choices)
    )]
    Choice {
        /// The file or the folder.
        path: PathBuf,
        /// What is to be chosen.
        field: String,
        /// What was found and how to choose.
        problem: String,
        /// What there is, each a line of the message.
        choices: Vec<String>,
    },
    /// Data that cannot be worked with.
    #[error(transparent)]
    Model(#[from] cao_model::Error),
}

impl Error {
    /// The refusal of the setting `what`.
    pub(crate) fn refused(what: &str, problem: impl Into<String>) -> Self {
        cao_model::Error::refused(what, problem).into()
    }

    /// The refusal of what a file says in `field`.
    pub(crate) fn file(path: &Path, field: &str, problem: impl Into<String>) -> Self {
        Self::File { path: path.into(), field: field.into(), problem: problem.into() }
    }

    /// The same refusal of a setting that is part of `section`.
    pub(crate) fn under(self, section: &str) -> Self {
        match self {
            Self::Model(error) => error.under(section).into(),
            other => other,
        }
    }

    /// The same refusal of a setting, named as the user wrote it.
    pub(crate) fn renamed(self, what: &str) -> Self {
        match self {
            Self::Model(cao_model::Error::Config { problem, .. }) => Self::refused(what, problem),
            other => other,
        }
    }

    /// The same refusal of a setting, with the file that has it.
    pub(crate) fn in_file(self, path: &Path) -> Self {
        match self {
            Self::Model(cao_model::Error::Config { what, problem }) => {
                Self::File { path: path.into(), field: what, problem }
            }
            other => other,
        }
    }

    /// The system's refusal of a file.
    pub(crate) fn io(path: &Path) -> impl Fn(std::io::Error) -> Self + Copy + '_ {
        |source| Self::Io { path: path.into(), source }
    }
}

fn listed(choices: &[String]) -> String {
    choices.iter().map(|choice| format!("\n  {}", shown(choice, MOST_NAMED))).collect()
}
