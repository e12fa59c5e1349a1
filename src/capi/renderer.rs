//! A renderer: a volume on a device, how it looks and what is cut away.

use crate::device::CaoDevice;
use crate::device::vulkan::VkFormat;
use crate::edge::{answer, numbers, one_of, read, read_all, text, texts, versioned};
use crate::error::{CaoResult, Result, guard, refuse};
use crate::handle::{free, get, handle, insert};
use crate::image::format;
use crate::volume::{CaoMesh, CaoVolume};
use cao::Renderer;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::methods::Method;
use cao_model::occlusion::RaySet;
use cao_model::options::KEYS;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use glam::Vec3;
use std::ffi::c_char;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, TryLockError};

/// A volume on a device. 0 is none.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CaoRenderer {
    /// Without meaning for a host.
    pub id: u64,
}
handle!(CaoRenderer, 4, "renderer", Shared);

/// A renderer and what is known of it without entering it.
pub(crate) struct Shared {
    renderer: Mutex<Renderer>,
    /// Commands that it takes as done will never run.
    pub stale: Arc<AtomicBool>,
    range: (f64, f64),
    /// Voxels along x, y, z, and their distances in mm.
    pub dims: [usize; 3],
    pub spacing: [f64; 3],
    /// The handle's number of the device that it is on.
    pub device: u64,
}

impl Shared {
    fn min_spacing(&self) -> f64 {
        self.spacing.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Runs a call, unless another thread is in one.
    pub fn enter<R>(&self, call: impl FnOnce(&mut Renderer) -> Result<R>) -> Result<R> {
        let mut renderer = match self.renderer.try_lock() {
            Ok(renderer) => renderer,
            Err(TryLockError::WouldBlock) => {
                return refuse(CaoResult::Busy, "renderer: another thread is in a call with it");
            }
            Err(TryLockError::Poisoned(renderer)) => {
                // A panic left it somewhere on its way.
                self.stale.store(true, Ordering::Relaxed);
                self.renderer.clear_poison();
                renderer.into_inner()
            }
        };
        if self.stale.swap(false, Ordering::Relaxed) {
            renderer.invalidate();
        }
        call(&mut renderer)
    }
}

/// Ways to compute ambient occlusion (docs/method.md).
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaoMethod {
    /// Rays by brick; what to take where no other is the point.
    Rays = 0,
    /// Contextual ambient occlusion, as in the paper.
    Cao = 1,
    /// Local ambient occlusion: every voxel at every change.
    Lao = 2,
    /// The mean opacity of a box around each voxel.
    Sat = 3,
    /// Shells of such boxes. Option shells.
    Shells = 4,
    /// Vicinity shading.
    Vicinity = 5,
    /// Clustered local histograms; does not see clips. Options clusters, bleeding.
    Histograms = 6,
    /// Feature-driven: each feature is occluded by its own matter alone. Option combine.
    FeatureDriven = 7,
    /// Smooth probabilistic ambient occlusion. Options levels, normal.
    Spao = 8,
    /// Cone tracing.
    Cones = 9,
    /// Deep volumetric ambient occlusion, by the network that is shipped: every update runs it whole.
    Deep = 10,
}

pub(crate) const METHODS: [Method; 11] = [
    Method::Rays,
    Method::Cao,
    Method::Lao,
    Method::Sat,
    Method::Shells,
    Method::Vicinity,
    Method::Histograms,
    Method::FeatureDriven,
    Method::Spao,
    Method::Cones,
    Method::Deep,
];

/// How occlusion is computed. All but the size 0 is the default.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoSetup {
    /// sizeof(CaoSetup).
    pub size: u32,
    /// A CaoMethod.
    pub method: u32,
    /// How far occlusion reaches in mm; 0: 20 voxels of the smallest spacing.
    pub radius_mm: f32,
    /// Directions a voxel: of rays and of feature-driven an even number up to 254, of CAO's and LAO's 6, 14, 26, 50 or 54, of vicinity's 26, 50
    /// or 96, of cones 14 or 26, and 0 of those that follow none; 0: the method's own.
    pub directions: u32,
    /// Options of the method, each as NAME=VALUE, as in `combine=max`; NULL where there are none.
    pub options: *const *const c_char,
    /// As many.
    pub option_count: u32,
    /// 0.
    pub reserved: u32,
}
versioned!(CaoSetup);

/// What a renderer is made of.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoRendererInfo {
    /// sizeof(CaoRendererInfo).
    pub size: u32,
    /// Format of the colours that it will draw to; others are possible, and cost a pipeline when they first come.
    pub colour_format: VkFormat,
    /// On this device.
    pub device: CaoDevice,
    /// Copied to the device; afterwards it may be freed.
    pub volume: CaoVolume,
    /// Name of a transfer function: auto, ct-bone, ct-soft, mr, paper. NULL is auto.
    pub preset: *const c_char,
    /// NULL is the default.
    pub setup: *const CaoSetup,
}
versioned!(CaoRendererInfo);

