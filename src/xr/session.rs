//! A session: its states, and the frames that are drawn while there is one.

use crate::check::{Eye, Verdict};
use crate::controls::{Controls, REHEARSED_S, rehearsed};
use crate::device::Device;
use crate::input::{Input, located, rigid};
use crate::placement::{Placement, Rigid};
use crate::readback::ReadBack;
use crate::runtime::{Runtime, VIEWS};
use crate::target::{self, Images, Targets};
use anyhow::{Context, Result};
use ash::vk;
use cao::gpu::{Gpu, Phase, Recorded};
use cao::model::frame::Turn;
use cao::model::view::Tangents;
use cao::renderer::{self as draw, Drawn};
use cao::{Look, Renderer, Setup, TransferFunction, View, Volume};
use openxr as xr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// What is shown.
pub struct Show {
    /// The volume, in the order in which it is drawn.
    pub volume: Volume,
    /// How its axes lie in the patient.
    pub turn: Turn,
    /// Opacity and colour.
    pub transfer: TransferFunction,
    /// How occlusion is computed.
    pub setup: Setup,
    /// How samples are lit.
    pub look: Look,
}

/// How long, and with what checks.
pub struct Plan<'a> {
    /// So many frames that are shown, then the session ends; `None`: until the runtime or the user ends it.
    pub frames: Option<u64>,
    /// The right hand does what is rehearsed, and what was drawn first and last is read back.
    pub check: bool,
    /// Set from elsewhere to end the session.
    pub stop: &'a AtomicBool,
}

/// What happened.
#[derive(Debug, Default)]
pub struct Report {
    /// States of the session in the order in which the runtime said them.
    pub states: Vec<xr::SessionState>,
    /// Frames that were drawn and handed over.
    pub frames: u64,
    /// Pixels of an eye.
    pub size: [u32; 2],
    /// The compositor got depths too.
    pub depth: bool,
    /// Frames in which a clip was in a hand.
    pub clipped: u64,
    /// Frames whose times are known.
    pub timed: u64,
    /// Of all these the ms of the device: in total, and for drawing.
    pub device_ms: [f64; 2],
    /// What the first and the last frame's pictures are.
    pub verdicts: Vec<Verdict>,
}

/// Frames that the device may be behind.
const AHEAD: usize = 2;

/// One of them.
#[derive(Default)]
struct Slot {
    cmd: vk::CommandBuffer,
    fence: vk::Fence,
    /// What its commands use, and what they draw.
    pending: Option<(Recorded, Drawn)>,
}

/// The command buffers of frames.
struct Slots<'a> {
    device: &'a Device,
    pool: vk::CommandPool,
    slots: [Slot; AHEAD],
}

impl<'a> Slots<'a> {
    fn new(device: &'a Device) -> Result<Self> {
        let mut made = Self { device, pool: vk::CommandPool::null(), slots: Default::default() };
        let create = vk::CommandPoolCreateInfo::default()
            .queue_family_index(device.family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: the device is alive; what fails leaves what was made to the drop.
        unsafe {
            made.pool = device.raw.create_command_pool(&create, None)?;
            let count = vk::CommandBufferAllocateInfo::default()
                .command_pool(made.pool)
                .command_buffer_count(AHEAD as u32);
            let buffers = device.raw.allocate_command_buffers(&count)?;
            for (slot, cmd) in made.slots.iter_mut().zip(buffers) {
                slot.cmd = cmd;
                // As if a frame had just run.
                let signaled = vk::FenceCreateInfo::default().flags(vk::FenceCreateFlags::SIGNALED);
                slot.fence = device.raw.create_fence(&signaled, None)?;
            }
        }
        Ok(made)
    }
}

impl Drop for Slots<'_> {
    fn drop(&mut self) {
        let device = &self.device.raw;
        // SAFETY: all are null or of this device, and nothing runs any more. Of a lost device waiting fails, and what is left can go.
        unsafe {
            let _ = device.device_wait_idle();
            for slot in &self.slots {
                device.destroy_fence(slot.fence, None);
            }
            device.destroy_command_pool(self.pool, None);
        }
    }
}

