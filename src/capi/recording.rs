//! Recordings: our commands within a host's command buffer, and what has to live until they have run.

use crate::device::CaoDevice;
use crate::device::vulkan::VkCommandBuffer;
use crate::draw::{CaoDraw, Drawing};
use crate::edge::{answer, read};
use crate::error::{CaoResult, Failure, Result, guard, refuse};
use crate::handle::{free, get, handle, insert};
use crate::image::CaoImage;
use crate::renderer::{CaoRenderer, Shared};
use ash::vk::{self, Handle as _};
use cao::renderer::Targets;
use cao_gpu::{Image, Recorded, Recorder};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};

/// Commands in a host's command buffer. 0 is none.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CaoRecording {
    /// Without meaning for a host.
    pub id: u64,
}
handle!(CaoRecording, 6, "recording", Recording);

/// A recording, from its beginning until the device has run it.
pub(crate) struct Recording {
    inside: Mutex<Inside>,
    /// The handle's number.
    device: u64,
}

struct Inside {
    state: State,
    /// Held so that a host cannot free what commands use.
    images: Vec<Arc<Image>>,
    /// Flags of the renderers that take what is recorded here as done.
    updated: Vec<Arc<AtomicBool>>,
}

enum State {
    Open(Box<Recorder>),
    Ended(Recorded),
    /// What was recorded must not run.
    Failed(String),
}

impl Inside {
    /// What is recorded here will never run.
    fn give_up(&mut self) {
        self.updated.drain(..).for_each(|stale| stale.store(true, Ordering::Relaxed));
    }

    fn open(&mut self) -> Result<&mut Recorder> {
        match &mut self.state {
            State::Open(rec) => Ok(rec),
            State::Ended(_) => refuse(CaoResult::WrongOrder, "recording: has ended; begin another"),
            State::Failed(why) => {
                let what = format!("recording: has failed ({why}); free it and reset the command buffer");
                refuse(CaoResult::WrongOrder, what)
            }
        }
    }
}

impl Drop for Inside {
    fn drop(&mut self) {
        if !matches!(self.state, State::Ended(_)) {
            self.give_up();
        }
    }
}

impl Recording {
    /// Refuses a renderer of another device.
    fn check(&self, renderer: &Shared) -> Result {
        if self.device == renderer.device {
            return Ok(());
        }
        refuse(CaoResult::BadValue, "renderer: is on another device than the recording")
    }

    fn inside(&self) -> Result<MutexGuard<'_, Inside>> {
        match self.inside.try_lock() {
            Ok(inside) => Ok(inside),
            Err(TryLockError::WouldBlock) => {
                refuse(CaoResult::Busy, "recording: another thread is in a call with it")
            }
            Err(TryLockError::Poisoned(inside)) => {
                let mut inside = inside.into_inner();
                self.inside.clear_poison();
                inside.give_up();
                inside.state = State::Failed("a fault of this library".into());
                Ok(inside)
            }
        }
    }

    /// Records something. Where that fails after something may have been recorded, nothing of it may run.
    fn record<R>(&self, record: impl FnOnce(&mut Inside) -> Result<R>) -> Result<R> {
        let mut inside = self.inside()?;
        inside.open()?;
        let done = record(&mut inside);
        if let Err(Failure { code, message }) = &done
            && *code != CaoResult::Busy
        {
            inside.give_up();
            inside.state = State::Failed(message.clone());
        }
        done
    }
}

/// Begins to record into a command buffer of the host, which is recording, outside of rendering, for a queue of the device's family. The
/// host adds its own commands before and after, ends it and submits it once. Free it with cao_recording_free.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_recording_begin(
    device: CaoDevice,
    commands: VkCommandBuffer,
    recording: *mut CaoRecording,
) -> CaoResult {
    let make = || {
        let gpu = get(device)?;
        if commands.is_null() {
            return refuse(CaoResult::NullPointer, "commands: is VK_NULL_HANDLE");
        }
        // SAFETY: the header asks for a command buffer that records, that is submitted once and only after `cao_recording_end`,
        // and for the recording to be kept until it has run.
        let rec = unsafe { gpu.record_into(vk::CommandBuffer::from_raw(commands as u64)) };
        let state = State::Open(Box::new(rec));
        let inside = Inside { state, images: Vec::new(), updated: Vec::new() };
        Ok(insert(Recording { inside: Mutex::new(inside), device: device.id }, device.id))
    };
    // SAFETY: the header asks for it.
    guard(|| unsafe { answer(recording, CaoRecording { id: 0 }, make) })
}