/// A transfer function of the host's own: linear between points, whose values ascend.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoTransfer {
    /// sizeof(CaoTransfer).
    pub size: u32,
    /// Length in mm that opacities are for; 0: the smallest spacing.
    pub reference_mm: f32,
    /// Two floats a point: value, opacity.
    pub opacity: *const f32,
    /// Four floats a point: value, red, green, blue; linear.
    pub colour: *const f32,
    /// Points of opacity, at most 64.
    pub opacity_count: u32,
    /// Points of colour, at most 64.
    pub colour_count: u32,
}
versioned!(CaoTransfer);

/// Shapes of clips, of size 1 about the volume's centre until their pose moves them.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaoShape {
    /// The half-space z > 0.
    Plane = 0,
    /// The cube |x|, |y|, |z| < 1.
    Box = 1,
    /// The ball of radius 1.
    Sphere = 2,
    /// Axis z, radius 1, |z| < 1.
    Cylinder = 3,
    /// Axis z, apex at z = 1, base of radius 1 at z = -1.
    Cone = 4,
    /// Ring of radius 1 in the xy plane, tube of radius 0.4.
    Torus = 5,
    /// CaoClip.mesh.
    Mesh = 6,
}

/// Which side of a shape disappears.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaoSide {
    /// The inside.
    Remove = 0,
    /// The outside.
    Keep = 1,
}

const SIDES: [Mode; 2] = [Mode::Remove, Mode::Keep];

/// A clip: p_world = T + Rz·Ry·Rx·(S·p_shape), in mm from the volume's centre, along its axes.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoClip {
    /// sizeof(CaoClip).
    pub size: u32,
    /// A CaoShape.
    pub shape: u32,
    /// A CaoSide.
    pub side: u32,
    /// T.
    pub translate_mm: [f32; 3],
    /// Degrees about the fixed axes x, then y, then z.
    pub rotate_deg: [f32; 3],
    /// S, each above 0.
    pub scale: [f32; 3],
    /// Of CAO_SHAPE_MESH; else ignored.
    pub mesh: CaoMesh,
}
versioned!(CaoClip);

/// The rays of a method that are so many.
fn rays(method: Method, count: u32) -> Result<RaySet> {
    if let RaySet::Spiral(_) = method.rays() {
        return Ok(RaySet::parse(&format!("spiral:{count}"))?);
    }
    let sets = method.entry().sets.iter().filter(|set| **set != RaySet::None);
    if let Some(set) = sets.clone().find(|set| set.count() == count as usize) {
        return Ok(*set);
    }
    let allowed: Vec<_> = sets.map(|set| set.count().to_string()).collect();
    let what =
        format!("CaoSetup.directions: {count}; expected of method {} 0 {}", method.name(), allowed.join(" "));
    refuse(CaoResult::BadValue, what)
}

/// # Safety
/// The pointers are as the header asks.
unsafe fn setup(given: &CaoSetup, spacing: f64) -> Result<Setup> {
    let mut setup = Setup::of(one_of("CaoSetup.method", given.method, &METHODS)?, spacing);
    if given.radius_mm != 0.0 {
        setup.occlusion.radius_mm = given.radius_mm;
    }
    if given.directions != 0 {
        setup.occlusion.rays = rays(setup.method, given.directions)?;
    }
    // SAFETY: the caller's promise.
    for option in unsafe { texts("CaoSetup.options", given.options, given.option_count, KEYS.len()) }? {
        let Some((name, value)) = option.split_once('=') else {
            let what = format!("CaoSetup.options: {option:?}; expected NAME=VALUE");
            return refuse(CaoResult::BadValue, what);
        };
        setup.options.set(name, value)?;
    }
    Ok(setup)
}

/// The default where the pointer is NULL.
///
/// # Safety
/// As [`setup`].
unsafe fn setup_or_default(given: *const CaoSetup, spacing: f64) -> Result<Setup> {
    if given.is_null() {
        return Ok(Setup::new(spacing));
    }
    // SAFETY: the caller's promise.
    unsafe { setup(&read(given)?, spacing) }
}

fn clip(given: &CaoClip) -> Result<Clip> {
    let shape = match Shape::ANALYTIC.get(given.shape as usize) {
        Some(shape) => shape.clone(),
        None if given.shape == CaoShape::Mesh as u32 => Shape::Mesh((*get(given.mesh)?).clone()),
        None => {
            let most = Shape::ANALYTIC.len();
            let what = format!("CaoClip.shape: {}; expected 0 … {most}", given.shape);
            return refuse(CaoResult::BadValue, what);
        }
    };
    let pose = Pose {
        translate_mm: Vec3::from_array(given.translate_mm),
        rotate_deg: Vec3::from_array(given.rotate_deg),
        scale: Vec3::from_array(given.scale),
    };
    Ok(Clip { shape, mode: one_of("CaoClip.side", given.side, &SIDES)?, pose })
}

