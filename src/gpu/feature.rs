//! What a device must have: one table that drives the check, the enabling and the documentation.

use ash::vk;
use std::ffi::CStr;

/// Lowest Vulkan version of loader and device.
pub const API_VERSION: u32 = vk::API_VERSION_1_3;

/// Device extensions in use.
pub const EXTENSIONS: &[&CStr] = &[ash::khr::push_descriptor::NAME];

/// Extensions that a device needs beside whose instance is of Vulkan 1.1 or 1.2: what 1.3 took up from them is hidden there. Their features
/// `synchronization2` and `dynamicRendering` are enabled by their own structs.
pub const BEFORE_1_3: &[&CStr] = &[
    ash::khr::synchronization2::NAME,
    ash::khr::dynamic_rendering::NAME,
    ash::khr::depth_stencil_resolve::NAME,
    ash::khr::create_renderpass2::NAME,
];

/// Extensions of ray queries. Their features are `accelerationStructure`, `rayQuery` and, of Vulkan 1.2, `bufferDeviceAddress`.
pub const RAY_QUERIES: &[&CStr] = &[
    ash::khr::acceleration_structure::NAME,
    ash::khr::deferred_host_operations::NAME,
    ash::khr::ray_query::NAME,
];

/// Calls in use that are not of Vulkan 1.1, and what brings them.
pub(crate) const CALLS: &[(&CStr, &str)] = &[
    (c"vkCmdPushDescriptorSetKHR", "VK_KHR_push_descriptor"),
    (c"vkCmdPipelineBarrier2", "Vulkan 1.3 or VK_KHR_synchronization2"),
    (c"vkCmdWriteTimestamp2", "Vulkan 1.3 or VK_KHR_synchronization2"),
    (c"vkQueueSubmit2", "Vulkan 1.3 or VK_KHR_synchronization2"),
    (c"vkCmdBeginRendering", "Vulkan 1.3 or VK_KHR_dynamic_rendering"),
];

/// What is used where a device has it, and what happens without.
const OPTIONAL: &[(&str, &str)] = &[
    ("filtering of R16_UNORM", "16-bit values become floats, twice the memory"),
    ("storage images of R16_UNORM", "no rays by brick; the methods cao and lao remain"),
    (
        "8-bit filtering that keeps fractions",
        "values of 8 bits are interpolated in the ray cast, which takes longer",
    ),
    ("timestamps of the queue", "stages have no times"),
    ("a queue of graphics", "pictures only, which the host presents; no clip meshes"),
    ("VK_EXT_debug_utils, on a device of our own", "objects have no names in a debugger"),
    (
        "VK_KHR_ray_query and VK_KHR_acceleration_structure, enabled by us or as Adopted::ray_queries says",
        "rays through meshes walk a tree of ours",
    ),
];

/// The required, in words.
pub(crate) fn required() -> Vec<String> {
    let mut words = vec!["a device of Vulkan 1.3, an instance of 1.1 or newer (all that follows)".to_owned()];
    words.extend(EXTENSIONS.iter().map(|e| format!("extension {} (bindings)", e.to_string_lossy())));
    words.extend(FEATURES.iter().map(|f| format!("feature {} ({})", f.name, f.why)));
    let before = BEFORE_1_3.iter().map(|e| e.to_string_lossy()).collect::<Vec<_>>().join(", ");
    words.push(format!("with an instance below 1.3 also {before} (what 1.3 took up from them)"));
    words
}

/// The optional, in words.
pub(crate) fn optional() -> Vec<String> {
    OPTIONAL.iter().map(|(what, without)| format!("{what} (without: {without})")).collect()
}

/// What no call tells of a device.
pub(crate) fn on_trust(ray_queries: bool) -> Vec<String> {
    let features = FEATURES.iter().map(|f| (f.name, f.why));
    let of_rays = ["accelerationStructure", "rayQuery", "bufferDeviceAddress"];
    let of_rays = of_rays.into_iter().filter(|_| ray_queries).map(|name| (name, "ray queries"));
    let enabled = features.chain(of_rays).map(|(name, why)| format!("feature {name} was enabled ({why})"));
    let others =
        ["handles belong together and outlive what is made of them", "nobody else uses a lent queue"];
    enabled.chain(others.map(str::to_owned)).collect()
}

/// Feature structs of ray queries, to be asked for or enabled.
#[derive(Default)]
pub(crate) struct RayQueries {
    structures: vk::PhysicalDeviceAccelerationStructureFeaturesKHR<'static>,
    queries: vk::PhysicalDeviceRayQueryFeaturesKHR<'static>,
    addresses: vk::PhysicalDeviceBufferDeviceAddressFeatures<'static>,
}