/// Takes an image over, in the state that CaoImageInfo.before says.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_recording_acquire(recording: CaoRecording, image: CaoImage) -> CaoResult {
    guard(|| {
        let (recording, image) = (get(recording)?, get(image)?);
        recording.record(|inside| {
            inside.open()?.acquire(&image)?;
            inside.images.push(image);
            Ok(())
        })
    })
}

/// Gives an image back, in the state that CaoImageInfo.after says.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_recording_release(recording: CaoRecording, image: CaoImage) -> CaoResult {
    guard(|| {
        let (recording, image) = (get(recording)?, get(image)?);
        recording.record(|inside| Ok(inside.open()?.release(&image)?))
    })
}

/// Records what brings a renderer's ambient volume up to date; nothing where nothing changed. Recordings run in the order in which they
/// end, and before any later function with this renderer that uses the queue.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_recording_update(recording: CaoRecording, renderer: CaoRenderer) -> CaoResult {
    guard(|| {
        let (recording, shared) = (get(recording)?, get(renderer)?);
        recording.check(&shared)?;
        recording.record(|inside| {
            shared.enter(|renderer| {
                inside.open()?;
                inside.updated.push(shared.stale.clone());
                Ok(renderer.record_update(inside.open()?)?)
            })
        })
    })
}

/// Records the drawing of one to four views into images that are acquired. Refused while the ambient volume is out of date.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_recording_draw(
    recording: CaoRecording,
    renderer: CaoRenderer,
    draw: *const CaoDraw,
) -> CaoResult {
    guard(|| {
        let (recording, shared) = (get(recording)?, get(renderer)?);
        recording.check(&shared)?;
        // SAFETY: the header asks for it.
        let drawing = unsafe { Drawing::of(&read(draw)?) }?;
        recording.record(|inside| {
            shared.enter(|renderer| {
                let rec = inside.open()?;
                let draw = |targets: &Targets| {
                    renderer.record_draw(rec, &drawing.views, &drawing.look, targets).map(drop)
                };
                Ok(drawing.with_targets(draw)?)
            })
        })
    })
}

/// Ends a recording; the command buffer goes on recording what is the host's. Keep the recording until the device has run it.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_recording_end(recording: CaoRecording) -> CaoResult {
    guard(|| {
        let recording = get(recording)?;
        recording.record(|inside| {
            let open = State::Failed("its end".into());
            let State::Open(rec) = std::mem::replace(&mut inside.state, open) else {
                return refuse(CaoResult::Internal, "recording: is not open");
            };
            inside.state = State::Ended(rec.finish()?);
            // From here on it is the host's to run.
            inside.updated.clear();
            Ok(())
        })
    })
}

/// What the device took for a recording, in ms. CAO_RESULT_NOT_READY until it has run it.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_recording_time(recording: CaoRecording, ms: *mut f64) -> CaoResult {
    let make = || {
        let recording = get(recording)?;
        let inside = recording.inside()?;
        let State::Ended(recorded) = &inside.state else {
            return refuse(CaoResult::WrongOrder, "recording: has not ended");
        };
        match recorded.timings()? {
            Some(timings) => Ok(timings.total()),
            None => refuse(CaoResult::NotReady, "recording: the device has not run it yet"),
        }
    };
    // SAFETY: the header asks for it.
    guard(|| unsafe { answer(ms, 0.0, make) })
}

/// Frees a recording that the device has run. One that has not ended, or failed, is given up: the host resets the command buffer without
/// submitting it, and renderers that were updated in it compute everything again.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_recording_free(recording: CaoRecording) -> CaoResult {
    guard(|| free(recording))
}

/// Gives up what an ended recording holds: after commands that the host will never submit, though their recording ended.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_renderer_invalidate(renderer: CaoRenderer) -> CaoResult {
    guard(|| {
        get(renderer)?.stale.store(true, Ordering::Relaxed);
        Ok(())
    })
}
