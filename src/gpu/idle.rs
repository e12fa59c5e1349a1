//! What a recording of our own needs and gives back: made once, ready before the next one.

use super::device::{Inner, vulkan};
use crate::Result;
use ash::vk;
use std::sync::{Arc, Mutex, PoisonError};

/// A command buffer with its pool, and the fence that says when it has run.
#[derive(Clone, Copy)]
pub(crate) struct Commands {
    pub pool: vk::CommandPool,
    pub buffer: vk::CommandBuffer,
    pub fence: vk::Fence,
}

/// What is not in use.
#[derive(Default)]
pub(crate) struct Idle {
    commands: Mutex<Vec<Commands>>,
    queries: Mutex<Vec<vk::QueryPool>>,
}

fn locked<T>(list: &Mutex<Vec<T>>) -> std::sync::MutexGuard<'_, Vec<T>> {
    list.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Idle {
    /// A command buffer that can be begun.
    pub fn commands(gpu: &Arc<Inner>, name: &str) -> Result<Commands> {
        let device = &gpu.device;
        if let Some(commands) = locked(&gpu.idle.commands).pop() {
            // SAFETY: ours, and in use by nobody: it was given back after its commands had run or without running them.
            let ready = unsafe {
                device
                    .reset_command_pool(commands.pool, vk::CommandPoolResetFlags::empty())
                    .and_then(|()| device.reset_fences(&[commands.fence]))
            };
            return match ready {
                Ok(()) => Ok(commands),
                Err(result) => {
                    // SAFETY: as above.
                    unsafe { destroy(device, commands) };
                    Err(vulkan("vkResetCommandPool", name)(result))
                }
            };
        }
        let create = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(gpu.queue_family);
        // SAFETY: the device is alive and has this queue family; what was made before a failure goes again.
        unsafe {
            let pool =
                device.create_command_pool(&create, None).map_err(vulkan("vkCreateCommandPool", name))?;
            let allocate =
                vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
            let made = device.allocate_command_buffers(&allocate).and_then(|list| {
                let fence = device.create_fence(&vk::FenceCreateInfo::default(), None)?;
                Ok(Commands { pool, buffer: list[0], fence })
            });
            made.map_err(|result| {
                device.destroy_command_pool(pool, None);
                vulkan("vkAllocateCommandBuffers", name)(result)
            })
        }
    }

    /// Takes back a command buffer whose commands have run, or never will.
    pub fn give_back(&self, commands: Commands) {
        locked(&self.commands).push(commands);
    }

    /// A pool of so many timestamps; all pools have as many.
    pub fn queries(gpu: &Arc<Inner>, count: u32, name: &str) -> Result<vk::QueryPool> {
        if let Some(pool) = locked(&gpu.idle.queries).pop() {
            return Ok(pool);
        }
        let create =
            vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(count);
        // SAFETY: the device is alive.
        unsafe { gpu.device.create_query_pool(&create, None) }.map_err(vulkan("vkCreateQueryPool", name))
    }

    /// Takes back a pool whose results were read after all of its commands had run: until its next reset has run it still holds them.
    pub fn give_back_queries(&self, pools: impl IntoIterator<Item = vk::QueryPool>) {
        locked(&self.queries).extend(pools);
    }

    /// # Safety
    /// Nothing of it may be in use, and the device must be alive.
    pub unsafe fn destroy(&self, device: &ash::Device) {
        // SAFETY: the caller's promise.
        unsafe {
            locked(&self.commands).drain(..).for_each(|commands| destroy(device, commands));
            locked(&self.queries).drain(..).for_each(|pool| device.destroy_query_pool(pool, None));
        }
    }
}

/// # Safety
/// Ours and not in use.
unsafe fn destroy(device: &ash::Device, commands: Commands) {
    // SAFETY: the caller's promise; the command buffer goes with its pool.
    unsafe {
        device.destroy_fence(commands.fence, None);
        device.destroy_command_pool(commands.pool, None);
    }
}
