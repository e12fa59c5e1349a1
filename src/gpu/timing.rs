//! Stages of a recording: a label for debuggers and two timestamps each.

use super::{
    bind::Keep,
    device::{Inner, vulkan},
    idle::Idle,
};
use crate::{Error, Result};
use ash::vk;
use std::{ffi::CString, sync::Arc};

/// What a stage is for, in the order of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Phase {
    /// Made once for many frames.
    Prepare,
    /// Values to opacities.
    Opacity,
    /// Clips.
    Clip,
    /// Ambient occlusion.
    Ambient,
    /// Pictures.
    Draw,
}

impl Phase {
    /// Every phase.
    pub const ALL: [Self; 5] = [Self::Prepare, Self::Opacity, Self::Clip, Self::Ambient, Self::Draw];
}

/// A part of a frame whose time is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stage {
    /// What people read; programs go by the phase, or compare whole stages.
    pub name: &'static str,
    /// What it is for.
    pub phase: Phase,
}

impl Stage {
    /// A stage of this name and phase.
    pub const fn new(name: &'static str, phase: Phase) -> Self {
        Self { name, phase }
    }
}

/// Time of a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Which.
    pub stage: Stage,
    /// Milliseconds.
    pub ms: f64,
}

/// Time of each stage, in recording order; empty if the queue has no timestamps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timings(pub Vec<Timing>);

impl Timings {
    /// None.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a stage's time.
    pub fn push(&mut self, stage: Stage, ms: f64) {
        self.0.push(Timing { stage, ms });
    }

    /// Milliseconds of all stages.
    pub fn total(&self) -> f64 {
        self.iter().map(|timing| timing.ms).sum()
    }

    /// Milliseconds of the stages of a phase.
    pub fn of(&self, phase: Phase) -> f64 {
        self.iter().filter(|timing| timing.stage.phase == phase).map(|timing| timing.ms).sum()
    }
}

impl std::ops::Deref for Timings {
    type Target = [Timing];

    fn deref(&self) -> &[Timing] {
        &self.0
    }
}

impl<'a> IntoIterator for &'a Timings {
    type Item = &'a Timing;
    type IntoIter = std::slice::Iter<'a, Timing>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl IntoIterator for Timings {
    type Item = Timing;
    type IntoIter = std::vec::IntoIter<Timing>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl FromIterator<Timing> for Timings {
    fn from_iter<T: IntoIterator<Item = Timing>>(timings: T) -> Self {
        Self(timings.into_iter().collect())
    }
}

impl Extend<Timing> for Timings {
    fn extend<T: IntoIterator<Item = Timing>>(&mut self, timings: T) {
        self.0.extend(timings);
    }
}

/// Stages of one query pool; another pool is made when they are used up.
const STAGES_PER_POOL: u32 = 64;

/// Timestamps of one recording. Query `2i` is the begin, `2i + 1` the end of stage `i`.
pub(crate) struct Stages {
    gpu: Arc<Inner>,
    pools: Vec<vk::QueryPool>,
    stages: Vec<Stage>,
    /// Indices of the stages that have begun and not ended, innermost last.
    open: Vec<u32>,
}

impl Stages {
    pub fn new(gpu: Arc<Inner>) -> Self {
        Self { gpu, pools: Vec::new(), stages: Vec::new(), open: Vec::new() }
    }

    /// # Safety
    /// `cmd` must be recording, outside a rendering pass.
    pub unsafe fn begin(&mut self, cmd: vk::CommandBuffer, what: Stage) -> Result<()> {
        let (stage, name) = (self.stages.len() as u32, what.name);
        // SAFETY: the caller's promise; a pool is reset in the same command buffer before its first timestamp.
        unsafe {
            if self.gpu.timestamp_mask != 0 && stage.is_multiple_of(STAGES_PER_POOL) {
                let count = 2 * STAGES_PER_POOL;
                let pool = Idle::queries(&self.gpu, count, name)?;
                self.pools.push(pool);
                self.gpu.device.cmd_reset_query_pool(cmd, pool, 0, count);
            }
            if let (Some(debug), Ok(label)) = (&self.gpu.debug, CString::new(name)) {
                debug.cmd_begin_debug_utils_label(cmd, &vk::DebugUtilsLabelEXT::default().label_name(&label));
            }
            self.write(cmd, stage, 0);
        }
        self.stages.push(what);
        self.open.push(stage);
        Ok(())
    }

