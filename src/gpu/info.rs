//! What there is to know about a device, and which one to take.

use super::feature;
use crate::{Error, Result};
use ash::vk;

/// A Vulkan device and the limits of it that matter here.
#[derive(Debug, Clone)]
pub struct DeviceInfo {
    /// Name as the driver gives it.
    pub name: String,
    /// Driver name and version in the driver's words.
    pub driver: String,
    /// What kind of device it is.
    pub kind: DeviceKind,
    /// Vulkan version `[major, minor, patch]`.
    pub api_version: [u32; 3],
    /// What it lacks for this crate, in words; empty for a usable device.
    pub missing: Vec<String>,
    /// Largest width and height of a 2D image, texels.
    pub max_image_2d: u32,
    /// Largest edge of a 3D image, texels.
    pub max_image_3d: u32,
    /// Most layers of an image.
    pub max_image_layers: u32,
    /// Largest buffer, bytes.
    pub max_buffer: u64,
    /// Largest part of a buffer that one storage binding can show, bytes.
    pub max_storage_range: u64,
    /// Largest part of a buffer that one uniform binding can show, bytes.
    pub max_uniform_range: u64,
    /// Most workgroups of one dispatch, x y z.
    pub max_workgroups: [u32; 3],
    /// Most invocations of one workgroup.
    pub max_invocations: u32,
    /// Largest immediate (push constant) block, bytes.
    pub max_push_bytes: u32,
    /// What the offset of a storage binding must be a multiple of, bytes.
    pub storage_alignment: u64,
    /// What the offset of a uniform binding must be a multiple of, bytes.
    pub uniform_alignment: u64,
    /// Nanoseconds of one timestamp tick.
    pub timestamp_period_ns: f64,
    /// Invocations of a subgroup.
    pub subgroup: u32,
    /// Size of the largest device-local memory heap, bytes.
    pub device_memory: u64,
}

/// Kind of a device, best first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum DeviceKind {
    /// A graphics card.
    Discrete,
    /// Shares memory with the processor.
    Integrated,
    /// Part of a virtual machine.
    Virtual,
    /// A program on the processor.
    Cpu,
    /// Says nothing of itself.
    Other,
}

impl DeviceInfo {
    pub(crate) fn of(instance: &ash::Instance, device: vk::PhysicalDevice) -> Self {
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        // Those of Vulkan 1.3 under the names that instances of 1.1 know too.
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut maintenance = vk::PhysicalDeviceMaintenance4Properties::default();
        let mut chain = vk::PhysicalDeviceProperties2::default()
            .push_next(&mut driver)
            .push_next(&mut subgroup)
            .push_next(&mut maintenance);
        // SAFETY: `device` was enumerated from `instance`; the chained structs outlive the call. Devices of older
        // versions, which do not know some, leave those zero.
        unsafe { instance.get_physical_device_properties2(device, &mut chain) };
        let properties = chain.properties;
        // SAFETY: as above.
        let memory = unsafe { instance.get_physical_device_memory_properties(device) };
        let limits = &properties.limits;
        let version = properties.api_version;
        let words =
            |s: Result<&std::ffi::CStr, _>| s.map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        Self {
            name: words(properties.device_name_as_c_str().map_err(drop)),
            driver: [
                words(driver.driver_name_as_c_str().map_err(drop)),
                words(driver.driver_info_as_c_str().map_err(drop)),
            ]
            .join(" ")
            .trim()
            .to_owned(),
            kind: match properties.device_type {
                vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
                vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
                vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
                vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
                _ => DeviceKind::Other,
            },
            api_version: [
                vk::api_version_major(version),
                vk::api_version_minor(version),
                vk::api_version_patch(version),
            ],
            missing: feature::missing(instance, device),
            max_image_2d: limits.max_image_dimension2_d,
            max_image_3d: limits.max_image_dimension3_d,
            max_image_layers: limits.max_image_array_layers,
            max_buffer: maintenance.max_buffer_size,
            max_storage_range: limits.max_storage_buffer_range.into(),
            max_uniform_range: limits.max_uniform_buffer_range.into(),
            max_workgroups: limits.max_compute_work_group_count,
            max_invocations: limits.max_compute_work_group_invocations,
            max_push_bytes: limits.max_push_constants_size,
            storage_alignment: limits.min_storage_buffer_offset_alignment,
            uniform_alignment: limits.min_uniform_buffer_offset_alignment,
            timestamp_period_ns: limits.timestamp_period.into(),
            subgroup: subgroup.subgroup_size,
            device_memory: memory
                .memory_heaps_as_slice()
                .iter()
                .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
                .map(|heap| heap.size)
                .max()
                .unwrap_or(0),
        }
    }
}

