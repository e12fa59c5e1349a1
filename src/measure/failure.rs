//! What can go wrong while measuring.

/// Result with the crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A measurement that could not be made or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The renderer refused or failed.
    #[error(transparent)]
    Cao(#[from] cao::Error),
    /// A file could not be read or written.
    #[error(transparent)]
    Formats(#[from] cao_formats::Error),
}

impl From<cao_model::Error> for Error {
    fn from(error: cao_model::Error) -> Self {
        Self::Cao(error.into())
    }
}

impl From<cao_gpu::Error> for Error {
    fn from(error: cao_gpu::Error) -> Self {
        Self::Cao(error.into())
    }
}

impl Error {
    /// The refusal of the setting `what`.
    pub(crate) fn refused(what: &str, problem: impl Into<String>) -> Self {
        cao_model::Error::refused(what, problem).into()
    }

    /// What is wrong with the data, where that is what went wrong.
    pub(crate) fn of_data(&self) -> Option<&cao_model::Error> {
        match self {
            Self::Cao(cao::Error::Model(error)) | Self::Formats(cao_formats::Error::Model(error)) => {
                Some(error)
            }
            _ => None,
        }
    }
}
