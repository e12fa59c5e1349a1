//! The host's device, lent. Its functions are taken from the host's own loader.

use crate::edge::{answer, placed, read, versioned};
use crate::error::{CaoResult, Result, guard, refuse};
use crate::handle::{free, handle, insert};
use ash::vk::{self, Handle as _};
use cao_gpu::{Adopted, Gpu};
use std::ffi::{CStr, c_char, c_void};

/// Vulkan's own handles and types, which `vulkan_core.h` defines for C.
pub(crate) mod vulkan {
    #![allow(clippy::upper_case_acronyms, non_camel_case_types, reason = "Vulkan's names")]
    use std::ffi::{c_char, c_void};

    pub type VkInstance = *mut c_void;
    pub type VkPhysicalDevice = *mut c_void;
    pub type VkDevice = *mut c_void;
    pub type VkQueue = *mut c_void;
    pub type VkCommandBuffer = *mut c_void;
    pub type VkImage = u64;
    pub type VkFormat = i32;
    pub type VkImageLayout = i32;
    pub type VkPipelineStageFlags2 = u64;
    pub type VkAccessFlags2 = u64;
    pub type VkPhysicalDeviceFeatures2 = ash::vk::PhysicalDeviceFeatures2<'static>;
    pub type PFN_vkGetInstanceProcAddr =
        Option<unsafe extern "system" fn(ash::vk::Instance, *const c_char) -> ash::vk::PFN_vkVoidFunction>;
}
use vulkan::*;

/// A device that a host lent. 0 is none.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CaoDevice {
    /// Without meaning for a host.
    pub id: u64,
}
handle!(CaoDevice, 1, "device", Gpu);

/// What a host lends. All of it stays the host's and must outlive the CaoDevice.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoDeviceInfo {
    /// sizeof(CaoDeviceInfo).
    pub size: u32,
    /// Family of the queue that will run the recordings; it does graphics and compute.
    pub queue_family: u32,
    /// Of Vulkan 1.3 or newer; of 1.1 or 1.2 with VK_KHR_synchronization2 and VK_KHR_dynamic_rendering, and what they need, on the device.
    pub instance: VkInstance,
    /// The one that the device was made of.
    pub physical_device: VkPhysicalDevice,
    /// Made with cao_required_extensions and cao_require_features.
    pub device: VkDevice,
    /// A queue of that family for the functions that say they use one, during which nobody else may. NULL: those refuse.
    pub queue: VkQueue,
    /// The host's loader: vkGetInstanceProcAddr.
    pub get_instance_proc_addr: PFN_vkGetInstanceProcAddr,
}
versioned!(CaoDeviceInfo);

/// Names of device extensions as C has them; alive as long as the library.
struct Names(Vec<*const c_char>);
// SAFETY: they point to constants.
unsafe impl Send for Names {}
// SAFETY: as above.
unsafe impl Sync for Names {}

/// The device extensions that a host must enable: an array for VkDeviceCreateInfo, alive as long as the library.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_required_extensions(
    names: *mut *const *const c_char,
    count: *mut u32,
) -> CaoResult {
    static NAMES: std::sync::LazyLock<Names> = std::sync::LazyLock::new(|| {
        Names(Gpu::required_extensions().iter().map(|name| name.as_ptr()).collect())
    });
    guard(|| {
        // SAFETY: the header asks for it.
        unsafe { answer(count, 0, || Ok(NAMES.0.len() as u32)) }?;
        // SAFETY: as above.
        unsafe { answer(names, std::ptr::null(), || Ok(NAMES.0.as_ptr())) }
    })
}

/// Sets what this library needs to VK_TRUE in the features that a host is about to make its device with, and leaves the rest. The chain
/// must hold a VkPhysicalDeviceVulkan13Features, or the structs of synchronization2 and dynamicRendering. Whether the physical device has them is the host's to ask, or cao_device_adopt's.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_require_features(features: *mut VkPhysicalDeviceFeatures2) -> CaoResult {
    guard(|| {
        placed("VkPhysicalDeviceFeatures2", features)?;
        // SAFETY: the header asks for Vulkan's struct, which begins with a type.
        if unsafe { (*features).s_type } != vk::StructureType::PHYSICAL_DEVICE_FEATURES_2 {
            return refuse(CaoResult::BadValue, "VkPhysicalDeviceFeatures2.sType: is of another struct");
        }
        let find = |kind: vk::StructureType| {
            // SAFETY: the header asks for a chain, each of which begins with a type and the next.
            unsafe {
                let mut next = (*features).p_next.cast::<vk::BaseOutStructure<'static>>();
                while !next.is_null() && (*next).s_type != kind {
                    next = (*next).p_next;
                }
                next
            }
        };
        let v13 = find(vk::StructureType::PHYSICAL_DEVICE_VULKAN_1_3_FEATURES)
            .cast::<vk::PhysicalDeviceVulkan13Features<'static>>();
        let synchronization = find(vk::StructureType::PHYSICAL_DEVICE_SYNCHRONIZATION_2_FEATURES)
            .cast::<vk::PhysicalDeviceSynchronization2Features<'static>>();
        let rendering = find(vk::StructureType::PHYSICAL_DEVICE_DYNAMIC_RENDERING_FEATURES)
            .cast::<vk::PhysicalDeviceDynamicRenderingFeatures<'static>>();
        if v13.is_null() && (synchronization.is_null() || rendering.is_null()) {
            let what = "VkPhysicalDeviceFeatures2.pNext: holds no VkPhysicalDeviceVulkan13Features; chain one, or \
                        VkPhysicalDeviceSynchronization2Features and VkPhysicalDeviceDynamicRenderingFeatures";
            return refuse(CaoResult::BadValue, what);
        }
        let mut required = Gpu::required_features();
        let needed = required.chain().features;
        // SAFETY: structs of the types that they say they are. Those of 1.0 are numbers of 32 bits and nothing else. What is required of
        // 1.3 is these two (`what_is_required_is_in_two_structs`), which may not stand in both places.
        unsafe {
            raise((&raw const needed).cast(), (&raw mut (*features).features).cast());
            if v13.is_null() {
                (*synchronization).synchronization2 = vk::TRUE;
                (*rendering).dynamic_rendering = vk::TRUE;
            } else {
                (*v13).synchronization2 = vk::TRUE;
                (*v13).dynamic_rendering = vk::TRUE;
            }
        }
        Ok(())
    })
}

