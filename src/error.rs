//! What can go wrong, said so that the user knows what to do next.

use std::path::PathBuf;

/// Result with the crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Every failure of the library. Messages name the file, field, call or limit and what was expected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused a file.
    #[error("cannot access {}", path.display())]
    Io {
        /// File that was read or written.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file's content is not what its format or its header says.
    #[error("{}: {field}: {problem}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Header field, key or part of the file.
        field: String,
        /// What was found and what was expected.
        problem: String,
    },
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
    /// A size is beyond a limit of the device or of the program.
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
    /// Commands were recorded without the barrier that orders them (see `gpu::hazard`).
    #[error("missing barrier: {problem}")]
    Hazard {
        /// Both accesses and the resource.
        problem: String,
    },
}
