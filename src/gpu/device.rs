//! The device: opened by us, or adopted from a host that owns it.

use super::{
    acceleration::Rays,
    counts::Counts,
    feature::{self, API_VERSION, EXTENSIONS, Features, RAY_QUERIES, RayQueries},
    format::{Format, VulkanFormat},
    hazard::{Hazards, ResourceId},
    idle::Idle,
    info::{DeviceInfo, choose, no_device},
    memory::Memory,
    pipeline::PipelineInner,
    validation::ValidationLog,
};
use crate::{Error, Result};
use ash::vk::{self, Handle};
use std::{
    collections::HashMap,
    ffi::{CStr, CString},
    mem::ManuallyDrop,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError, Weak,
        atomic::{AtomicU64, Ordering},
    },
};

/// A Vulkan device. Cheap to clone; everything made with it keeps it alive.
#[derive(Clone)]
pub struct Gpu(pub(crate) Arc<Inner>);

/// How to open a device.
#[derive(Debug, Clone, Default)]
pub struct OpenOptions {
    /// Index in [`Gpu::list`] or part of the device's name, any case; else the environment variable `CAO_DEVICE`; else the best.
    pub device: Option<String>,
    /// Run under the validation layer, with synchronization checks; also on when the environment has `CAO_VALIDATION=1`. The layer checks
    /// across submits only if the environment has `VK_LAYER_ENABLES` as `.cargo/config.toml` sets it, which this never does: other threads
    /// may be reading the environment.
    pub validation: bool,
    /// Do without all that is optional ([`Gpu::optional`]), as on a device that has none of it.
    pub plain: bool,
}

/// Handles of a host that already uses Vulkan. They stay the host's: nothing here ever destroys them.
pub struct Adopted {
    /// Loader.
    pub entry: ash::Entry,
    /// Instance of Vulkan 1.1 or newer. One below 1.3 hides from the device what is of 1.3: then it needs the extensions of
    /// [`feature::BEFORE_1_3`](crate::feature::BEFORE_1_3) and their features.
    pub instance: ash::Instance,
    /// Device that `device` was made of.
    pub physical_device: vk::PhysicalDevice,
    /// Device with [`Gpu::required_extensions`] and [`Gpu::required_features`] enabled.
    pub device: ash::Device,
    /// Family of the queue that will run the recorded commands; must do compute. Where it does no graphics, nothing can be drawn into
    /// attachments, which the host does itself with what [`Recorder`](crate::Recorder) makes, and meshes cannot clip; both are refused by name.
    pub queue_family: u32,
    /// Do without graphics even where the family has them.
    pub compute_only: bool,
    /// The device was made with the extensions of [`feature::RAY_QUERIES`](crate::feature::RAY_QUERIES) and their features, which are
    /// used then.
    pub ray_queries: bool,
    /// A queue of that family lent to the calls that say they use one (uploads, read-backs): during such a call
    /// nobody else may use it. `None`: those calls refuse, and recording into the host's command buffers is all there is.
    pub queue: Option<vk::Queue>,
}

/// What everything made with a [`Gpu`] shares.
pub(crate) struct Inner {
    pub memory: ManuallyDrop<Memory>,
    pub device: ash::Device,
    /// Calls of Vulkan 1.3, by whichever name the device has them.
    pub v13: ash::DeviceFnV1_3,
    pub push_descriptor: ash::khr::push_descriptor::Device,
    /// Names and labels, if the instance has them.
    pub debug: Option<ash::ext::debug_utils::Device>,
    /// What acceleration structures need, if the device was made for ray queries.
    pub rays: Option<Rays>,
    /// Locked for submission; `None` for an adopted device, whose queue is the host's.
    pub queue: Option<Mutex<vk::Queue>>,
    pub queue_family: u32,
    /// Commands may draw.
    pub graphics: bool,
    /// What is optional is not used.
    pub plain: bool,
    /// Valid bits of a timestamp; 0 if the queue has none.
    pub timestamp_mask: u64,
    pub info: DeviceInfo,
    pub physical: vk::PhysicalDevice,
    pub instance: ash::Instance,
    pub log: ValidationLog,
    hazards: Mutex<Hazards>,
    /// What the next recording finds ready.
    pub idle: Idle,
    counts: Mutex<Counts>,
    /// Compute pipelines that are in use, by shader (its address, for all are static) and entry point.
    pipelines: Mutex<HashMap<(usize, String), Weak<PipelineInner>>>,
    /// What to destroy at the end; `None` for an adopted device.
    owned: Option<Owned>,
    /// The loaded library, which all function pointers point into.
    _entry: ash::Entry,
}

