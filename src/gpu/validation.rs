//! The Khronos validation layer: switched on with synchronization checks, its messages kept for tests to assert on.

use crate::{Error, Result};
use ash::vk;
use std::{
    ffi::{CStr, c_void},
    sync::{Arc, Mutex, PoisonError},
};

/// A message that is known, harmless here and explained.
struct Mute {
    /// The message's id, as in [`ValidationLog::messages`].
    id: &'static str,
    /// Part of its text: an id can stand for harmful messages too.
    text: &'static str,
    /// Why it does not matter.
    #[expect(dead_code, reason = "for the reader of the table")]
    reason: &'static str,
    /// Where it is explained.
    #[expect(dead_code, reason = "for the reader of the table")]
    link: &'static str,
}

/// Messages that are not kept.
const MUTED: &[Mute] = &[Mute {
    id: "UNASSIGNED-CoreValidation-DrawState-InvalidImageLayout",
    text: "For optimal performance",
    reason: "images stay in GENERAL by design; a hint of older layers, since moved to their best-practices checks",
    link: "https://github.com/KhronosGroup/Vulkan-ValidationLayers/blob/v1.3.239/layers/core_checks/image_validation.cpp",
}];

/// Messages of the validation layer; stays readable after its [`Gpu`](super::Gpu) is gone, when leaks are reported.
#[derive(Debug, Clone, Default)]
pub struct ValidationLog(Arc<Mutex<Vec<String>>>);

impl ValidationLog {
    /// The layer.
    pub const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

    /// All messages so far, `id: text` each.
    pub fn messages(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// An error that holds all messages so far, if there are any.
    pub fn assert_clean(&self) -> Result<()> {
        let messages = self.messages();
        if messages.is_empty() {
            return Ok(());
        }
        let list = messages.join("\n");
        Err(Error::Device {
            problem: format!("the validation layer reported {} problems:\n{list}", messages.len()),
        })
    }

    /// Adds a message, unless it is muted.
    pub(crate) fn keep(&self, id: &str, text: &str) {
        keep(&self.0, id, text);
    }

    /// How Vulkan is told to report into this log; for hosts too, beside the layer and `VK_EXT_debug_utils`. The log must outlive the
    /// instance and the messenger made of it.
    pub fn messenger(&self) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
        use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Kind};
        vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(Severity::WARNING | Severity::ERROR)
            .message_type(Kind::VALIDATION | Kind::PERFORMANCE)
            .pfn_user_callback(Some(receive))
            .user_data(Arc::as_ptr(&self.0).cast_mut().cast())
    }
}

fn keep(messages: &Mutex<Vec<String>>, id: &str, text: &str) {
    if !MUTED.iter().any(|mute| mute.id == id && text.contains(mute.text)) {
        messages.lock().unwrap_or_else(PoisonError::into_inner).push(format!("{id}: {text}"));
    }
}

/// Receives one message from the layer.
unsafe extern "system" fn receive(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    log: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan passes a valid message with null or terminated strings.
    let (id, text) = unsafe {
        let data = &*data;
        (data.message_id_name_as_c_str(), data.message_as_c_str())
    };
    let words = |s: Option<&CStr>| s.map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    // SAFETY: `log` is what `messenger` took from the `Arc` that the `Gpu` holds until its instance is destroyed.
    let messages = unsafe { &*log.cast::<Mutex<Vec<String>>>() };
    keep(messages, &words(id), &words(text));
    vk::FALSE
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two submits without a barrier between them, which `Recorder` cannot express. The layer sees it as `.cargo/config.toml` asks it to.
    #[test]
    fn a_missing_barrier_between_two_submits_is_seen() {
        use crate::{BufferUse, Gpu, OpenOptions};
        let gpu = Gpu::open(&OpenOptions { validation: true, ..Default::default() }).unwrap();
        let x = gpu.buffer("x", 64, BufferUse::Device).unwrap();
        let device = &gpu.0.device;
        let pool = vk::CommandPoolCreateInfo::default().queue_family_index(gpu.0.queue_family);
        // SAFETY: all handles are of this device and alive; the wait at the end precedes their destruction.
        unsafe {
            let pool = device.create_command_pool(&pool, None).unwrap();
            let list = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(2);
            let queue = *gpu.0.queue.as_ref().unwrap().lock().unwrap();
            for cmd in device.allocate_command_buffers(&list).unwrap() {
                device.begin_command_buffer(cmd, &Default::default()).unwrap();
                device.cmd_fill_buffer(cmd, x.0.raw, 0, 64, 1);
                device.end_command_buffer(cmd).unwrap();
                let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(cmd)];
                let submit = [vk::SubmitInfo2::default().command_buffer_infos(&commands)];
                device.queue_submit2(queue, &submit, vk::Fence::null()).unwrap();
            }
            device.queue_wait_idle(queue).unwrap();
            device.destroy_command_pool(pool, None);
        }
        let messages = gpu.validation_messages();
        assert!(messages.iter().any(|m| m.contains("SYNC-HAZARD")), "{messages:?}");
    }

    #[test]
    fn a_muted_hint_is_dropped_and_an_error_of_the_same_id_is_kept() {
        let log = ValidationLog::default();
        log.keep(MUTED[0].id, "For optimal performance image should be in another layout");
        log.assert_clean().unwrap();
        log.keep(MUTED[0].id, "image is in another layout than expected");
        log.assert_clean().unwrap_err();
    }

    #[test]
    fn a_message_fails_the_log() {
        let log = ValidationLog::default();
        log.assert_clean().unwrap();
        log.keep("VUID-x", "something is wrong");
        assert!(log.assert_clean().unwrap_err().to_string().contains("VUID-x: something is wrong"));
    }
}
