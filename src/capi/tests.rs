//! What `example/abuse.c` cannot do from outside: panics, a thread that stays in a call, and tables that must agree. What a host gets wrong
//! by pointers, sizes and order is in there (`tools/capi`).

use crate::device::{CaoDevice, cao_device_free, cao_require_features};
use crate::error::{CaoResult, Failure, cao_last_error, cao_set_error_callback, guard};
use crate::handle::{free, get, insert};
use crate::renderer::*;
use crate::volume::*;
use ash::vk;
use cao_gpu::{Gpu, OpenOptions};
use cao_model::clip::Shape;
use cao_model::values::Values;
use cao_model::volume::Volume;
use std::ffi::{CStr, c_char, c_void};
use std::sync::atomic::{AtomicUsize, Ordering};

fn last() -> String {
    // SAFETY: text of this thread, copied before any other call.
    unsafe { CStr::from_ptr(cao_last_error()) }.to_str().unwrap().to_owned()
}

fn volume() -> CaoVolume {
    insert(
        Volume::new([8, 8, 8], [1.0; 3], Values::U8((0..512).map(|i| (i % 251) as u8).collect())).unwrap(),
        0,
    )
}

/// What a free answers.
fn code(freed: Result<(), Failure>) -> CaoResult {
    freed.map_or_else(|failure| failure.code, |()| CaoResult::Ok)
}

#[test]
fn a_panic_ends_at_the_edge_with_its_words() {
    assert_eq!(guard(|| panic!("planted {}", 7)), CaoResult::Internal);
    assert_eq!(last(), "a fault of this library: planted 7");
    assert_eq!(guard(|| panic!("planted")), CaoResult::Internal);
    assert_eq!(last(), "a fault of this library: planted");
    assert_eq!(guard(|| std::panic::panic_any(7)), CaoResult::Internal);
    assert_eq!(last(), "a fault of this library: without words");
    assert_eq!(guard(|| Ok(())), CaoResult::Ok);
    assert_eq!(last(), "a fault of this library: without words");
    // Words are each thread's own.
    assert_eq!(std::thread::spawn(last).join().unwrap(), "");
}

#[test]
fn the_callback_hears_every_failure_and_not_its_own() {
    /// This test's thread alone counts: others fail beside it.
    static THREAD: std::sync::OnceLock<std::thread::ThreadId> = std::sync::OnceLock::new();
    unsafe extern "C" fn hear(result: CaoResult, message: *const c_char, user: *mut c_void) {
        if THREAD.get() != Some(&std::thread::current().id()) {
            return;
        }
        // SAFETY: the library passes text, and what the test gave it.
        let (said, heard) = unsafe { (CStr::from_ptr(message), &*user.cast::<AtomicUsize>()) };
        assert_eq!(result, CaoResult::BadHandle);
        assert!(said.to_str().unwrap().contains("mesh: the handle is 0"));
        heard.fetch_add(1, Ordering::Relaxed);
        assert_eq!(cao_volume_free(CaoVolume { id: 0 }), CaoResult::BadHandle);
    }
    THREAD.set(std::thread::current().id()).unwrap();
    static HEARD: AtomicUsize = AtomicUsize::new(0);
    // SAFETY: a function and a counter that live as long as the program.
    unsafe { cao_set_error_callback(Some(hear), (&raw const HEARD).cast_mut().cast()) };
    for _ in 0..3 {
        assert_eq!(cao_mesh_free(CaoMesh { id: 0 }), CaoResult::BadHandle);
        assert!(last().starts_with("mesh"), "what failed within the callback is forgotten: {}", last());
    }
    // SAFETY: none.
    unsafe { cao_set_error_callback(None, std::ptr::null_mut()) };
    assert_eq!(cao_mesh_free(CaoMesh { id: 0 }), CaoResult::BadHandle);
    assert_eq!(HEARD.load(Ordering::Relaxed), 3);
}

#[test]
fn what_somebody_holds_is_not_freed_and_what_is_freed_stays_so() {
    let held = volume();
    let hold = get(held).unwrap();
    assert_eq!(code(free(held)), CaoResult::InUse);
    drop(hold);
    assert_eq!(code(free(held)), CaoResult::Ok);
    assert_eq!(code(free(held)), CaoResult::Freed);
    let next = volume();
    assert_ne!(held, next, "numbers are never given out twice");
    assert_eq!(code(free(held)), CaoResult::Freed);
    assert_eq!(code(free(CaoMesh { id: next.id })), CaoResult::BadHandle);
    for kind in 0..=u8::MAX {
        let id = u64::from(kind) << 56;
        assert_eq!(code(free(CaoVolume { id })), CaoResult::BadHandle, "{id:#x}");
        assert_eq!(code(free(CaoVolume { id: id | ((1 << 56) - 1) })), CaoResult::BadHandle);
    }
    assert_eq!(code(free(next)), CaoResult::Ok);
}