/// Marks device and instance as ours.
struct Owned {
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
}

/// Turns a Vulkan result into our error.
pub(crate) fn vulkan(call: &'static str, object: &str) -> impl FnOnce(vk::Result) -> Error {
    move |result| Error::Vulkan { call, object: object.into(), result }
}

/// An instance of ours.
struct Instance {
    entry: ash::Entry,
    instance: ash::Instance,
    /// The instance has VK_EXT_debug_utils.
    debug: bool,
}

impl Instance {
    fn new(validation: Option<&ValidationLog>) -> Result<Self> {
        // SAFETY: loading the Vulkan loader runs its initialisers; it is the system's own library.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| Error::Device {
            problem: format!("the Vulkan loader is missing ({e}); install it, on Debian or Ubuntu `apt install libvulkan1 mesa-vulkan-drivers`"),
        })?;
        // SAFETY: plain queries of the loader.
        let (version, extensions, layers) = unsafe {
            (
                entry.try_enumerate_instance_version().ok().flatten().unwrap_or(vk::API_VERSION_1_0),
                entry.enumerate_instance_extension_properties(None).unwrap_or_default(),
                entry.enumerate_instance_layer_properties().unwrap_or_default(),
            )
        };
        if version < API_VERSION {
            let (major, minor) = (vk::api_version_major(version), vk::api_version_minor(version));
            return Err(Error::Device {
                problem: format!(
                    "the Vulkan loader is of version {major}.{minor}, needed is 1.3; update libvulkan1"
                ),
            });
        }
        let debug = extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(ash::ext::debug_utils::NAME));
        let mut names = Vec::new();
        let mut layer_names = Vec::new();
        if debug {
            names.push(ash::ext::debug_utils::NAME.as_ptr());
        }
        let application = vk::ApplicationInfo::default().application_name(c"cao").api_version(API_VERSION);
        let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
        let mut messenger;
        let mut create = vk::InstanceCreateInfo::default().application_info(&application);
        if let Some(log) = validation {
            if !layers.iter().any(|l| l.layer_name_as_c_str() == Ok(ValidationLog::LAYER)) {
                return Err(Error::Device {
                    problem: "validation was asked for, but its layer is missing; install it, on Debian or Ubuntu `apt install vulkan-validationlayers`".into(),
                });
            }
            layer_names.push(ValidationLog::LAYER.as_ptr());
            names.push(vk::EXT_VALIDATION_FEATURES_NAME.as_ptr());
            messenger = log.messenger();
            create = create.push_next(&mut features).push_next(&mut messenger);
        }
        create = create.enabled_extension_names(&names).enabled_layer_names(&layer_names);
        // SAFETY: `create` and what it points to live until the call returns; the log outlives the instance (see `messenger`).
        let instance = unsafe { entry.create_instance(&create, None) }.map_err(|result| match result {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => no_device(),
            result => Error::Vulkan { call: "vkCreateInstance", object: "instance".into(), result },
        })?;
        Ok(Self { entry, instance, debug })
    }

    fn devices(&self) -> Result<Vec<(vk::PhysicalDevice, DeviceInfo)>> {
        // SAFETY: the instance is alive.
        let list = unsafe { self.instance.enumerate_physical_devices() };
        let list = list.map_err(vulkan("vkEnumeratePhysicalDevices", "instance"))?;
        Ok(list.into_iter().map(|device| (device, DeviceInfo::of(&self.instance, device))).collect())
    }

    /// # Safety
    /// Nothing made of the instance may be alive.
    unsafe fn destroy(&self) {
        // SAFETY: the caller's promise.
        unsafe { self.instance.destroy_instance(None) }
    }
}

impl Gpu {
    /// All Vulkan devices, in the order of their indices, usable or not (see [`DeviceInfo::missing`]).
    ///
    /// # Errors
    /// [`Error::Device`] if there is no loader or no driver.
    pub fn list() -> Result<Vec<DeviceInfo>> {
        let instance = Instance::new(None)?;
        let devices = instance.devices();
        // SAFETY: nothing was made of it.
        unsafe { instance.destroy() };
        Ok(devices?.into_iter().map(|(_, info)| info).collect())
    }

