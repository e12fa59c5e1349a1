//! Recording of commands, into a command buffer of our own or of a host.

use super::{
    Buffer, Gpu, Pipeline,
    access::Access,
    bind::{Bind, Bindings, Keep, Resolved, resolve},
    counts::Counts,
    device::{Inner, vulkan},
    hazard::{Hazards, ResourceId, Touch},
    idle::{Commands, Idle},
    timing::{Recorded, Stage, Stages, Timings},
};
use crate::{Error, Result};
use ash::vk;
use std::{ops::Range, sync::Arc};

/// Bytes of indirect arguments.
const ARGUMENTS: u64 = 12;

/// Records commands. Keeps everything they refer to alive. See [`hazard`](super::hazard) for what it refuses.
pub struct Recorder {
    pub(crate) gpu: Arc<Inner>,
    pub(crate) name: String,
    pub(crate) cmd: vk::CommandBuffer,
    /// State at this point of the recording.
    pub(crate) hazards: Hazards,
    keep: Vec<Keep>,
    stages: Stages,
    counts: Counts,
    /// Our own command buffer; `None` when `cmd` is the host's.
    own: Option<Own>,
}

/// A command buffer of our own. Dropped after the commands have run or without running them.
struct Own {
    gpu: Arc<Inner>,
    commands: Commands,
}

impl Drop for Own {
    fn drop(&mut self) {
        self.gpu.idle.give_back(self.commands);
    }
}

impl Gpu {
    /// Begins a recording of our own.
    ///
    /// # Errors
    /// [`Error::Config`] on an adopted device, whose queue is the host's; [`Error::Vulkan`] if the device refuses.
    pub fn recorder(&self, name: &str) -> Result<Recorder> {
        let gpu = &self.0;
        if gpu.queue.is_none() {
            return Err(Error::Config {
                what: format!("recorder {name}"),
                problem: "the device was adopted and its queue is the host's; use record_into with a command buffer of the host".into(),
            });
        }
        // From here on the drop of `own` cleans up.
        let own = Own { gpu: gpu.clone(), commands: Idle::commands(gpu, name)? };
        let cmd = own.commands.buffer;
        gpu.set_name(cmd, name);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer was just made or reset.
        unsafe { gpu.device.begin_command_buffer(cmd, &begin) }
            .map_err(vulkan("vkBeginCommandBuffer", name))?;
        Ok(self.record(name, cmd, Some(own)))
    }

    /// Records into a command buffer of the host. End with [`Recorder::finish`].
    ///
    /// What earlier recordings left pending stays pending, so recordings must run in the order in which they were finished, and a recording
    /// begins with the barriers against the one before it.
    ///
    /// # Safety
    /// `cmd` must belong to this device and be recording, for a queue of the adopted family, outside a rendering pass, until
    /// [`Recorder::finish`] returns. The host must submit it at most once, and keep the [`Recorded`] until the device has run it. Where
    /// recording ended in another way, with an error or a recorder that was dropped without [`Recorder::finish`], the host must not submit
    /// `cmd`: reset it. Its commands refer to what nothing keeps alive, and later recordings do not know of them.
    pub unsafe fn record_into(&self, cmd: vk::CommandBuffer) -> Recorder {
        self.record("host's commands", cmd, None)
    }

    fn record(&self, name: &str, cmd: vk::CommandBuffer, own: Option<Own>) -> Recorder {
        let gpu = self.0.clone();
        let hazards = gpu.hazards().clone();
        let stages = Stages::new(gpu.clone());
        Recorder {
            gpu,
            name: name.into(),
            cmd,
            hazards,
            keep: Vec::new(),
            stages,
            counts: Counts::default(),
            own,
        }
    }
}