/// What frames share.
struct Frames<'a> {
    /// First, and so dropped first: it waits for what runs.
    slots: Slots<'a>,
    runtime: &'a Runtime,
    device: &'a Device,
    gpu: &'a Gpu,
    show: &'a Show,
    plan: &'a Plan<'a>,
    renderer: Renderer,
    session: xr::Session<xr::Vulkan>,
    waiter: xr::FrameWaiter,
    stream: xr::FrameStream<xr::Vulkan>,
    input: Input,
    targets: Targets,
    /// The room, and the head in it.
    room: xr::Space,
    head: xr::Space,
    blend: xr::EnvironmentBlendMode,
    /// From the first frame in which the head was seen.
    controls: Option<Controls>,
    /// The eyes where they were last seen.
    eyes: Option<[xr::View; 2]>,
    last: Option<xr::Time>,
    report: Report,
}

/// Shows a volume until the session ends; drops all that it made.
///
/// # Errors
/// The runtime's, the device's, and what `cao` refuses.
pub fn run(runtime: &Runtime, device: &Device, show: &Show, plan: &Plan<'_>) -> Result<Report> {
    // SAFETY: the handles belong together, were made with what is required, and outlive `gpu`, whose things are dropped here; the queue is
    // used by this thread alone, also by the runtime, within its calls.
    let gpu = unsafe { Gpu::adopt(device.lend()) }?;
    let mut renderer =
        Renderer::new(&gpu, &show.volume, show.transfer.clone(), show.setup, target::COLOUR.format)?;
    // Before there is a session: nobody waits for a frame yet.
    renderer.update(&mut |_| ())?;
    // SAFETY: instance and device were made through this runtime and outlive the session, which is dropped here.
    let (session, waiter, stream) =
        unsafe { runtime.instance.create_session::<xr::Vulkan>(runtime.system, &device.binding()) }?;
    let spaces = session.enumerate_reference_spaces()?;
    let room = match spaces.contains(&xr::ReferenceSpaceType::STAGE) {
        true => xr::ReferenceSpaceType::STAGE,
        false => xr::ReferenceSpaceType::LOCAL,
    };
    let space = |kind| session.create_reference_space(kind, xr::Posef::IDENTITY);
    let (room, head) = (space(room)?, space(xr::ReferenceSpaceType::VIEW)?);
    let targets = Targets::new(runtime, &session, &gpu)?;
    let report = Report { size: targets.size, depth: targets.has_depth(), ..Report::default() };
    let mut frames = Frames {
        input: Input::new(&session)?,
        blend: runtime.blend()?,
        slots: Slots::new(device)?,
        controls: None,
        eyes: None,
        last: None,
        runtime,
        device,
        gpu: &gpu,
        show,
        plan,
        renderer,
        session,
        waiter,
        stream,
        targets,
        room,
        head,
        report,
    };
    frames.all()?;
    Ok(std::mem::take(&mut frames.report))
}

impl<'a> Frames<'a> {
    /// Follows the session's states to its end.
    fn all(&mut self) -> Result<()> {
        let (mut running, mut leaving) = (false, false);
        let mut storage = xr::EventDataBuffer::new();
        loop {
            while let Some(event) = self.runtime.instance.poll_event(&mut storage)? {
                match event {
                    xr::Event::SessionStateChanged(change) => {
                        let state = change.state();
                        self.report.states.push(state);
                        match state {
                            xr::SessionState::READY => {
                                self.session.begin(VIEWS)?;
                                running = true;
                            }
                            xr::SessionState::STOPPING => {
                                self.session.end()?;
                                running = false;
                            }
                            xr::SessionState::EXITING | xr::SessionState::LOSS_PENDING => return Ok(()),
                            _ => {}
                        }
                    }
                    xr::Event::InstanceLossPending(_) => return Ok(()),
                    _ => {}
                }
            }
            let done = self.plan.frames.is_some_and(|frames| self.report.frames >= frames);
            if (done || self.plan.stop.load(Ordering::Relaxed)) && !leaving {
                if !running {
                    return Ok(());
                }
                // Its states lead to the end.
                self.session.request_exit()?;
                leaving = true;
            }
            match running {
                true => self.one(leaving)?,
                // Nobody looks, and nothing says when that changes but events.
                false => std::thread::sleep(Duration::from_millis(20)),
            }
        }
    }