    /// Opens a device of our own with one queue.
    ///
    /// # Errors
    /// [`Error::Device`] if loader, driver, the wanted device, a required feature or the validation layer is missing, with the remedy.
    pub fn open(options: &OpenOptions) -> Result<Self> {
        let environment = |key| std::env::var(key).ok().filter(|value| !value.is_empty());
        let validation =
            options.validation || environment("CAO_VALIDATION").is_some_and(|value| value != "0");
        let wanted = options.device.clone().or_else(|| environment("CAO_DEVICE"));
        let log = ValidationLog::default();
        let instance = Instance::new(validation.then_some(&log))?;
        let device = Self::create_device(&instance, wanted.as_deref(), options.plain);
        let (physical, info, device, family, ray_queries) = device.inspect_err(|_| {
            // SAFETY: no device was made of it.
            unsafe { instance.destroy() }
        })?;
        let Instance { entry, instance, debug } = instance;
        let messenger = validation.then(|| {
            let messages = ash::ext::debug_utils::Instance::new(&entry, &instance);
            // SAFETY: the log is held by `Inner`, which destroys the messenger.
            let messenger = unsafe { messages.create_debug_utils_messenger(&log.messenger(), None) };
            // Without it validation would be mute and seem content.
            (
                messages,
                messenger
                    .inspect_err(|e| log.keep("vkCreateDebugUtilsMessengerEXT", &e.to_string()))
                    .unwrap_or_default(),
            )
        });
        // SAFETY: the device was created with one queue of this family.
        let queue = unsafe { device.get_device_queue(family, 0) };
        let queue = Some(queue);
        let parts = Parts {
            entry,
            instance,
            physical,
            info,
            device,
            family,
            queue,
            debug,
            log,
            compute_only: false,
            ray_queries,
            plain: options.plain,
        };
        // `Inner` owns all from here on; what fails inside destroys nothing of it, so that is done here.
        parts.build(Some(Owned { messenger }))
    }

