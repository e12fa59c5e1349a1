//! What is wrong with data, said so that the user knows what to do next.

/// Result with the crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Data that cannot be worked with. Messages name the setting, mesh or limit and what was expected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting that cannot be honoured.
    #[error("{what}: {problem}")]
    Config {
        /// Name of the setting as the user wrote it.
        what: String,
        /// What was found and what was expected.
        problem: String,
    },
    /// A triangle mesh that cannot serve as a clip shape.
    #[error("mesh {name}: {problem}")]
    Mesh {
        /// Name of the mesh (its file).
        name: String,
        /// What was found, where, and what would help.
        problem: String,
    },
    /// A size is beyond a limit of the program.
    #[error("{what}: needs {needed}, the limit is {limit}; {hint}")]
    Limit {
        /// What is too large.
        what: String,
        /// Needed size.
        needed: u64,
        /// The limit.
        limit: u64,
        /// What the user can do.
        hint: String,
    },
}

impl Error {
    /// The refusal of the setting `what`.
    pub fn refused(what: &str, problem: impl Into<String>) -> Self {
        Self::Config { what: what.into(), problem: problem.into() }
    }

    /// The same refusal of a setting that is part of `section`.
    pub fn under(self, section: &str) -> Self {
        match self {
            Self::Config { what, problem } => Self::Config { what: format!("{section}.{what}"), problem },
            other => other,
        }
    }
}