/// One thread stays in a call; a panic in a call.
#[test]
fn a_renderer_is_of_one_thread_at_a_time_and_outlives_a_panic() {
    let gpu = Gpu::open(&OpenOptions::default()).unwrap();
    let device: CaoDevice = insert(gpu.clone(), 0);
    let volume = volume();
    let info = CaoRendererInfo {
        size: size_of::<CaoRendererInfo>() as u32,
        colour_format: vk::Format::R8G8B8A8_UNORM.as_raw(),
        device,
        volume,
        preset: std::ptr::null(),
        setup: std::ptr::null(),
    };
    let mut renderer = CaoRenderer { id: 7 };
    // SAFETY: both live until it returns.
    assert_eq!(unsafe { cao_renderer_create(&info, &mut renderer) }, CaoResult::Ok, "{}", last());
    assert_eq!(cao_device_free(device), CaoResult::InUse);
    assert!(last().contains("1 × renderer"), "{}", last());

    let none = move || {
        // SAFETY: no clips.
        unsafe { cao_renderer_set_clips(renderer, std::ptr::null(), 0) }
    };
    let shared = get(renderer).unwrap();
    let within = shared.enter(|_| {
        let other = std::thread::spawn(move || (none(), cao_renderer_free(renderer), last()));
        Ok(other.join().unwrap())
    });
    let (set, freed, said) = within.unwrap();
    assert_eq!((set, freed), (CaoResult::Busy, CaoResult::InUse), "{said}");
    assert_eq!(none(), CaoResult::Ok);

    shared.enter(|renderer| Ok(renderer.update(&mut |_| ())?)).unwrap();
    assert_eq!(guard(|| shared.enter(|_| panic!("planted"))), CaoResult::Internal);
    // What it left half done counts as not done.
    let read = shared.enter(|renderer| Ok(renderer.read_ambient()?));
    assert_eq!(read.unwrap_err().code, CaoResult::WrongOrder);
    shared.enter(|renderer| Ok(renderer.update(&mut |_| ())?)).unwrap();
    shared.enter(|renderer| Ok(renderer.read_ambient()?)).unwrap();
    // Nor is what was recorded for nothing.
    shared.stale.store(true, Ordering::Relaxed);
    assert!(shared.enter(|renderer| Ok(renderer.read_ambient()?)).is_err());

    drop(shared);
    assert_eq!(cao_renderer_free(renderer), CaoResult::Ok);
    assert_eq!(cao_volume_free(volume), CaoResult::Ok);
    assert_eq!(cao_device_free(device), CaoResult::Ok);
    gpu.assert_clean().unwrap();
}

/// What `cao_require_features` relies on.
#[test]
fn what_is_required_is_in_two_structs() {
    let mut required = Gpu::required_features();
    let chain = required.chain();
    let mut next = chain.p_next.cast::<vk::BaseOutStructure>().cast_const();
    let mut kinds = Vec::new();
    while !next.is_null() {
        // SAFETY: Vulkan's chain; each of these two is a type, the next and one feature.
        let (kind, feature) = unsafe { ((*next).s_type, next.add(1).cast::<vk::Bool32>().read()) };
        kinds.push((kind, feature));
        // SAFETY: as above.
        next = unsafe { (*next).p_next };
    }
    kinds.sort_unstable();
    let mut these = [
        (vk::StructureType::PHYSICAL_DEVICE_SYNCHRONIZATION_2_FEATURES, vk::TRUE),
        (vk::StructureType::PHYSICAL_DEVICE_DYNAMIC_RENDERING_FEATURES, vk::TRUE),
    ];
    these.sort_unstable();
    assert_eq!(kinds, these, "what cao_require_features sets");

    let mut v13 = vk::PhysicalDeviceVulkan13Features::default().maintenance4(true);
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut v13);
    features.features.geometry_shader = vk::TRUE;
    // SAFETY: as above; the lifetime is of Rust alone.
    let set = unsafe { cao_require_features((&raw mut features).cast()) };
    let core = features.features;
    assert_eq!(set, CaoResult::Ok);
    assert_eq!((core.geometry_shader, core.shader_storage_image_extended_formats), (vk::TRUE, vk::TRUE));
    assert_eq!((core.robust_buffer_access, core.inherited_queries), (vk::FALSE, vk::FALSE));
    let both = vk::PhysicalDeviceVulkan13Features::default()
        .maintenance4(true)
        .synchronization2(true)
        .dynamic_rendering(true);
    assert_eq!(format!("{v13:?}"), format!("{both:?}"));

    let mut synchronization = vk::PhysicalDeviceSynchronization2Features::default();
    let mut rendering = vk::PhysicalDeviceDynamicRenderingFeatures::default();
    let mut features =
        vk::PhysicalDeviceFeatures2::default().push_next(&mut synchronization).push_next(&mut rendering);
    // SAFETY: as above.
    assert_eq!(unsafe { cao_require_features((&raw mut features).cast()) }, CaoResult::Ok);
    assert_eq!((synchronization.synchronization2, rendering.dynamic_rendering), (vk::TRUE, vk::TRUE));
}