    /// # Safety
    /// `cmd` must be recording, outside a rendering pass.
    pub unsafe fn end(&mut self, cmd: vk::CommandBuffer) -> Result<()> {
        let stage = self.open.pop().ok_or_else(|| Error::Config {
            what: "end_stage".into(),
            problem: "no stage has begun".into(),
        })?;
        // SAFETY: the caller's promise.
        unsafe {
            self.write(cmd, stage, 1);
            // Begun with the same condition, except for names with a zero byte, whose label is missing.
            if let (Some(debug), Ok(_)) = (&self.gpu.debug, CString::new(self.stages[stage as usize].name)) {
                debug.cmd_end_debug_utils_label(cmd);
            }
        }
        Ok(())
    }

    unsafe fn write(&self, cmd: vk::CommandBuffer, stage: u32, which: u32) {
        if let Some(pool) = self.pools.get((stage / STAGES_PER_POOL) as usize) {
            let query = 2 * (stage % STAGES_PER_POOL) + which;
            // SAFETY: `cmd` is recording by the caller's promise, the pool has this query and it was reset.
            unsafe {
                (self.gpu.v13.cmd_write_timestamp2)(cmd, vk::PipelineStageFlags2::ALL_COMMANDS, *pool, query)
            };
        }
    }

    /// Refuses a recording with a stage that never ends.
    pub fn check_closed(&self) -> Result<()> {
        self.open.last().map_or(Ok(()), |stage| {
            Err(Error::Config {
                what: format!("stage {}", self.stages[*stage as usize].name),
                problem: "has no end_stage".into(),
            })
        })
    }

    /// Times of all stages, or `None` while the device has not finished.
    pub fn read(&self) -> Result<Option<Timings>> {
        let mut timings = Timings::new();
        for (pool, stages) in self.pools.iter().zip(self.stages.chunks(STAGES_PER_POOL as usize)) {
            let mut ticks = vec![[0u64; 2]; stages.len()];
            // SAFETY: the pool is alive, and as many queries as asked for were written.
            let result = unsafe {
                self.gpu.device.get_query_pool_results(
                    *pool,
                    0,
                    ticks.as_flattened_mut(),
                    vk::QueryResultFlags::TYPE_64,
                )
            };
            match result {
                Err(vk::Result::NOT_READY) => return Ok(None),
                other => other.map_err(vulkan("vkGetQueryPoolResults", stages[0].name))?,
            }
            for (stage, [begin, end]) in stages.iter().zip(ticks) {
                timings.push(*stage, self.milliseconds(begin, end));
            }
        }
        Ok(Some(timings))
    }

    /// Gives the pools back, once all commands have run and their times were read.
    pub fn give_back(&mut self) {
        self.gpu.idle.give_back_queries(self.pools.drain(..));
    }

    fn milliseconds(&self, begin: u64, end: u64) -> f64 {
        milliseconds(begin, end, self.gpu.timestamp_mask, self.gpu.info.timestamp_period_ns)
    }
}

/// Only the bits of the mask count, and the counter may have wrapped round once between the two.
fn milliseconds(begin: u64, end: u64, mask: u64, period_ns: f64) -> f64 {
    let ticks = (end & mask).wrapping_sub(begin & mask) & mask;
    ticks as f64 * period_ns / 1e6
}

impl Drop for Stages {
    fn drop(&mut self) {
        for pool in &self.pools {
            // SAFETY: ours, and the commands that write it have run, were never submitted, or are the host's to wait for.
            unsafe { self.gpu.device.destroy_query_pool(*pool, None) };
        }
    }
}

/// Commands that a host will run: keeps what they refer to alive, and has their times afterwards. The host must not drop it before the
/// device has finished them.
pub struct Recorded {
    pub(crate) stages: Stages,
    /// Dropped with this.
    pub(crate) _keep: Vec<Keep>,
}

impl Recorded {
    /// Times of the stages, or `None` while the device has not finished them.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the device is lost.
    pub fn timings(&self) -> Result<Option<Timings>> {
        self.stages.read()
    }
}

#[cfg(test)]
mod tests {
    use super::milliseconds;

    #[test]
    fn ticks_are_masked_and_may_wrap() {
        assert_eq!(milliseconds(1_000, 3_000_000, u64::MAX, 2.0), 5.998);
        // Upper bits are rubbish where only 36 are valid.
        let mask = (1 << 36) - 1;
        assert_eq!(milliseconds(5 | 1 << 40, 1_000_005 | 1 << 50, mask, 1.0), 1.0);
        assert_eq!(milliseconds(mask - 499_999, 500_000, mask, 1.0), 1.0);
    }
}