impl Recorder {
    /// One global memory barrier: every access of the kinds `before` recorded so far happens before every access of the kinds `after`
    /// recorded later.
    pub fn barrier(&mut self, before: &[Access], after: &[Access]) {
        let union = |list| Access::union(list, self.gpu.graphics, self.gpu.rays.is_some());
        let ((src_stage, src), (dst_stage, dst)) = (union(before), union(after));
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(src_stage)
            .src_access_mask(src)
            .dst_stage_mask(dst_stage)
            .dst_access_mask(dst)];
        self.memory_barrier(&barrier);
        self.count(0, 1);
        self.hazards.barrier(before, after);
    }

    /// Counts calls, `barriers` of which are barriers and the rest state.
    pub(crate) fn count(&mut self, others: u64, barriers: u64) {
        self.counts.barriers += barriers;
        self.counts.calls += others + barriers;
    }

    fn memory_barrier(&self, barrier: &[vk::MemoryBarrier2<'_>]) {
        let info = vk::DependencyInfo::default().memory_barriers(barrier);
        // SAFETY: `cmd` is recording (ours, or by the promise of `record_into`), outside a rendering pass.
        unsafe { (self.gpu.v13.cmd_pipeline_barrier2)(self.cmd, &info) };
    }

    /// Runs `groups` workgroups `[x, y, z]`. `push` is the immediate block, of exactly the size that the shader declares.
    ///
    /// # Errors
    /// [`Error::Config`] if bindings or `push` do not fit the shader, [`Error::Limit`] for too many workgroups, [`Error::Hazard`] for a
    /// missing barrier.
    pub fn dispatch(
        &mut self,
        pipeline: &Pipeline,
        binds: &(impl Bindings + ?Sized),
        push: &[u8],
        groups: [u32; 3],
    ) -> Result<()> {
        self.check_groups(pipeline, groups)?;
        let binds = binds.list();
        let resolved = self.prepare(pipeline, vk::PipelineBindPoint::COMPUTE, &binds, push)?;
        self.order(&pipeline.0.name, &resolved.touches)?;
        self.set(pipeline, vk::PipelineBindPoint::COMPUTE, resolved, push);
        // SAFETY: `cmd` is recording, pipeline and descriptors are set, the counts are within the device's limits.
        unsafe { self.gpu.device.cmd_dispatch(self.cmd, groups[0], groups[1], groups[2]) };
        Ok(())
    }

    /// Runs at least `invocations` invocations `[x, y, z]`, rounded up to whole workgroups; the shader drops the surplus.
    ///
    /// # Errors
    /// As [`dispatch`](Self::dispatch).
    pub fn dispatch_over(
        &mut self,
        pipeline: &Pipeline,
        binds: &(impl Bindings + ?Sized),
        push: &[u8],
        invocations: [u32; 3],
    ) -> Result<()> {
        let size = pipeline.0.workgroup;
        // A graphics pipeline has no workgroup and is refused by `dispatch`.
        let groups = std::array::from_fn(|i| invocations[i].div_ceil(size[i].max(1)));
        self.dispatch(pipeline, binds, push, groups)
    }

    /// Runs as many workgroups as the three `u32` at `offset` (bytes) of `buffer` say when the device gets there.
    ///
    /// # Errors
    /// As [`dispatch`](Self::dispatch); [`Error::Config`] if the arguments are not inside a device buffer, or if a fill or update with
    /// numbers of at most 65535, which every device can run, is not what the program last wrote there. Shaders may count up from that.
    pub fn dispatch_indirect(
        &mut self,
        pipeline: &Pipeline,
        binds: &(impl Bindings + ?Sized),
        push: &[u8],
        buffer: &Buffer,
        offset: u64,
    ) -> Result<()> {
        buffer.0.check_range(offset, ARGUMENTS)?;
        if buffer.0.kind != super::BufferUse::Device || !offset.is_multiple_of(4) {
            return Err(Error::Config {
                what: format!(
                    "{}: indirect arguments in buffer {} at {offset}",
                    pipeline.0.name,
                    buffer.name()
                ),
                problem: "must be in a Device buffer at a multiple of 4".into(),
            });
        }
        self.hazards.learn(&self.gpu.hazards(), buffer.0.id);
        if !self.hazards.may_dispatch(buffer.0.id, &(offset..offset + ARGUMENTS)) {
            return Err(Error::Config {
                what: format!(
                    "{}: indirect arguments in buffer {} at {offset}",
                    pipeline.0.name,
                    buffer.name()
                ),
                problem: "may be anything; write the three counts with fill or update, each at most 65535, before shaders count them up"
                    .into(),
            });
        }
        let binds = binds.list();
        let mut resolved = self.prepare(pipeline, vk::PipelineBindPoint::COMPUTE, &binds, push)?;
        resolved.touches.push(Touch {
            id: buffer.0.id,
            name: buffer.name(),
            via: "indirect arguments",
            range: offset..offset + ARGUMENTS,
            access: Access::IndirectRead,
        });
        resolved.keep.push(buffer.0.clone());
        self.order(&pipeline.0.name, &resolved.touches)?;
        self.set(pipeline, vk::PipelineBindPoint::COMPUTE, resolved, push);
        // SAFETY: `cmd` is recording, pipeline and descriptors are set, the arguments are inside an indirect buffer.
        unsafe { self.gpu.device.cmd_dispatch_indirect(self.cmd, buffer.0.raw, offset) };
        Ok(())
    }

    /// What was recorded so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Begins a stage: a label for debuggers, and a time in [`Timings`]. Stages may be nested.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the device is out of memory.
    pub fn stage(&mut self, stage: Stage) -> Result<()> {
        // SAFETY: `cmd` is recording (ours, or by the promise of `record_into`), outside a rendering pass.
        unsafe { self.stages.begin(self.cmd, stage) }?;
        self.count(1, 0);
        Ok(())
    }

    /// Ends the innermost stage.
    ///
    /// # Errors
    /// [`Error::Config`] if none has begun.
    pub fn end_stage(&mut self) -> Result<()> {
        // SAFETY: as in `stage`.
        unsafe { self.stages.end(self.cmd) }?;
        self.count(1, 0);
        Ok(())
    }

    /// Runs the commands and waits for them. A full wait: afterwards nothing is pending, mapped buffers may be read, and the next
    /// recording needs no barrier against this one.
    ///
    /// # Errors
    /// [`Error::Config`] for a host's command buffer or a stage without end, [`Error::Vulkan`] if the device fails.
    pub fn submit_and_wait(mut self) -> Result<Timings> {
        self.stages.check_closed()?;
        let (Some(queue), Some(own)) = (&self.gpu.queue, &self.own) else {
            return Err(Error::Config {
                what: self.name.clone(),
                problem: "is recorded into a host's command buffer, which the host submits; end with finish"
                    .into(),
            });
        };
        use vk::{AccessFlags2 as A, PipelineStageFlags2 as S};
        // What makes the wait full: to the program, and to whatever is submitted next.
        self.memory_barrier(&[vk::MemoryBarrier2::default()
            .src_stage_mask(S::ALL_COMMANDS)
            .src_access_mask(A::MEMORY_WRITE)
            .dst_stage_mask(S::ALL_COMMANDS | S::HOST)
            .dst_access_mask(A::MEMORY_READ | A::MEMORY_WRITE | A::HOST_READ)]);
        let device = &self.gpu.device;
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(self.cmd)];
        let submit = [vk::SubmitInfo2::default().command_buffer_infos(&commands)];
        // SAFETY: the command buffer is ours and recording; queue access is locked; the fence is ours and was reset.
        unsafe {
            device.end_command_buffer(self.cmd).map_err(vulkan("vkEndCommandBuffer", &self.name))?;
            let fence = own.commands.fence;
            let locked = || queue.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let submitted = (self.gpu.v13.queue_submit2)(*locked(), 1, submit.as_ptr(), fence).result();
            let waited = submitted.map_err(vulkan("vkQueueSubmit2", &self.name)).and_then(|()| {
                device
                    .wait_for_fences(&[fence], true, u64::MAX)
                    .map_err(vulkan("vkWaitForFences", &self.name))
            });
            if waited.is_err() {
                // Nothing may be freed while it is in use; an idle or lost queue uses nothing.
                let _ = device.queue_wait_idle(*locked());
            }
            waited?;
        }
        *self.gpu.counts() += Counts { submissions: 1, ..self.counts };
        self.gpu.hazards().commit_waited(&self.hazards);
        let timings = self.stages.read()?.unwrap_or_default();
        self.stages.give_back();
        Ok(timings)
    }

    /// Ends a recording into a host's command buffer, which stays recording.
    ///
    /// # Errors
    /// [`Error::Config`] for a command buffer of our own or a stage without end.
    pub fn finish(self) -> Result<Recorded> {
        self.stages.check_closed()?;
        if self.own.is_some() {
            return Err(Error::Config {
                what: self.name,
                problem: "is recorded into a command buffer of its own; end with submit_and_wait".into(),
            });
        }
        *self.gpu.counts() += self.counts;
        self.gpu.hazards().commit_pending(self.hazards);
        Ok(Recorded { stages: self.stages, _keep: self.keep })
    }

    /// Refuses a command that lacks a barrier, or notes what it does.
    pub(crate) fn order(&mut self, command: &str, touches: &[Touch<'_>]) -> Result<()> {
        touches.iter().for_each(|touch| self.hazards.learn(&self.gpu.hazards(), touch.id));
        self.counts.commands += 1;
        self.counts.calls += 1;
        self.hazards.command(command, touches).map_err(|problem| Error::Hazard { problem })
    }

    /// Notes what the program writes to a buffer, see [`Hazards::words`].
    pub(crate) fn note_words(&mut self, id: ResourceId, range: Range<u64>, dispatchable: bool) {
        self.hazards.words(id, range, dispatchable);
    }

    /// Keeps an object until the commands have run.
    pub(crate) fn keep(&mut self, object: Keep) {
        self.keep.push(object);
    }

    /// Checks binds and immediates against the shader.
    pub(crate) fn prepare<'a>(
        &self,
        pipeline: &Pipeline,
        point: vk::PipelineBindPoint,
        binds: &[(&'a str, Bind<'a>)],
        push: &[u8],
    ) -> Result<Resolved<'a>> {
        let inner = &pipeline.0;
        let problem = if !Arc::ptr_eq(&inner.gpu, &self.gpu) {
            "belongs to another device".into()
        } else if inner.targets.is_some() != (point == vk::PipelineBindPoint::GRAPHICS) {
            "is a pipeline of the other kind (compute pipelines are dispatched, graphics pipelines draw)"
                .into()
        } else if push.len() != inner.push_bytes as usize {
            format!("takes {} bytes of immediates, given are {}", inner.push_bytes, push.len())
        } else {
            return resolve(inner, binds);
        };
        Err(Error::Config { what: inner.name.clone(), problem })
    }

    /// Sets pipeline, descriptors and immediates.
    pub(crate) fn set(
        &mut self,
        pipeline: &Pipeline,
        point: vk::PipelineBindPoint,
        resolved: Resolved<'_>,
        push: &[u8],
    ) {
        let inner = &pipeline.0;
        let writes = resolved.writes();
        // SAFETY: `cmd` is recording (ours, or by the promise of `record_into`); what is set was checked by `prepare` and is kept.
        unsafe {
            self.gpu.device.cmd_bind_pipeline(self.cmd, point, inner.raw);
            if !writes.is_empty() {
                self.gpu.push_descriptor.cmd_push_descriptor_set(self.cmd, point, inner.layout, 0, &writes);
            }
            if !push.is_empty() {
                self.gpu.device.cmd_push_constants(self.cmd, inner.layout, inner.stages, 0, push);
            }
        }
        self.count(1 + u64::from(!writes.is_empty()) + u64::from(!push.is_empty()), 0);
        drop(writes);
        self.keep.extend(resolved.keep);
        self.keep.push(inner.clone());
    }

    fn check_groups(&self, pipeline: &Pipeline, groups: [u32; 3]) -> Result<()> {
        for ((axis, needed), limit) in ["x", "y", "z"].iter().zip(groups).zip(self.gpu.info.max_workgroups) {
            if needed > limit {
                return Err(Error::Limit {
                    what: format!("{}: workgroups along {axis}", pipeline.0.name),
                    needed: needed.into(),
                    limit: limit.into(),
                    hint: "work on smaller bricks".into(),
                });
            }
        }
        Ok(())
    }
}