/// Sets every feature that is needed.
///
/// # Safety
/// Both point to the features of Vulkan 1.0.
unsafe fn raise(needed: *const vk::Bool32, host: *mut vk::Bool32) {
    for i in 0..size_of::<vk::PhysicalDeviceFeatures>() / size_of::<vk::Bool32>() {
        // SAFETY: the caller's promise.
        unsafe {
            if *needed.add(i) == vk::TRUE {
                host.add(i).write(vk::TRUE);
            }
        }
    }
}

/// Functions without which loading or adopting cannot be asked about; where one is missing, what was lent does not belong together.
const OF_INSTANCE: [&CStr; 4] = [
    c"vkGetDeviceProcAddr",
    c"vkGetPhysicalDeviceFeatures2",
    c"vkGetPhysicalDeviceProperties2",
    c"vkGetPhysicalDeviceQueueFamilyProperties",
];

/// Lends a device. Nothing of the host's is ever destroyed. Free it with cao_device_free when all that is on it is freed, and before the
/// host destroys what it lent.
// SAFETY: the name is ours alone; pointers are as the header asks, Vulkan's handles valid and of each other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_device_adopt(info: *const CaoDeviceInfo, device: *mut CaoDevice) -> CaoResult {
    let make = || {
        // SAFETY: the header asks for it.
        let info = unsafe { read(info) }?;
        // SAFETY: the header asks for it.
        Ok(insert(unsafe { adopt(&info) }?, 0))
    };
    // SAFETY: the header asks for it.
    guard(|| unsafe { answer(device, CaoDevice { id: 0 }, make) })
}

/// # Safety
/// As [`Gpu::adopt`].
unsafe fn adopt(info: &CaoDeviceInfo) -> Result<Gpu> {
    let null = |what: &str| refuse(CaoResult::NullPointer, format!("CaoDeviceInfo.{what}: is NULL"));
    let Some(get_instance_proc_addr) = info.get_instance_proc_addr else {
        return null("get_instance_proc_addr");
    };
    for (pointer, what) in
        [(info.instance, "instance"), (info.physical_device, "physical_device"), (info.device, "device")]
    {
        if pointer.is_null() {
            return null(what);
        }
    }
    let raw = |pointer: *mut c_void| pointer as u64;
    let instance = vk::Instance::from_raw(raw(info.instance));
    let physical_device = vk::PhysicalDevice::from_raw(raw(info.physical_device));
    for name in OF_INSTANCE {
        // SAFETY: the host's function and instance. What is missing would be found out by a call that cannot return.
        if unsafe { get_instance_proc_addr(instance, name.as_ptr()) }.is_none() {
            let what = format!("CaoDeviceInfo.get_instance_proc_addr: has no {name:?} for this instance");
            return refuse(CaoResult::Device, what);
        }
    }
    // SAFETY: the loader, the instance and the device are alive and belong together, by the caller's promise.
    let (entry, instance, device) = unsafe {
        let entry = ash::Entry::from_static_fn(ash::StaticFn { get_instance_proc_addr });
        let instance = ash::Instance::load(entry.static_fn(), instance);
        let device = vk::Device::from_raw(raw(info.device));
        let device = ash::Device::load(instance.fp_v1_0(), device);
        (entry, instance, device)
    };
    // SAFETY: the physical device is of this instance.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical_device) };
    let needed = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    if !families.get(info.queue_family as usize).is_some_and(|family| family.queue_flags.contains(needed)) {
        let (family, count) = (info.queue_family, families.len());
        let what = format!(
            "CaoDeviceInfo.queue_family: {family} of {count}; expected one with graphics and compute"
        );
        return refuse(CaoResult::BadValue, what);
    }
    let queue = (!info.queue.is_null()).then(|| vk::Queue::from_raw(raw(info.queue)));
    let queue_family = info.queue_family;
    let adopted = Adopted {
        entry,
        instance,
        physical_device,
        device,
        queue_family,
        compute_only: false,
        ray_queries: false,
        queue,
    };
    // SAFETY: the caller's promise.
    Ok(unsafe { Gpu::adopt(adopted) }?)
}

/// Gives a device back: from here on nothing of the host's is used. Refused while anything is on it.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_device_free(device: CaoDevice) -> CaoResult {
    guard(|| free(device))
}