#[test]
fn numbers_of_shapes_are_those_of_the_header() {
    use CaoShape::{Box, Cone, Cylinder, Mesh, Plane, Sphere, Torus};
    let names = ["plane", "box", "sphere", "cylinder", "cone", "torus"];
    for ((number, name), shape) in [Plane, Box, Sphere, Cylinder, Cone, Torus].into_iter().zip(names).zip(0..)
    {
        assert_eq!((number as usize, Shape::ANALYTIC[shape].name()), (shape, name));
    }
    assert_eq!(Mesh as usize, Shape::ANALYTIC.len());
}

#[test]
fn numbers_of_methods_are_those_of_the_header() {
    use CaoMethod::{Cao, Cones, Deep, FeatureDriven, Histograms, Lao, Rays, Sat, Shells, Spao, Vicinity};
    let numbers = [Rays, Cao, Lao, Sat, Shells, Vicinity, Histograms, FeatureDriven, Spao, Cones, Deep];
    let names =
        ["rays", "cao", "lao", "sat", "shells", "vicinity", "histograms", "fdao", "spao", "cones", "dvao"];
    for (number, name) in numbers.into_iter().zip(names) {
        assert_eq!(METHODS[number as usize].name(), name);
    }
    assert_eq!((METHODS.len(), numbers.len()), (cao_model::methods::METHODS.len(), names.len()));
}

/// Names of functions, fields and values in the Rust files.
fn declared() -> Vec<String> {
    let files = [
        include_str!("lib.rs"),
        include_str!("device.rs"),
        include_str!("draw.rs"),
        include_str!("error.rs"),
        include_str!("features.rs"),
        include_str!("image.rs"),
        include_str!("recording.rs"),
        include_str!("renderer.rs"),
        include_str!("volume.rs"),
    ];
    let mut found = Vec::new();
    for line in files.iter().flat_map(|file| file.lines()) {
        let name =
            |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
        if let Some((_, rest)) = line.split_once("extern \"C\" fn cao_") {
            found.push(format!("cao_{}(", name(rest)));
        } else if let Some(rest) = line.strip_prefix("    pub ").filter(|rest| name(rest).len() > 1) {
            if rest[name(rest).len()..].starts_with(':')
                && !["Arc<", "Vec<", "CaoResult,"].iter().any(|of| rest.contains(of))
            {
                found.push(name(rest));
            }
        } else if let Some(rest) = line.strip_prefix("pub struct Cao").or(line.strip_prefix("pub enum Cao")) {
            found.push(format!("Cao{}", name(rest)));
        }
    }
    found
}

/// That the header is made of these files to the letter is held by `tools/capi`, which has what makes it.
#[test]
fn the_header_has_every_name() {
    let (header, names) = (include_str!("include/cao.h"), declared());
    let lacking: Vec<_> = names.iter().filter(|name| !header.contains(name.as_str())).collect();
    assert!(names.len() > 120 && lacking.is_empty(), "{}: {lacking:?}; run tools/capi header", names.len());
    let functions = header.lines().filter(|line| line.contains(" cao_") || line.contains("*cao_"));
    let functions = functions.filter(|line| !line.starts_with("//") && !line.starts_with(' ')).count();
    assert_eq!(functions, names.iter().filter(|name| name.starts_with("cao_")).count());
    assert!(header.contains(&format!("#define CAO_ABI {}", crate::CAO_ABI)));
}
