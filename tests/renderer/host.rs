//! A program with a Vulkan of its own, as small as one can be.

use ash::vk;
use cao_gpu::feature::{BEFORE_1_3, RAY_QUERIES};
use cao_gpu::{Adopted, Gpu};
use std::ffi::{CStr, c_void};
use std::sync::Mutex;

/// What the validation layer said to the host.
static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

unsafe extern "system" fn listen(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    _: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan passes a valid message.
    let text = unsafe { (*data).message_as_c_str() }.map(CStr::to_string_lossy).unwrap_or_default();
    MESSAGES.lock().unwrap().push(text.into_owned());
    vk::FALSE
}

/// A minimal engine.
pub struct Host {
    entry: ash::Entry,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    device: ash::Device,
    family: u32,
    pub queue: vk::Queue,
    pool: vk::CommandPool,
}

impl Host {
    pub fn new() -> Self {
        Self::of_version(vk::API_VERSION_1_3)
    }

    /// With an instance of this version.
    pub fn of_version(version: u32) -> Self {
        Self::without(version, None)
    }

    /// The same, and a device without an extension, its feature, and those that need it.
    pub fn without(version: u32, extension: Option<&CStr>) -> Self {
        Self::made(version, extension, false)
    }

    /// With what ray queries need, which its device has.
    pub fn with_ray_queries() -> Self {
        Self::made(vk::API_VERSION_1_3, None, true)
    }