    /// One frame: wait, begin, what hands do, acquire, late locate, record, submit, release, end.
    /// Who is leaving draws no more.
    fn one(&mut self, leaving: bool) -> Result<()> {
        let frame = self.waiter.wait()?;
        self.stream.begin()?;
        let time = frame.predicted_display_time;
        if self.eyes.is_none() {
            self.eyes = self.located(time)?;
        }
        let (true, Some(eyes)) = (frame.should_render && !leaving, self.eyes) else {
            return Ok(self.stream.end(time, self.blend, &[])?);
        };
        let placement = self.hands(time)?;
        let slot = self.report.frames as usize % AHEAD;
        let (cmd, fence) = self.free(slot)?;
        // SAFETY: the command buffer is recording and submitted once below; the recording is kept in its slot until the fence says that it
        // has run.
        let mut rec = unsafe { self.gpu.record_into(cmd) };
        // Needs no eyes.
        self.renderer.record_update(&mut rec)?;
        self.targets.acquire()?;
        // As late as can be: all that follows needs them.
        let eyes = self.located(time)?.unwrap_or(eyes);
        self.eyes = Some(eyes);
        let views = eyes.map(|eye| placement.view(rigid(eye.pose), tangents(eye.fov)));
        let period = frame.predicted_display_period.as_nanos() as f64 * 1e-6;
        // A frame later than this is shown late; what is checked has to be all there.
        let budget_ms = (!self.plan.check).then_some((period * SHARE) as f32);
        let look = Look { budget_ms, ..self.show.look };
        let images = self.targets.images();
        for image in images.all() {
            rec.acquire(image)?;
        }
        let targets = images.targets();
        let targets = draw::Targets::new(&targets, self.targets.size);
        let drawn = self.renderer.record_draw(&mut rec, &views, &look, &targets)?;
        for image in images.all() {
            rec.release(image)?;
        }
        let recorded = rec.finish()?;
        let last = self.plan.frames == Some(self.report.frames + 1);
        let reads = self.plan.check && (self.report.frames == 0 || last);
        let read = reads.then(|| self.read(cmd, &images)).transpose()?;
        // SAFETY: the command buffer is recording and of this device, and the fence is not in use.
        unsafe {
            self.device.raw.end_command_buffer(cmd)?;
            let submit = [vk::SubmitInfo::default().command_buffers(std::slice::from_ref(&cmd))];
            self.device.raw.queue_submit(self.device.queue, &submit, fence)?;
        }
        self.slots.slots[slot].pending = Some((recorded, drawn));
        if let Some([colours, depths]) = read {
            // SAFETY: the fence is of this device and was submitted.
            unsafe { self.device.raw.wait_for_fences(&[fence], true, u64::MAX)? };
            self.report.verdicts.push(verdict(self.targets.size, views, colours.pixels()?, depths.pixels()?));
        }
        self.targets.release()?;
        self.targets.end(&mut self.stream, &self.room, time, self.blend, &eyes)?;
        self.report.frames += 1;
        Ok(())
    }

    /// Where the eyes are at a time; `None` while nobody knows.
    fn located(&self, time: xr::Time) -> Result<Option<[xr::View; 2]>> {
        let (flags, views) = self.session.locate_views(VIEWS, time, &self.room)?;
        let known = xr::ViewStateFlags::POSITION_VALID | xr::ViewStateFlags::ORIENTATION_VALID;
        Ok(<[xr::View; 2]>::try_from(views).ok().filter(|_| flags.contains(known)))
    }

