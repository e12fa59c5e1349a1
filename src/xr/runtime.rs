//! The OpenXR runtime and its headset, or why there is none.

use anyhow::{Context, Result, anyhow, bail};
use openxr as xr;

/// Both eyes, one view each.
pub const VIEWS: xr::ViewConfigurationType = xr::ViewConfigurationType::PRIMARY_STEREO;

/// A runtime with a headset.
pub struct Runtime {
    /// Everything of OpenXR comes from it.
    pub instance: xr::Instance,
    /// The headset.
    pub system: xr::SystemId,
    /// The runtime takes depths beside colours, to place what it draws over them and to move pictures to a later pose of the head.
    pub depth: bool,
}

impl Runtime {
    /// Loads the runtime that the system has, and asks it for a headset.
    ///
    /// # Errors
    /// In words for who has no headset: no loader, no runtime, a runtime without Vulkan, no headset.
    pub fn open() -> Result<Self> {
        // SAFETY: loading a library runs its initialisers; it is the system's own loader.
        let entry = unsafe { xr::Entry::load(&()) }.map_err(|error| {
            anyhow!(
                "there is no OpenXR loader ({error}); install it, on Debian or Ubuntu `apt install libopenxr-loader1`, \
                 and a runtime: SteamVR, Monado or that of the headset's maker"
            )
        })?;
        let none = "no OpenXR runtime answers; start SteamVR, Monado (monado-service) or that of the headset's maker, or name its manifest \
                    in XR_RUNTIME_JSON; tools/openxr runs one without a headset";
        let offered = entry.enumerate_extensions().context(none)?;
        if !offered.khr_vulkan_enable2 {
            bail!("this OpenXR runtime has no Vulkan (XR_KHR_vulkan_enable2); expected one that has");
        }
        let mut extensions = xr::ExtensionSet::default();
        extensions.khr_vulkan_enable2 = true;
        extensions.khr_composition_layer_depth = offered.khr_composition_layer_depth;
        let application = xr::ApplicationInfo {
            application_name: "cao-xr",
            application_version: 0,
            engine_name: "cao",
            engine_version: 0,
            // What runtimes and loaders of any age know.
            api_version: xr::Version::new(1, 0, 0),
        };
        let instance = entry.create_instance(&application, &extensions, &[], &()).context(none)?;
        let system = instance.system(xr::FormFactor::HEAD_MOUNTED_DISPLAY).with_context(|| {
            format!("{} has no headset; is it plugged in, switched on and awake?", name(&instance))
        })?;
        let views = instance.enumerate_view_configurations(system)?;
        if !views.contains(&VIEWS) {
            bail!(
                "this headset does not show one view for each of two eyes; expected stereo, offered is {views:?}"
            );
        }
        Ok(Self { instance, system, depth: offered.khr_composition_layer_depth })
    }

    /// What the runtime calls itself, and the headset.
    pub fn name(&self) -> String {
        let system = self.instance.system_properties(self.system);
        let system = system.map_or_else(|_| "a headset".into(), |system| system.system_name);
        format!("{}, {system}", name(&self.instance))
    }

    /// How the runtime lays a picture over what is behind it: over nothing, where it can.
    pub fn blend(&self) -> Result<xr::EnvironmentBlendMode> {
        let modes = self.instance.enumerate_environment_blend_modes(self.system, VIEWS)?;
        let opaque = modes.iter().find(|mode| **mode == xr::EnvironmentBlendMode::OPAQUE);
        opaque.or(modes.first()).copied().context("the runtime shows pictures in no way at all")
    }
}

fn name(instance: &xr::Instance) -> String {
    instance
        .properties()
        .map_or_else(|_| "the runtime".into(), |p| format!("{} {}", p.runtime_name, p.runtime_version))
}