impl RayQueries {
    /// What [`Self::push`] enables.
    pub fn enabled() -> Self {
        Self {
            structures: vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default()
                .acceleration_structure(true),
            queries: vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true),
            addresses: vk::PhysicalDeviceBufferDeviceAddressFeatures::default().buffer_device_address(true),
        }
    }

    /// The structs added to what `vkCreateDevice` takes.
    pub fn push<'a>(&'a mut self, create: vk::DeviceCreateInfo<'a>) -> vk::DeviceCreateInfo<'a> {
        create.push_next(&mut self.structures).push_next(&mut self.queries).push_next(&mut self.addresses)
    }

    /// Whether a device has all of it. Those without the extensions must not be asked for their features.
    pub fn of(instance: &ash::Instance, device: vk::PhysicalDevice) -> bool {
        let extensions = extensions(instance, device);
        if !RAY_QUERIES.iter().all(|wanted| has(&extensions, wanted)) {
            return false;
        }
        let mut found = Self::default();
        let mut chain = vk::PhysicalDeviceFeatures2::default()
            .push_next(&mut found.structures)
            .push_next(&mut found.queries)
            .push_next(&mut found.addresses);
        // SAFETY: `device` was enumerated from `instance`, and the chained structs outlive the call.
        unsafe { instance.get_physical_device_features2(device, &mut chain) };
        let all = [
            found.structures.acceleration_structure,
            found.queries.ray_query,
            found.addresses.buffer_device_address,
        ];
        all == [vk::TRUE; 3]
    }
}

fn extensions(instance: &ash::Instance, device: vk::PhysicalDevice) -> Vec<vk::ExtensionProperties> {
    // SAFETY: `device` was enumerated from `instance`.
    unsafe { instance.enumerate_device_extension_properties(device) }.unwrap_or_default()
}

fn has(extensions: &[vk::ExtensionProperties], wanted: &CStr) -> bool {
    extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(wanted))
}

/// Feature structs of one device, to be asked for or enabled.
#[derive(Default)]
pub struct Features {
    core: vk::PhysicalDeviceFeatures,
    synchronization: vk::PhysicalDeviceSynchronization2Features<'static>,
    rendering: vk::PhysicalDeviceDynamicRenderingFeatures<'static>,
}

impl Features {
    /// The features that a device for this crate must be created with; merge them into the host's own.
    pub fn required() -> Self {
        let mut features = Self::default();
        for feature in FEATURES {
            *(feature.field)(&mut features) = vk::TRUE;
        }
        features
    }

    /// The structs linked into a chain that `vkCreateDevice` and `vkGetPhysicalDeviceFeatures2` take. Who has a
    /// `VkPhysicalDeviceVulkan13Features` there sets `synchronization2` and `dynamicRendering` in that instead: Vulkan allows one of the two.
    pub fn chain(&mut self) -> vk::PhysicalDeviceFeatures2<'_> {
        // A chain of an earlier call would dangle into a moved struct.
        self.synchronization.p_next = std::ptr::null_mut();
        self.rendering.p_next = std::ptr::null_mut();
        vk::PhysicalDeviceFeatures2::default()
            .features(self.core)
            .push_next(&mut self.synchronization)
            .push_next(&mut self.rendering)
    }

    /// Asks a device for what it can do.
    pub(crate) fn of(instance: &ash::Instance, device: vk::PhysicalDevice) -> Self {
        let mut features = Self::default();
        let mut chain = features.chain();
        // SAFETY: `device` was enumerated from `instance`, and the chained structs outlive the call.
        unsafe { instance.get_physical_device_features2(device, &mut chain) };
        features.core = chain.features;
        features
    }

    /// Names and reasons of the required features that are missing here.
    pub(crate) fn missing(&mut self) -> Vec<String> {
        let absent = FEATURES.iter().filter(|f| *(f.field)(self) != vk::TRUE).collect::<Vec<_>>();
        absent.iter().map(|f| format!("feature {} ({})", f.name, f.why)).collect()
    }
}

/// One required feature.
pub struct Feature {
    /// Vulkan's name.
    pub name: &'static str,
    /// What it is needed for.
    pub why: &'static str,
    field: fn(&mut Features) -> &mut vk::Bool32,
}

/// Required features. All are in every desktop driver of Vulkan 1.3 and in lavapipe.
pub const FEATURES: &[Feature] = &[
    Feature { name: "synchronization2", why: "barriers", field: |f| &mut f.synchronization.synchronization2 },
    Feature {
        name: "dynamicRendering",
        why: "drawing without render pass objects",
        field: |f| &mut f.rendering.dynamic_rendering,
    },
    Feature {
        name: "shaderStorageImageExtendedFormats",
        why: "r8 storage images",
        field: |f| &mut f.core.shader_storage_image_extended_formats,
    },
];

/// One required use of a texel format, with optimal tiling.
pub struct FormatNeed {
    /// The format.
    pub format: vk::Format,
    /// What it must be capable of.
    pub features: vk::FormatFeatureFlags,
    /// What it is needed for.
    pub why: &'static str,
}