    fn made(version: u32, extension: Option<&CStr>, ray_queries: bool) -> Self {
        // SAFETY: the calls follow Vulkan's rules; everything passed lives during its call.
        unsafe {
            let entry = ash::Entry::load().unwrap();
            let application = vk::ApplicationInfo::default().api_version(version);
            let layers: Vec<_> = cao_testing::validated()
                .then_some(c"VK_LAYER_KHRONOS_validation".as_ptr())
                .into_iter()
                .collect();
            let extensions = [ash::ext::debug_utils::NAME.as_ptr()];
            let mut messenger = vk::DebugUtilsMessengerCreateInfoEXT::default()
                .message_severity(
                    vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                        | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                )
                .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
                .pfn_user_callback(Some(listen));
            let create = vk::InstanceCreateInfo::default()
                .application_info(&application)
                .enabled_layer_names(&layers)
                .enabled_extension_names(&extensions)
                .push_next(&mut messenger);
            let instance = entry.create_instance(&create, None).unwrap();
            let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
            let (physical, family) = instance
                .enumerate_physical_devices()
                .unwrap()
                .into_iter()
                .find_map(|p| {
                    let families = instance.get_physical_device_queue_family_properties(p);
                    Some((p, families.iter().position(|f| f.queue_flags.contains(wanted))? as u32))
                })
                .unwrap();
            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
            let before = if version < vk::API_VERSION_1_3 { BEFORE_1_3 } else { &[] };
            // Of the host's own use.
            let mut semaphores =
                vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
            let timeline = (version < vk::API_VERSION_1_2).then_some(ash::khr::timeline_semaphore::NAME);
            let extensions: Vec<_> = Gpu::required_extensions()
                .iter()
                .chain(before)
                .copied()
                .chain(timeline)
                .chain(if ray_queries { RAY_QUERIES.iter().copied() } else { [].iter().copied() })
                .filter(|name| Some(*name) != extension)
                .map(CStr::as_ptr)
                .collect();
            let mut features = Gpu::required_features();
            let mut chain = match extension {
                None => features.chain(),
                // Its feature is nothing that the device knows then.
                Some(_) => vk::PhysicalDeviceFeatures2::default(),
            }
            .push_next(&mut semaphores);
            let mut structures =
                vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
            let mut queries = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
            let mut addresses =
                vk::PhysicalDeviceBufferDeviceAddressFeatures::default().buffer_device_address(true);
            if ray_queries {
                chain = chain.push_next(&mut structures).push_next(&mut queries).push_next(&mut addresses);
            }
            let create = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions)
                .push_next(&mut chain);
            let device = instance.create_device(physical, &create, None).unwrap();
            let queue = device.get_device_queue(family, 0);
            let pool = vk::CommandPoolCreateInfo::default().queue_family_index(family);
            let pool = device.create_command_pool(&pool, None).unwrap();
            Self { entry, instance, physical, device, family, queue, pool }
        }
    }

    /// Its device, with or without its queue.
    pub fn adopted(&self, queue: Option<vk::Queue>) -> Gpu {
        self.adopted_for(queue, false)
    }

    /// The same, for compute alone if asked.
    pub fn adopted_for(&self, queue: Option<vk::Queue>, compute_only: bool) -> Gpu {
        self.adopt(queue, compute_only, false).unwrap()
    }

    fn adopt(&self, queue: Option<vk::Queue>, compute_only: bool, ray_queries: bool) -> cao_gpu::Result<Gpu> {
        let adopted = Adopted {
            compute_only,
            ray_queries,
            entry: self.entry.clone(),
            instance: self.instance.clone(),
            physical_device: self.physical,
            device: self.device.clone(),
            queue_family: self.family,
            queue,
        };
        // SAFETY: the handles belong together and have what is required; tests destroy the host last and lend its queue to one thread.
        unsafe { Gpu::adopt(adopted) }
    }

    /// Whether its device is accepted.
    pub fn try_adopted(&self) -> cao_gpu::Result<Gpu> {
        self.adopt(None, false, false)
    }

    /// Its device and its queue, said to be made for ray queries.
    pub fn adopted_for_ray_queries(&self) -> cao_gpu::Result<Gpu> {
        self.adopt(Some(self.queue), false, true)
    }

    /// Its device.
    pub fn device(&self) -> &ash::Device {
        &self.device
    }

    /// Memory for an image or buffer of its own, mappable and coherent if asked.
    pub fn memory(&self, needs: vk::MemoryRequirements, mapped: bool) -> vk::DeviceMemory {
        let wanted = match mapped {
            true => vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT,
            false => vk::MemoryPropertyFlags::DEVICE_LOCAL,
        };
        // SAFETY: the calls follow Vulkan's rules.
        unsafe {
            let types = self.instance.get_physical_device_memory_properties(self.physical);
            let fits = |i: &u32| {
                needs.memory_type_bits >> i & 1 == 1
                    && types.memory_types[*i as usize].property_flags.contains(wanted)
            };
            let kind = (0..types.memory_type_count).find(fits).unwrap();
            let allocate =
                vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(kind);
            self.device.allocate_memory(&allocate, None).unwrap()
        }
    }

    /// A command buffer that is recording.
    pub fn begin(&self) -> vk::CommandBuffer {
        let allocate =
            vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        // SAFETY: the pool is alive.
        unsafe {
            let cmd = self.device.allocate_command_buffers(&allocate).unwrap()[0];
            self.device.begin_command_buffer(cmd, &Default::default()).unwrap();
            cmd
        }
    }

    /// Ends and runs them in this order.
    pub fn submit_and_wait(&self, list: &[vk::CommandBuffer]) {
        // SAFETY: the command buffers are recording and of this device.
        unsafe {
            list.iter().for_each(|cmd| self.device.end_command_buffer(*cmd).unwrap());
            let submit = [vk::SubmitInfo::default().command_buffers(list)];
            self.device.queue_submit(self.queue, &submit, vk::Fence::null()).unwrap();
            self.device.queue_wait_idle(self.queue).unwrap();
        }
    }

    /// Submits it, to run when the semaphore has this value.
    pub fn submit_after(&self, cmd: vk::CommandBuffer, semaphore: vk::Semaphore, value: u64) {
        self.submit(cmd, semaphore, value, None);
    }

    /// The same, and sets the semaphore to another value at the end.
    pub fn submit_between(&self, cmd: vk::CommandBuffer, semaphore: vk::Semaphore, after: u64, then: u64) {
        self.submit(cmd, semaphore, after, Some(then));
    }

    fn submit(&self, cmd: vk::CommandBuffer, semaphore: vk::Semaphore, after: u64, then: Option<u64>) {
        // SAFETY: the command buffer is recording and of this device, the semaphore alive.
        unsafe {
            self.device.end_command_buffer(cmd).unwrap();
            let (semaphores, after, then, commands) = ([semaphore], [after], then.as_slice(), [cmd]);
            let mut timeline = vk::TimelineSemaphoreSubmitInfo::default()
                .wait_semaphore_values(&after)
                .signal_semaphore_values(then);
            let submit = [vk::SubmitInfo::default()
                .wait_semaphores(&semaphores)
                .wait_dst_stage_mask(&[vk::PipelineStageFlags::ALL_COMMANDS])
                .signal_semaphores(&semaphores[..then.len()])
                .command_buffers(&commands)
                .push_next(&mut timeline)];
            self.device.queue_submit(self.queue, &submit, vk::Fence::null()).unwrap();
        }
    }

    /// Destroys what is its own, and asserts that the validation layer had nothing to say.
    pub fn destroy(self) {
        // SAFETY: nothing made of them is alive any more.
        unsafe {
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
        assert_eq!(*MESSAGES.lock().unwrap(), [] as [&str; 0]);
    }
}