    fn create_device(
        instance: &Instance,
        wanted: Option<&str>,
        plain: bool,
    ) -> Result<(vk::PhysicalDevice, DeviceInfo, ash::Device, u32, bool)> {
        let mut devices = instance.devices()?;
        let infos: Vec<_> = devices.iter().map(|(_, info)| info.clone()).collect();
        let (physical, info) = devices.swap_remove(choose(&infos, wanted)?);
        let needs = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
        // SAFETY: `physical` was enumerated from this instance.
        let families = unsafe { instance.instance.get_physical_device_queue_family_properties(physical) };
        let family = families.iter().position(|f| f.queue_flags.contains(needs)).ok_or_else(|| {
            Error::Device { problem: format!("{} has no queue that does graphics and compute", info.name) }
        })? as u32;
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
        let ray_queries = !plain && RayQueries::of(&instance.instance, physical);
        let of_rays = if ray_queries { RAY_QUERIES } else { &[] };
        let names: Vec<_> = EXTENSIONS.iter().chain(of_rays).map(|name| name.as_ptr()).collect();
        let mut features = Features::required();
        let mut chain = features.chain();
        let mut rays = RayQueries::enabled();
        let mut create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&names)
            .push_next(&mut chain);
        if ray_queries {
            create = rays.push(create);
        }
        // SAFETY: `create` and what it points to live until the call returns; features and extensions were checked by `choose` and above.
        let device = unsafe { instance.instance.create_device(physical, &create, None) };
        let device = device.map_err(vulkan("vkCreateDevice", &info.name))?;
        Ok((physical, info.clone(), device, family, ray_queries))
    }

    /// Uses a host's device. Commands go through [`Gpu::record_into`] into the host's command buffers and nothing submits or waits, except
    /// calls that say so, on the queue that the host lent; without one, [`Gpu::recorder`] refuses.
    ///
    /// # Safety
    /// The handles must be valid and belong together, be made with what [`Gpu::required`] lists ([`Gpu::required_extensions`],
    /// [`Gpu::required_features`]), and stay alive until this `Gpu` and all that was made with it are dropped. A lent queue must not be used by others during calls that
    /// use it.
    ///
    /// # Errors
    /// [`Error::Device`] if the physical device lacks something that is needed, the device was made without an extension, or the queue's
    /// family does not compute. Whether features were enabled nobody can ask a device: [`Gpu::on_trust`] lists what was not checked.
    pub unsafe fn adopt(host: Adopted) -> Result<Self> {
        let info = DeviceInfo::of(&host.instance, host.physical_device);
        choose(std::slice::from_ref(&info), None)?;
        let parts = Parts {
            entry: host.entry,
            instance: host.instance,
            physical: host.physical_device,
            info,
            device: host.device,
            family: host.queue_family,
            queue: host.queue,
            debug: false,
            log: ValidationLog::default(),
            compute_only: host.compute_only,
            ray_queries: host.ray_queries,
            plain: false,
        };
        parts.build(None)
    }

    /// What an adopted device must be made with, in words, each with the reason.
    pub fn required() -> Vec<String> {
        feature::required()
    }

    /// What is used where a device has it, in words, each with what happens without.
    pub fn optional() -> Vec<String> {
        feature::optional()
    }

    /// What [`Gpu::adopt`] could not check and took on trust, in words; empty for a device of our own.
    pub fn on_trust(&self) -> Vec<String> {
        if self.0.owned.is_some() { Vec::new() } else { feature::on_trust(self.ray_queries()) }
    }

    /// Device extensions that an adopted device must have.
    pub fn required_extensions() -> &'static [&'static CStr] {
        EXTENSIONS
    }

    /// Features that an adopted device must have.
    pub fn required_features() -> Features {
        Features::required()
    }

    /// What is known about the device.
    pub fn info(&self) -> &DeviceInfo {
        &self.0.info
    }

    /// Whether images of this format can be sampled with linear filtering here.
    pub fn filters(&self, format: Format) -> bool {
        self.may(format) && feature::filters(&self.0.instance, self.0.physical, format.vk())
    }

    /// Whether kernels can read and write images of this format.
    pub fn stores(&self, format: Format) -> bool {
        self.may(format) && feature::stores(&self.0.instance, self.0.physical, format.vk())
    }

    /// Whether this format may be used at all: those of 16-bit UNORM are optional.
    fn may(&self, format: Format) -> bool {
        !self.0.plain || !matches!(format, Format::R16Unorm | Format::Rgba16Unorm)
    }

    /// Whether all that is optional is done without ([`OpenOptions::plain`]).
    pub fn plain(&self) -> bool {
        self.0.plain
    }

    /// Whether kernels may query rays here: [`Gpu::acceleration_structure`].
    pub fn ray_queries(&self) -> bool {
        self.0.rays.is_some()
    }

    /// Messages of the validation layer so far; empty without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        self.0.log.messages()
    }

    /// The log behind [`Gpu::validation_messages`], readable after this `Gpu` is gone.
    pub fn validation_log(&self) -> ValidationLog {
        self.0.log.clone()
    }

    /// An error that holds all messages of the validation layer, if there are any.
    ///
    /// # Errors
    /// [`Error::Device`] with the messages.
    pub fn assert_clean(&self) -> Result<()> {
        self.0.log.assert_clean()
    }

    /// Commands, barriers, calls and submissions of all recordings so far that were submitted or handed to the host.
    pub fn counts(&self) -> Counts {
        *self.0.counts()
    }

    /// Name and bytes of every buffer and image that is alive, sorted by name.
    pub fn memory_report(&self) -> Vec<(String, u64)> {
        self.0.memory.report()
    }

    /// Has all allocations of device memory fail after `count` more, as if the device had no memory left; `None` ends that. For hosts
    /// that want to know how they bear it.
    pub fn fail_after(&self, count: Option<u32>) {
        self.0.memory.fail_after(count);
    }

    /// Most bytes that buffers and images held at once.
    pub fn memory_peak(&self) -> u64 {
        self.0.memory.peak()
    }
}

/// What [`Inner`] is put together from.
struct Parts {
    entry: ash::Entry,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    info: DeviceInfo,
    device: ash::Device,
    family: u32,
    queue: Option<vk::Queue>,
    debug: bool,
    log: ValidationLog,
    compute_only: bool,
    ray_queries: bool,
    plain: bool,
}

/// Calls of Vulkan 1.3, and whether the device has all that is used: an instance below 1.3 hides them behind the names that they had as
/// extensions.
fn calls(instance: &ash::Instance, device: &ash::Device) -> Result<ash::DeviceFnV1_3> {
    let address = |name: &CStr| {
        // SAFETY: instance and device are alive and belong together.
        unsafe { instance.get_device_proc_addr(device.handle(), name.as_ptr()) }
    };
    let either = |name: &CStr| {
        let extension = || CString::new([name.to_bytes(), b"KHR"].concat()).ok();
        address(name).or_else(|| extension().and_then(|name| address(&name)))
    };
    for (name, of) in feature::CALLS {
        if either(name).is_none() {
            let problem = format!(
                "the device has no {}; make it with {of}, see Gpu::required_extensions and feature::BEFORE_1_3",
                name.to_string_lossy()
            );
            return Err(Error::Device { problem });
        }
    }
    Ok(ash::DeviceFnV1_3::load(|name| either(name).map_or(std::ptr::null(), |call| call as *const _)))
}