    /// What hands do until a time, and where the volume stands then: before the head at first.
    fn hands(&mut self, time: xr::Time) -> Result<Placement> {
        let head = located(&self.head.locate(&self.room, time)?).unwrap_or(Rigid::IDENTITY);
        let mut hands = self.input.read(&self.session, &self.room, time)?;
        let mut seconds = self.last.map_or(0.0, |last| (time.as_nanos() - last.as_nanos()) as f32 * 1e-9);
        self.last = Some(time);
        let show = self.show;
        let controls = self.controls.get_or_insert_with(|| {
            let size_mm = show.volume.size_mm();
            Controls::new(Placement::in_front_of(head, size_mm, show.turn), size_mm)
        });
        if self.plan.check {
            (hands, seconds) = (rehearsed(hands, self.report.frames), REHEARSED_S);
        }
        controls.step(&hands, seconds);
        let clip = controls.clip();
        self.report.clipped += u64::from(clip.is_some());
        self.renderer.set_clips(clip.as_slice())?;
        Ok(controls.placement)
    }

    /// A slot whose commands have run, recording anew.
    fn free(&mut self, slot: usize) -> Result<(vk::CommandBuffer, vk::Fence)> {
        let slot = &mut self.slots.slots[slot];
        let device = &self.device.raw;
        // SAFETY: both are of this device; the fence was submitted or made signaled, and after it the command buffer is not in use.
        unsafe {
            device.wait_for_fences(&[slot.fence], true, u64::MAX)?;
            device.reset_fences(&[slot.fence])?;
            device.begin_command_buffer(
                slot.cmd,
                &vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT),
            )?;
        }
        if let Some((recorded, drawn)) = slot.pending.take()
            && let Some(timings) = recorded.timings()?
        {
            let drawing = timings.of(Phase::Draw);
            self.renderer.drew(&drawn, drawing);
            self.report.device_ms[0] += timings.total();
            self.report.device_ms[1] += drawing;
            self.report.timed += 1;
        }
        Ok((slot.cmd, slot.fence))
    }

    /// Records copies of the images of this frame to where the processor reads them: colours, depths.
    fn read(&self, cmd: vk::CommandBuffer, images: &Images<'_>) -> Result<[ReadBack<'a>; 2]> {
        use vk::{ImageAspectFlags as Aspect, ImageLayout as Layout};
        let depth = images.depth.context("the check needs depths, and this runtime takes none")?;
        let copies =
            [ReadBack::new(self.device, self.targets.size)?, ReadBack::new(self.device, self.targets.size)?];
        // SAFETY: the images are ours until they are released, in the layouts in which the runtime takes them back; the caller waits.
        unsafe {
            copies[0].record(cmd, images.colour.raw(), Aspect::COLOR, Layout::COLOR_ATTACHMENT_OPTIMAL);
            copies[1].record(cmd, depth.raw(), Aspect::DEPTH, Layout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL);
        }
        Ok(copies)
    }
}

/// Share of the time between two pictures of the headset that drawing may take.
const SHARE: f64 = 0.7;

fn tangents(fov: xr::Fovf) -> Tangents {
    Tangents {
        left: fov.angle_left.tan(),
        right: fov.angle_right.tan(),
        up: fov.angle_up.tan(),
        down: fov.angle_down.tan(),
    }
}

fn verdict(
    size: [u32; 2],
    views: [View; 2],
    colours: [Vec<[u8; 4]>; 2],
    depths: [Vec<[u8; 4]>; 2],
) -> Verdict {
    let [left_colours, right_colours] = colours;
    let [left_depths, right_depths] = depths.map(|d| d.into_iter().map(f32::from_ne_bytes).collect());
    let left = Eye { view: views[0], size, colours: left_colours, depths: left_depths };
    let right = Eye { view: views[1], size, colours: right_colours, depths: right_depths };
    Verdict::of(&left, &right)
}
