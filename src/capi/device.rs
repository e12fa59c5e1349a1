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
    /// Of Vulkan 1.3 or newer.
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
/// must hold a VkPhysicalDeviceVulkan13Features. Whether the physical device has them is the host's to ask, or cao_device_adopt's.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_require_features(features: *mut VkPhysicalDeviceFeatures2) -> CaoResult {
    guard(|| {
        placed("VkPhysicalDeviceFeatures2", features)?;
        // SAFETY: the header asks for Vulkan's struct, each of whose chain begins with a type and the next.
        let (core, v13) = unsafe {
            if (*features).s_type != vk::StructureType::PHYSICAL_DEVICE_FEATURES_2 {
                let what = "VkPhysicalDeviceFeatures2.sType: is of another struct";
                return refuse(CaoResult::BadValue, what);
            }
            let mut next = (*features).p_next.cast::<vk::BaseOutStructure<'static>>();
            while !next.is_null() && (*next).s_type != vk::StructureType::PHYSICAL_DEVICE_VULKAN_1_3_FEATURES
            {
                next = (*next).p_next;
            }
            (&raw mut (*features).features, next.cast::<vk::PhysicalDeviceVulkan13Features<'static>>())
        };
        if v13.is_null() {
            let what =
                "VkPhysicalDeviceFeatures2.pNext: holds no VkPhysicalDeviceVulkan13Features; chain one";
            return refuse(CaoResult::BadValue, what);
        }
        let mut required = Gpu::required_features();
        let chain = required.chain();
        let needed = chain.p_next.cast::<vk::PhysicalDeviceVulkan13Features<'static>>();
        // SAFETY: the chain of what is required is these two structs (`what_is_required_is_in_two_structs`), which are Vulkan's: from the
        // first feature to the last there are numbers of 32 bits and nothing else.
        unsafe {
            raise(
                (&raw const chain.features).cast(),
                core.cast(),
                size_of::<vk::PhysicalDeviceFeatures>() / 4,
            );
            let first = |of: *const vk::PhysicalDeviceVulkan13Features<'static>| of.byte_add(FIRST_OF_13);
            raise(first(needed).cast(), first(v13).cast_mut().cast(), COUNT_OF_13);
        }
        Ok(())
    })
}

/// Sets every feature that is needed.
///
/// # Safety
/// Both point to so many.
unsafe fn raise(needed: *const vk::Bool32, host: *mut vk::Bool32, count: usize) {
    for i in 0..count {
        // SAFETY: the caller's promise.
        unsafe {
            if *needed.add(i) == vk::TRUE {
                host.add(i).write(vk::TRUE);
            }
        }
    }
}

/// Where the features of Vulkan 1.3 begin, and how many there are up to `maintenance4`.
const FIRST_OF_13: usize =
    std::mem::offset_of!(vk::PhysicalDeviceVulkan13Features<'static>, robust_image_access);
const COUNT_OF_13: usize =
    (std::mem::offset_of!(vk::PhysicalDeviceVulkan13Features<'static>, maintenance4) - FIRST_OF_13) / 4 + 1;

/// Functions without which loading or adopting cannot be asked about; where one is missing, what was lent does not belong together.
const OF_INSTANCE: [&CStr; 4] = [
    c"vkGetDeviceProcAddr",
    c"vkGetPhysicalDeviceFeatures2",
    c"vkGetPhysicalDeviceProperties2",
    c"vkGetPhysicalDeviceQueueFamilyProperties",
];

/// Of 1.3, and of the extension.
const OF_DEVICE: [(&CStr, &str); 3] = [
    (c"vkCmdPipelineBarrier2", "Vulkan 1.3"),
    (c"vkCmdBeginRendering", "Vulkan 1.3"),
    (c"vkCmdPushDescriptorSetKHR", "VK_KHR_push_descriptor"),
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
        for (name, of) in OF_DEVICE {
            if instance.get_device_proc_addr(device, name.as_ptr()).is_none() {
                let what = format!("CaoDeviceInfo.device: has no {name:?}; make it with {of} enabled");
                return refuse(CaoResult::Device, what);
            }
        }
        (entry, instance.clone(), ash::Device::load(instance.fp_v1_0(), device))
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
    // SAFETY: the caller's promise.
    let gpu =
        unsafe { Gpu::adopt(Adopted { entry, instance, physical_device, device, queue_family, queue }) };
    Ok(gpu?)
}

/// Gives a device back: from here on nothing of the host's is used. Refused while anything is on it.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_device_free(device: CaoDevice) -> CaoResult {
    guard(|| free(device))
}