impl Parts {
    fn build(self, owned: Option<Owned>) -> Result<Gpu> {
        let Self { entry, instance, physical, info, device, family, queue, debug, log, .. } = self;
        let Self { compute_only, ray_queries, plain, .. } = self;
        // SAFETY: `physical` was enumerated from this instance.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
        let does = families.get(family as usize).map_or(vk::QueueFlags::empty(), |f| f.queue_flags);
        let bits = families.get(family as usize).map_or(0, |f| f.timestamp_valid_bits) * u32::from(!plain);
        let computes = || match does.contains(vk::QueueFlags::COMPUTE) {
            true => Ok(()),
            false => {
                let problem =
                    format!("queue family {family} of {} does not compute; choose one that does", info.name);
                Err(Error::Device { problem })
            }
        };
        let made = computes().and_then(|()| {
            let rays = ray_queries.then(|| Rays::new(&instance, physical, &device)).transpose()?;
            let memory = Memory::new(&instance, physical, &device, ray_queries)?;
            Ok((calls(&instance, &device)?, memory, rays))
        });
        let (v13, memory, rays) = match made {
            Ok(made) => made,
            Err(error) => {
                if let Some(owned) = owned {
                    // SAFETY: nothing was made of the device, and it is ours.
                    unsafe { destroy(&device, &instance, owned) };
                }
                return Err(error);
            }
        };
        Ok(Gpu(Arc::new(Inner {
            memory: ManuallyDrop::new(memory),
            push_descriptor: ash::khr::push_descriptor::Device::new(&instance, &device),
            debug: (debug && !plain).then(|| ash::ext::debug_utils::Device::new(&instance, &device)),
            queue: queue.map(Mutex::new),
            queue_family: family,
            graphics: does.contains(vk::QueueFlags::GRAPHICS) && !compute_only,
            plain,
            rays,
            v13,
            timestamp_mask: u64::MAX.checked_shr(64 - bits).unwrap_or(0),
            info,
            physical,
            log,
            hazards: Mutex::default(),
            pipelines: Mutex::default(),
            idle: Idle::default(),
            counts: Mutex::default(),
            owned,
            _entry: entry,
            device,
            instance,
        })))
    }
}

impl Inner {
    /// What is pending on all resources.
    pub fn hazards(&self) -> MutexGuard<'_, Hazards> {
        self.hazards.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What was asked of Vulkan so far.
    pub fn counts(&self) -> MutexGuard<'_, Counts> {
        self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Compute pipelines that are in use.
    pub fn pipelines(&self) -> MutexGuard<'_, HashMap<(usize, String), Weak<PipelineInner>>> {
        self.pipelines.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A number that no other resource of any device has or had.
    pub fn new_id() -> ResourceId {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        NEXT.fetch_add(1, Ordering::Relaxed)
    }

    /// Names an object for debuggers and for the validation layer's messages.
    pub fn set_name(&self, object: impl Handle, name: &str) {
        let Some(debug) = &self.debug else { return };
        // A name with a zero byte inside cannot be passed on, and is only a name.
        let Ok(name) = CString::new(name) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
        // SAFETY: the object is of this device and alive, as the caller has just made it. A failure loses the name only.
        let _ = unsafe { debug.set_debug_utils_object_name(&info) };
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        // SAFETY: dropped once, here, before the device whose memory it frees. Everything made with the device holds an `Arc` of
        // this and so is gone.
        unsafe {
            self.idle.destroy(&self.device);
            ManuallyDrop::drop(&mut self.memory);
        }
        if let Some(owned) = self.owned.take() {
            // SAFETY: as above; the handles are ours.
            unsafe { destroy(&self.device, &self.instance, owned) };
        }
    }
}

/// # Safety
/// The handles must be ours and nothing made of them alive.
unsafe fn destroy(device: &ash::Device, instance: &ash::Instance, owned: Owned) {
    // SAFETY: the caller's promise; children go before parents.
    unsafe {
        device.destroy_device(None);
        if let Some((messages, messenger)) = owned.messenger {
            messages.destroy_debug_utils_messenger(messenger, None);
        }
        instance.destroy_instance(None);
    }
}