/// Copies a volume to a device and builds what draws it. Uses the lent queue and waits for it. Free it with cao_renderer_free.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_renderer_create(
    info: *const CaoRendererInfo,
    renderer: *mut CaoRenderer,
) -> CaoResult {
    let make = || {
        // SAFETY: the header asks for it.
        let info = unsafe { read(info) }?;
        let preset = match info.preset.is_null() {
            true => "auto",
            // SAFETY: the header asks for it.
            false => unsafe { text("CaoRendererInfo.preset", info.preset) }?,
        };
        let (gpu, volume) = (get(info.device)?, get(info.volume)?);
        let (range, dims, spacing) = (volume.range(), volume.dims, volume.spacing);
        // SAFETY: the header asks for it.
        let setup = unsafe { setup_or_default(info.setup, volume.min_spacing()) }?;
        let colour = format(info.colour_format)?;
        let transfer = TransferFunction::preset(preset, range)?;
        let renderer = Mutex::new(Renderer::new(&gpu, &volume, transfer, setup, colour)?);
        let device = info.device.id;
        Ok(insert(Shared { renderer, stale: Arc::default(), range, dims, spacing, device }, device))
    };
    // SAFETY: the header asks for it.
    guard(|| unsafe { answer(renderer, CaoRenderer { id: 0 }, make) })
}

/// Frees a renderer. Recordings keep what they need of it.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_renderer_free(renderer: CaoRenderer) -> CaoResult {
    guard(|| free(renderer))
}

/// Changes the transfer function to one of the names of CaoRendererInfo.preset.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_renderer_set_preset(renderer: CaoRenderer, preset: *const c_char) -> CaoResult {
    guard(|| {
        let shared = get(renderer)?;
        // SAFETY: the header asks for it.
        let preset = unsafe { text("preset", preset) }?;
        let transfer = TransferFunction::preset(preset, shared.range)?;
        shared.enter(|renderer| Ok(renderer.set_transfer(transfer)?))
    })
}

/// Changes the transfer function to points of the host's own.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_renderer_set_transfer(
    renderer: CaoRenderer,
    transfer: *const CaoTransfer,
) -> CaoResult {
    guard(|| {
        let shared = get(renderer)?;
        // SAFETY: the header asks for it.
        let given = unsafe { read(transfer) }?;
        // SAFETY: as above.
        let opacity =
            unsafe { numbers("CaoTransfer.opacity", given.opacity, 2 * u64::from(given.opacity_count)) }?;
        // SAFETY: as above.
        let colour =
            unsafe { numbers("CaoTransfer.colour", given.colour, 4 * u64::from(given.colour_count)) }?;
        let reference = (given.reference_mm != 0.0).then_some(given.reference_mm);
        let (opacity, colour) = (opacity.as_chunks().0.to_vec(), colour.as_chunks().0.to_vec());
        let transfer = TransferFunction::new(opacity, colour, reference)?;
        shared.enter(|renderer| Ok(renderer.set_transfer(transfer)?))
    })
}

/// Changes how occlusion is computed; the ambient light stays, and a method that does not follow it is refused. Uses the lent queue where
/// the method is another. NULL is the default.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_renderer_set_setup(
    renderer: CaoRenderer,
    setup_info: *const CaoSetup,
) -> CaoResult {
    guard(|| {
        let shared = get(renderer)?;
        // SAFETY: the header asks for it.
        let mut setup = unsafe { setup_or_default(setup_info, shared.min_spacing()) }?;
        shared.enter(|renderer| {
            setup.occlusion.light = renderer.setup().occlusion.light;
            Ok(renderer.set_setup(setup)?)
        })
    })
}

/// Changes the clips, all of them, at most 8; 0 and NULL for none. Never uses a queue: maps of meshes are made by the next update.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_renderer_set_clips(
    renderer: CaoRenderer,
    clips: *const CaoClip,
    clip_count: u32,
) -> CaoResult {
    guard(|| {
        let shared = get(renderer)?;
        // SAFETY: the header asks for it.
        let given = unsafe { read_all(clips, clip_count, Clip::MAX) }?;
        let clips = given.iter().map(clip).collect::<Result<Vec<_>>>()?;
        shared.enter(|renderer| Ok(renderer.set_clips(&clips)?))
    })
}

/// Overwrites a box of voxels, the first of which is `first`, by a volume of the same type. Uses the lent queue and waits for it.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_renderer_set_values(
    renderer: CaoRenderer,
    first: *const u32,
    values: CaoVolume,
) -> CaoResult {
    guard(|| {
        let (shared, values) = (get(renderer)?, get(values)?);
        // SAFETY: the header asks for it.
        let first = unsafe { numbers("first", first, 3) }?;
        shared.enter(|renderer| Ok(renderer.set_values([first[0], first[1], first[2]], &values)?))
    })
}