const fn flags(list: &[vk::FormatFeatureFlags]) -> vk::FormatFeatureFlags {
    let mut bits = 0;
    let mut i = 0;
    while i < list.len() {
        bits |= list[i].as_raw();
        i += 1;
    }
    vk::FormatFeatureFlags::from_raw(bits)
}

const SAMPLED: vk::FormatFeatureFlags = vk::FormatFeatureFlags::SAMPLED_IMAGE;
/// Read by a filtering sampler.
const FILTERED: vk::FormatFeatureFlags =
    flags(&[SAMPLED, vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR]);
const STORAGE: vk::FormatFeatureFlags = vk::FormatFeatureFlags::STORAGE_IMAGE;
const COLOUR: vk::FormatFeatureFlags = vk::FormatFeatureFlags::COLOR_ATTACHMENT;

/// Required uses of formats. `R16_UNORM` is optional: not filtered, 16-bit values become f32 texels (`Gpu::filters`); not
/// filtered and stored, there are no rays by brick (`Gpu::stores`).
pub const FORMATS: &[FormatNeed] = &[
    FormatNeed {
        format: vk::Format::R32_SFLOAT,
        features: flags(&[FILTERED, STORAGE]),
        why: "values, opacities, ambient occlusion",
    },
    FormatNeed { format: vk::Format::R8_UNORM, features: FILTERED, why: "8-bit values" },
    FormatNeed { format: vk::Format::R8_UINT, features: flags(&[SAMPLED, STORAGE]), why: "masks" },
    FormatNeed {
        format: vk::Format::R32G32B32A32_SFLOAT,
        features: flags(&[SAMPLED, STORAGE]),
        why: "pictures",
    },
    FormatNeed {
        format: vk::Format::R32_UINT,
        features: flags(&[COLOUR, SAMPLED]),
        why: "faces of clip meshes",
    },
    FormatNeed {
        format: vk::Format::D32_SFLOAT,
        features: flags(&[vk::FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT, SAMPLED]),
        why: "depth",
    },
];

/// Whether images of this format, with optimal tiling, can be read by a filtering sampler.
pub(crate) fn filters(instance: &ash::Instance, device: vk::PhysicalDevice, format: vk::Format) -> bool {
    // SAFETY: `device` was enumerated from `instance`.
    let has = unsafe { instance.get_physical_device_format_properties(device, format) };
    has.optimal_tiling_features.contains(FILTERED)
}

/// Whether images of this format, with optimal tiling, can be read and written by kernels.
pub(crate) fn stores(instance: &ash::Instance, device: vk::PhysicalDevice, format: vk::Format) -> bool {
    // SAFETY: `device` was enumerated from `instance`.
    let has = unsafe { instance.get_physical_device_format_properties(device, format) };
    has.optimal_tiling_features.contains(STORAGE)
}

/// Whether drawing to images of this format, with optimal tiling, can blend.
pub(crate) fn blends(instance: &ash::Instance, device: vk::PhysicalDevice, format: vk::Format) -> bool {
    // SAFETY: `device` was enumerated from `instance`.
    let has = unsafe { instance.get_physical_device_format_properties(device, format) };
    has.optimal_tiling_features.contains(vk::FormatFeatureFlags::COLOR_ATTACHMENT_BLEND)
}

/// Everything that this device lacks, in words; empty for a usable one.
pub(crate) fn missing(instance: &ash::Instance, device: vk::PhysicalDevice) -> Vec<String> {
    // SAFETY: `device` was enumerated from `instance`.
    let version = unsafe { instance.get_physical_device_properties(device) }.api_version;
    if version < API_VERSION {
        let (major, minor) = (vk::api_version_major(version), vk::api_version_minor(version));
        return vec![format!("Vulkan 1.3 (has {major}.{minor})")];
    }
    let mut missing = Features::of(instance, device).missing();
    let extensions = extensions(instance, device);
    for wanted in EXTENSIONS {
        if !has(&extensions, wanted) {
            missing.push(format!("extension {}", wanted.to_string_lossy()));
        }
    }
    for need in FORMATS {
        // SAFETY: `device` was enumerated from `instance`.
        let has = unsafe { instance.get_physical_device_format_properties(device, need.format) };
        let lacks = need.features & !has.optimal_tiling_features;
        if !lacks.is_empty() {
            missing.push(format!("format {:?} with {lacks:?} ({})", need.format, need.why));
        }
    }
    missing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_feature_of_the_table_is_required_and_missing_when_absent() {
        assert!(Features::required().missing().is_empty());
        assert_eq!(Features::default().missing().len(), FEATURES.len());
        let mut but_one = Features::required();
        *(FEATURES[0].field)(&mut but_one) = vk::FALSE;
        assert_eq!(but_one.missing(), ["feature synchronization2 (barriers)"]);
    }
}
