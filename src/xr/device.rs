//! Vulkan's instance and device, made through the runtime (`XR_KHR_vulkan_enable2`): it adds what it needs, we say what we need.

use crate::runtime::Runtime;
use anyhow::{Context, Result, anyhow, bail};
use ash::vk::{self, Handle};
use cao::gpu::{Adopted, Gpu, ValidationLog};
use openxr as xr;
use std::mem::transmute;

/// What an engine has anyway, lent to `cao`. Dropping it destroys instance and device: what was made of them goes first, the session
/// too.
pub struct Device {
    entry: ash::Entry,
    pub(crate) instance: ash::Instance,
    pub(crate) physical: vk::PhysicalDevice,
    pub(crate) raw: ash::Device,
    pub(crate) family: u32,
    pub(crate) queue: vk::Queue,
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    /// What the validation layer said.
    pub log: ValidationLog,
}

impl Device {
    /// Vulkan as the runtime has it; on request under the validation layer.
    ///
    /// # Errors
    /// No Vulkan, one that is too old for the runtime or for us, and what the device lacks.
    pub fn new(runtime: &Runtime, validate: bool) -> Result<Self> {
        let needed = runtime.instance.graphics_requirements::<xr::Vulkan>(runtime.system)?;
        if needed.min_api_version_supported > xr::Version::new(1, 3, u32::MAX) {
            bail!(
                "the OpenXR runtime wants Vulkan {}, this program speaks 1.3",
                needed.min_api_version_supported
            );
        }
        // SAFETY: the Vulkan loader is the system's own library.
        let entry = unsafe { ash::Entry::load() }.context("the Vulkan loader is missing")?;
        let log = ValidationLog::default();
        let (instance, messenger) = instance(runtime, &entry, validate.then_some(&log))?;
        // From here on the drop of `device` cleans up.
        let device = open(runtime, &entry, &instance);
        let (physical, raw, family) = device.inspect_err(|_| {
            // SAFETY: no device was made of it.
            unsafe { destroy_instance(&instance, messenger.as_ref()) }
        })?;
        // SAFETY: the device was made with one queue of this family.
        let queue = unsafe { raw.get_device_queue(family, 0) };
        Ok(Self { entry, instance, physical, raw, family, queue, messenger, log })
    }

    /// As `cao` takes it.
    pub fn lend(&self) -> Adopted {
        Adopted {
            entry: self.entry.clone(),
            instance: self.instance.clone(),
            physical_device: self.physical,
            device: self.raw.clone(),
            queue_family: self.family,
            compute_only: false,
            ray_queries: false,
            queue: Some(self.queue),
        }
    }