/// Index of the device to take: the wanted one (index or part of the name), or the best usable one.
pub(crate) fn choose(devices: &[DeviceInfo], wanted: Option<&str>) -> Result<usize> {
    let names =
        || devices.iter().enumerate().map(|(i, d)| format!("{i}: {}", d.name)).collect::<Vec<_>>().join(", ");
    let picked = match wanted {
        Some(wanted) => {
            let lower = wanted.to_lowercase();
            let found = match wanted.parse::<usize>() {
                Ok(index) => (index < devices.len()).then_some(index),
                Err(_) => devices.iter().position(|d| d.name.to_lowercase().contains(&lower)),
            };
            found.ok_or_else(|| Error::Device {
                problem: format!("no Vulkan device `{wanted}`; there are {}", names()),
            })?
        }
        None => devices
            .iter()
            .enumerate()
            .min_by_key(|(_, d)| (!d.missing.is_empty(), d.kind))
            .map(|(i, _)| i)
            .ok_or_else(no_device)?,
    };
    let device = &devices[picked];
    if device.missing.is_empty() {
        return Ok(picked);
    }
    Err(Error::Device {
        problem: format!("{} ({}) lacks {}", device.name, device.driver, device.missing.join(", ")),
    })
}

/// The error when no driver answers.
pub(crate) fn no_device() -> Error {
    Error::Device {
        problem: "no Vulkan device answers; install a driver, on Debian or Ubuntu `apt install mesa-vulkan-drivers`".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(name: &str, kind: DeviceKind, missing: &[&str]) -> DeviceInfo {
        DeviceInfo {
            name: name.into(),
            driver: "driver".into(),
            kind,
            api_version: [1, 3, 0],
            missing: missing.iter().map(|s| s.to_string()).collect(),
            max_image_2d: 0,
            max_image_3d: 0,
            max_image_layers: 0,
            max_buffer: 0,
            max_storage_range: 0,
            max_uniform_range: 0,
            max_workgroups: [0; 3],
            max_invocations: 0,
            max_push_bytes: 0,
            storage_alignment: 0,
            uniform_alignment: 0,
            timestamp_period_ns: 0.0,
            subgroup: 0,
            device_memory: 0,
        }
    }

    #[test]
    fn a_graphics_card_is_preferred_unless_it_lacks_something() {
        let soft = device("llvmpipe", DeviceKind::Cpu, &[]);
        let card = device("Card 5000", DeviceKind::Discrete, &[]);
        let old = device("Old Card", DeviceKind::Discrete, &["feature synchronization2"]);
        assert_eq!(choose(&[soft.clone(), old.clone(), card.clone()], None).unwrap(), 2);
        assert_eq!(choose(&[old.clone(), soft.clone()], None).unwrap(), 1);
        let message = choose(&[old], None).unwrap_err().to_string();
        assert!(message.contains("Old Card") && message.contains("synchronization2"), "{message}");
    }

    #[test]
    fn a_device_is_named_by_index_or_part_of_its_name() {
        let devices = [
            device("llvmpipe (LLVM 15)", DeviceKind::Cpu, &[]),
            device("Card 5000", DeviceKind::Discrete, &[]),
        ];
        assert_eq!(choose(&devices, Some("0")).unwrap(), 0);
        assert_eq!(choose(&devices, Some("LLVMPIPE")).unwrap(), 0);
        for wrong in ["2", "voodoo"] {
            let message = choose(&devices, Some(wrong)).unwrap_err().to_string();
            assert!(message.contains(wrong) && message.contains("1: Card 5000"), "{message}");
        }
        assert!(choose(&[], None).unwrap_err().to_string().contains("mesa-vulkan-drivers"));
    }
}
