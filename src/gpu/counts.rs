//! How much is asked of Vulkan: what a frame costs the host.

use std::ops::{AddAssign, Sub};

/// Numbers of calls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Commands that do something: dispatches, draws, copies, fills, updates, clears.
    pub commands: u64,
    /// Barriers.
    pub barriers: u64,
    /// All calls that record: those two, pipelines, descriptors, immediates, timestamps and other state; labels excepted.
    pub calls: u64,
    /// Submissions to the own queue.
    pub submissions: u64,
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.commands += other.commands;
        self.barriers += other.barriers;
        self.calls += other.calls;
        self.submissions += other.submissions;
    }
}

impl Sub for Counts {
    type Output = Self;

    /// What was added since an earlier count.
    fn sub(self, earlier: Self) -> Self {
        Self {
            commands: self.commands - earlier.commands,
            barriers: self.barriers - earlier.barriers,
            calls: self.calls - earlier.calls,
            submissions: self.submissions - earlier.submissions,
        }
    }
}
