//! What can go wrong: with data, or on the device.

/// Result with the crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Every failure of the library. Messages name the setting, mesh, call or limit and what was expected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Data that cannot be worked with.
    #[error(transparent)]
    Model(#[from] cao_model::Error),
    /// The device failed, or would have.
    #[error(transparent)]
    Gpu(#[from] cao_gpu::Error),
}

impl Error {
    /// Whether the device is lost ([`cao_gpu::Error::device_lost`]).
    pub fn device_lost(&self) -> bool {
        matches!(self, Self::Gpu(error) if error.device_lost())
    }

    /// The refusal of the setting `what`.
    pub(crate) fn refused(what: &str, problem: impl Into<String>) -> Self {
        cao_model::Error::refused(what, problem).into()
    }
}
