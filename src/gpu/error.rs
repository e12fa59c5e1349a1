//! What can go wrong on a device, said so that the user knows what to do next.

/// Result with the crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A failure of the device, or a use of it that would be one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A use that cannot be honoured.
    #[error("{what}: {problem}")]
    Config {
        /// What was asked for.
        what: String,
        /// What was found and what was expected.
        problem: String,
    },
    /// A Vulkan call failed.
    #[error("{call} failed for {object}: {result}")]
    Vulkan {
        /// The Vulkan function.
        call: &'static str,
        /// Name of the object concerned.
        object: String,
        /// The driver's answer.
        result: ash::vk::Result,
    },
    /// Device memory could not be had.
    #[error("cannot allocate {bytes} bytes of device memory for {object}: {problem}")]
    Memory {
        /// Name of the object concerned.
        object: String,
        /// Size asked for.
        bytes: u64,
        /// The allocator's reason.
        problem: String,
    },
    /// No usable device, or the device lacks something.
    #[error("{problem}")]
    Device {
        /// What is missing and how to get it.
        problem: String,
    },
    /// A size is beyond a limit of the device.
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
    /// Commands were recorded without the barrier that orders them (see [`hazard`](crate::hazard)).
    #[error("missing barrier: {problem}")]
    Hazard {
        /// Both accesses and the resource.
        problem: String,
    },
}

impl Error {
    /// Whether the device is lost. Nothing comes back from it: drop all that was made with it, and make it, or have the host make it, anew.
    pub fn device_lost(&self) -> bool {
        matches!(self, Error::Vulkan { result: ash::vk::Result::ERROR_DEVICE_LOST, .. })
    }
}