    /// As the runtime takes it.
    pub fn binding(&self) -> xr::vulkan::SessionCreateInfo {
        xr::vulkan::SessionCreateInfo {
            instance: self.instance.handle().as_raw() as _,
            physical_device: self.physical.as_raw() as _,
            device: self.raw.handle().as_raw() as _,
            queue_family_index: self.family,
            queue_index: 0,
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: nothing made of them is alive any more.
        unsafe {
            self.raw.destroy_device(None);
            destroy_instance(&self.instance, self.messenger.as_ref());
        }
    }
}

type Messenger = (ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT);

/// # Safety
/// Nothing made of them may be alive.
unsafe fn destroy_instance(instance: &ash::Instance, messenger: Option<&Messenger>) {
    // SAFETY: the caller's promise.
    unsafe {
        if let Some((functions, messenger)) = messenger {
            functions.destroy_debug_utils_messenger(*messenger, None);
        }
        instance.destroy_instance(None);
    }
}

/// Vulkan's function, under the type that OpenXR's headers have for it.
fn proc_addr(entry: &ash::Entry) -> xr::sys::platform::VkGetInstanceProcAddr {
    // SAFETY: both are `PFN_vkGetInstanceProcAddr`, of one signature; handles are pointers in one and a wrapped integer in the other.
    unsafe { transmute(entry.static_fn().get_instance_proc_addr) }
}

fn instance(
    runtime: &Runtime,
    entry: &ash::Entry,
    log: Option<&ValidationLog>,
) -> Result<(ash::Instance, Option<Messenger>)> {
    let application =
        vk::ApplicationInfo::default().application_name(c"cao-xr").api_version(vk::API_VERSION_1_3);
    let (mut layers, mut extensions) = (Vec::new(), Vec::new());
    let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
    let mut messages;
    let mut create = vk::InstanceCreateInfo::default().application_info(&application);
    if let Some(log) = log {
        // SAFETY: a plain query of the loader.
        let there = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
        if !there.iter().any(|layer| layer.layer_name_as_c_str() == Ok(ValidationLog::LAYER)) {
            bail!(
                "validation was asked for, but its layer is missing; on Debian or Ubuntu `apt install vulkan-validationlayers`"
            );
        }
        layers.push(ValidationLog::LAYER.as_ptr());
        extensions.push(ash::ext::debug_utils::NAME.as_ptr());
        extensions.push(vk::EXT_VALIDATION_FEATURES_NAME.as_ptr());
        messages = log.messenger();
        create = create.push_next(&mut features).push_next(&mut messages);
    }
    let create = create.enabled_layer_names(&layers).enabled_extension_names(&extensions);
    // SAFETY: `create` and what it points to live until the call returns; the log outlives the instance (`Device`).
    let made = unsafe {
        runtime.instance.create_vulkan_instance(runtime.system, proc_addr(entry), (&raw const create).cast())
    };
    let raw = made?.map_err(|code| vulkan("vkCreateInstance", code))?;
    // SAFETY: the runtime made it with this entry's functions.
    let instance = unsafe { ash::Instance::load(entry.static_fn(), vk::Instance::from_raw(raw as u64)) };
    let messenger = log.map(|log| {
        let functions = ash::ext::debug_utils::Instance::new(entry, &instance);
        // SAFETY: the log is held by `Device`, which destroys the messenger.
        let messenger = unsafe { functions.create_debug_utils_messenger(&log.messenger(), None) };
        messenger.map(|messenger| (functions, messenger))
    });
    Ok((instance, messenger.transpose().context("vkCreateDebugUtilsMessengerEXT")?))
}

/// What the call said, of a number that is no success.
fn vulkan(call: &str, code: i32) -> anyhow::Error {
    anyhow!("{call}, called by the OpenXR runtime: {}", vk::Result::from_raw(code))
}

/// The device that the headset is plugged into.
fn open(
    runtime: &Runtime,
    entry: &ash::Entry,
    instance: &ash::Instance,
) -> Result<(vk::PhysicalDevice, ash::Device, u32)> {
    // SAFETY: the instance is the one that the runtime made, and alive.
    let physical =
        unsafe { runtime.instance.vulkan_graphics_device(runtime.system, instance.handle().as_raw() as _) }?;
    let physical = vk::PhysicalDevice::from_raw(physical as u64);
    let needs = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    // SAFETY: the runtime took it from this instance.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    let family = families.iter().position(|family| family.queue_flags.contains(needs));
    let family = family.context("the headset's device has no queue that does graphics and compute")? as u32;
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
    let extensions: Vec<_> = Gpu::required_extensions().iter().map(|name| name.as_ptr()).collect();
    let mut features = Gpu::required_features();
    let mut chain = features.chain();
    let create = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .push_next(&mut chain);
    // SAFETY: `create` and what it points to live until the call returns.
    let made = unsafe {
        runtime.instance.create_vulkan_device(
            runtime.system,
            proc_addr(entry),
            physical.as_raw() as _,
            (&raw const create).cast(),
        )
    };
    let raw = made?.map_err(|code| vulkan("vkCreateDevice", code)).with_context(|| {
        let needed = Gpu::required().join("; ");
        format!("the headset's device lacks something that cao needs ({needed}); `cao devices` says what")
    })?;
    // SAFETY: the runtime made it of this instance.
    let raw = unsafe { ash::Device::load(instance.fp_v1_0(), vk::Device::from_raw(raw as u64)) };
    Ok((physical, raw, family))
}
