//! cao in a host that uses wgpu: its device, its textures, its command encoders. The page is docs/embedding/wgpu.md.
//!
//! wgpu knows in which state each of its textures is and moves it from use to use, so nobody else may move one unseen. Here a frame is two
//! of its command buffers: in the first wgpu itself brings the textures into the state of attachments, the second is ours, takes them
//! in that state and leaves them in it. What wgpu believes stays true, and what it does next begins with its own barriers.

use cao::gpu::ash::vk;
use cao::gpu::{Adopted, Format, Gpu, Image, ImageState, ImageUse, Lent, Recorded, Recorder};
use std::ops::Deref;
use wgpu::hal::api::Vulkan;

/// Why something was refused.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A call, and what it cannot take.
    #[error("{what}: {problem}")]
    Refused {
        /// The call or object.
        what: String,
        /// What is wrong with it, and what to do.
        problem: String,
    },
    /// wgpu refused the device.
    #[error(transparent)]
    Device(#[from] wgpu::RequestDeviceError),
    /// The device refused something.
    #[error(transparent)]
    Gpu(#[from] cao::gpu::Error),
    /// The renderer refused something.
    #[error(transparent)]
    Cao(#[from] cao::Error),
}

/// What calls return.
pub type Result<T> = std::result::Result<T, Error>;

/// The page's code is compiled.
#[cfg(doctest)]
#[doc = include_str!("../../docs/embedding/wgpu.md")]
struct Page;

fn refused(what: impl Into<String>, problem: impl Into<String>) -> Error {
    Error::Refused { what: what.into(), problem: problem.into() }
}

fn not_vulkan(what: &str) -> Error {
    refused(what, "is not one of Vulkan; make the instance with Backends::VULKAN")
}

/// Makes a wgpu device with what cao needs beside what is asked for: instead of `adapter.request_device`. wgpu's own `open_with_callback` adds
/// extensions and structs, but no core feature that wgpu does not know, and cao needs one.
///
/// # Errors
/// An adapter that is not Vulkan's, lacks what is asked for, or what [`Gpu::required`] lists.
pub fn request_device(
    adapter: &wgpu::Adapter,
    desc: &wgpu::DeviceDescriptor,
) -> Result<(wgpu::Device, wgpu::Queue)> {
    let name = format!("adapter {}", adapter.get_info().name);
    // What wgpu checks in `request_device` alone.
    let (wanted, experimental) = (desc.required_features, desc.experimental_features.is_enabled());
    if !adapter.features().contains(wanted) {
        let lacking = wanted - adapter.features();
        return Err(refused(name, format!("lacks {lacking}; do without, or choose another")));
    }
    if wanted.intersects(wgpu::Features::all_experimental_mask()) && !experimental {
        return Err(refused(name, "experimental features were asked for without the token that allows them"));
    }
    if !desc.required_limits.check_limits(&adapter.limits()) {
        return Err(refused(name, "has lower limits than asked for; take adapter.limits()"));
    }
    // SAFETY: nothing of it is destroyed here.
    let hal = unsafe { adapter.as_hal::<Vulkan>() }.ok_or_else(|| not_vulkan(&name))?;
    let mut extensions = hal.required_device_extensions(wanted);
    for ours in Gpu::required_extensions() {
        if !extensions.contains(ours) {
            extensions.push(ours);
        }
    }
    let names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
    // The family and the queue that wgpu itself takes.
    let (family, queue) = (0, 0);
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
    let mut theirs = hal.physical_device_features(&extensions, wanted);
    let mut ours = Gpu::required_features();
    let mut chain = ours.chain();
    unite(&mut chain.features, &theirs.get_core());
    let mut create = theirs.add_to_device_create(
        vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&names),
    );
    // The chain has them, and Vulkan allows one of the two.
    create.p_enabled_features = std::ptr::null();
    let create = create.push_next(&mut chain);
    let instance = hal.shared_instance().raw_instance();
    // SAFETY: `create` and what it points to live until the call returns; the physical device is of this instance.
    let raw = unsafe { instance.create_device(hal.raw_physical_device(), &create, None) };
    let raw = raw.map_err(|result| {
        let needs = Gpu::required().join("; ");
        refused(&name, format!("vkCreateDevice: {result}; cao needs {needs}"))
    })?;
    // SAFETY: the device was just made of this adapter, with its extensions and features, and that queue; wgpu owns it from here on.
    let open = unsafe {
        hal.device_from_raw(
            raw,
            None,
            &extensions,
            wanted,
            &desc.required_limits,
            &desc.memory_hints,
            family,
            queue,
        )
    };
    let open = open.map_err(|error| refused(&name, format!("opening its device: {error}")))?;
    // SAFETY: it was made of this adapter, with the features of `desc`.
    Ok(unsafe { adapter.create_device_from_hal::<Vulkan>(open, desc) }?)
}

/// Adds the features of one struct to another.
fn unite(into: &mut vk::PhysicalDeviceFeatures, from: &vk::PhysicalDeviceFeatures) {
    const COUNT: usize = size_of::<vk::PhysicalDeviceFeatures>() / size_of::<vk::Bool32>();
    // SAFETY: the struct is C's, of `COUNT` numbers of 32 bits and nothing else.
    let (into, from) = unsafe {
        let into = &mut *std::ptr::from_mut(into).cast::<[vk::Bool32; COUNT]>();
        (into, &*std::ptr::from_ref(from).cast::<[vk::Bool32; COUNT]>())
    };
    into.iter_mut().zip(from).for_each(|(into, from)| *into |= from);
}

/// Takes a wgpu device for cao, and lends it its queue for the calls that say they use one (loading, reading back).
///
/// # Safety
/// The device must have what [`request_device`] gives it, and be alive until the [`Gpu`] and all that was made with it are dropped: keep
/// the [`wgpu::Device`], drop it last, never `destroy` it. During calls of cao's that use a queue no other thread may use the
/// [`wgpu::Queue`] or present a surface.
///
/// # Errors
/// A device that is not Vulkan's or lacks what is needed, see [`Gpu::adopt`].
pub unsafe fn adopt(device: &wgpu::Device) -> Result<Gpu> {
    let what = "wgpu device";
    // SAFETY: nothing of it is destroyed here.
    let hal = unsafe { device.as_hal::<Vulkan>() }.ok_or_else(|| not_vulkan(what))?;
    for needed in Gpu::required_extensions() {
        if !hal.enabled_device_extensions().contains(needed) {
            let needed = needed.to_string_lossy();
            let problem = format!("was made without {needed}; make it with cao_wgpu::request_device");
            return Err(refused(what, problem));
        }
    }
    let instance = hal.shared_instance();
    let adopted = Adopted {
        entry: instance.entry().clone(),
        instance: instance.raw_instance().clone(),
        physical_device: hal.raw_physical_device(),
        device: hal.raw_device().clone(),
        queue_family: hal.queue_family_index(),
        compute_only: false,
        ray_queries: false,
        queue: Some(hal.raw_queue()),
    };
    // SAFETY: the handles belong together, and the caller promises the rest.
    Ok(unsafe { Gpu::adopt(adopted) }?)
}

/// A wgpu texture that cao draws to. Keeps it alive.
pub struct Texture {
    image: Image,
    texture: wgpu::Texture,
    state: wgpu::TextureUses,
}

impl Deref for Texture {
    type Target = Image;

    fn deref(&self) -> &Image {
        &self.image
    }
}

/// What wgpu's format is here, and whether it is a depth.
fn format(of: wgpu::TextureFormat) -> Option<(Format, bool)> {
    use wgpu::TextureFormat as F;
    Some(match of {
        F::Rgba8Unorm => (Format::Rgba8Unorm, false),
        F::Rgba8UnormSrgb => (Format::Rgba8Srgb, false),
        F::Bgra8Unorm => (Format::Bgra8Unorm, false),
        F::Bgra8UnormSrgb => (Format::Bgra8Srgb, false),
        F::Rgb10a2Unorm => (Format::A2b10g10r10Unorm, false),
        F::Rgba16Float => (Format::Rgba16Float, false),
        F::Rgba32Float => (Format::Rgba32Float, false),
        F::Depth16Unorm => (Format::D16Unorm, true),
        F::Depth32Float => (Format::D32Float, true),
        _ => return None,
    })
}

/// Takes a texture as a target of colours or of depths, each layer a place for a view. Made with `RENDER_ATTACHMENT`; a depth that
/// ends rays ([`Target::scene`](cao::renderer::Target::scene)) with `TEXTURE_BINDING` too.
///
/// # Safety
/// The texture must be of the device that `gpu` was [`adopt`]ed from, and not be `destroy`ed until this and the recordings that used it are
/// gone.
///
/// # Errors
/// Textures with samples, levels or depth, formats that cao does not draw to, a missing use.
pub unsafe fn adopt_texture(gpu: &Gpu, texture: &wgpu::Texture) -> Result<Texture> {
    let what = || "wgpu texture".to_owned();
    let Some((format, depth)) = format(texture.format()) else {
        let problem = format!(
            "is {:?}; cao draws to Rgba8Unorm, Bgra8Unorm and their Srgb, Rgb10a2Unorm, Rgba16Float, Rgba32Float, Depth16Unorm, Depth32Float",
            texture.format()
        );
        return Err(refused(what(), problem));
    };
    if texture.dimension() != wgpu::TextureDimension::D2
        || texture.sample_count() != 1
        || texture.mip_level_count() != 1
    {
        return Err(refused(what(), "must be flat, of one sample and one level; resolve it first"));
    }
    if !texture.usage().contains(wgpu::TextureUsages::RENDER_ATTACHMENT) {
        return Err(refused(what(), "was made without TextureUsages::RENDER_ATTACHMENT"));
    }
    // What wgpu's states of the same meaning are in Vulkan: layout, stages, accesses.
    let (state, wgpus) = match depth {
        true => (ImageState::DEPTH_ATTACHMENT, wgpu::TextureUses::DEPTH_STENCIL_WRITE),
        false => (ImageState::COLOUR_ATTACHMENT, wgpu::TextureUses::COLOR_TARGET),
    };
    let sampled = depth && texture.usage().contains(wgpu::TextureUsages::TEXTURE_BINDING);
    let usage = if sampled { ImageUse::ATTACHMENT | ImageUse::SAMPLED } else { ImageUse::ATTACHMENT };
    let lent = {
        // SAFETY: nothing of it is destroyed here.
        let hal = unsafe { texture.as_hal::<Vulkan>() }.ok_or_else(|| not_vulkan("wgpu texture"))?;
        Lent {
            // SAFETY: as above.
            image: unsafe { hal.raw_handle() },
            size: [texture.width(), texture.height()],
            layers: texture.depth_or_array_layers(),
            format,
            usage,
            before: state,
            after: state,
        }
    };
    // SAFETY: it is as described, for the uses named; `record` brings it into that state, and the caller promises the rest.
    let image = unsafe { gpu.adopt_image("wgpu texture", &lent) }?;
    Ok(Texture { image, texture: texture.clone(), state: wgpus })
}

/// A frame for wgpu's queue.
pub struct Frame<T> {
    /// To be submitted in this order, one right after the other: wgpu's, which moves the textures; ours.
    pub commands: [wgpu::CommandBuffer; 2],
    /// To be kept until they have run: give it to `queue.on_submitted_work_done`, or ask it for times after that.
    pub recorded: Recorded,
    /// What the recording returned.
    pub drawn: T,
}

/// Records into a command buffer of wgpu's. The textures are ours while `what` records, so it says neither `acquire` nor `release`.
///
/// # Safety
/// `device` must be the one that `gpu` was adopted from. The commands must go to its queue at most once, as [`Frame::commands`] says, with
/// nothing between that uses the textures; frames in the order in which they were recorded. A frame that is not submitted is told to the
/// renderer ([`Renderer::invalidate`](cao::Renderer::invalidate)). [`Frame::recorded`] must be kept until they have run.
///
/// wgpu clears what it has never seen written before it reads it, and does not see what is drawn here: it must have drawn to or cleared
/// every layer of the textures once, as a pass with `LoadOp::Clear` does.
///
/// # Errors
/// Those of `what`; a texture named twice, or of another device. Nothing is to be submitted then.
pub unsafe fn record<T>(
    gpu: &Gpu,
    device: &wgpu::Device,
    textures: &[&Texture],
    what: impl FnOnce(&mut Recorder) -> Result<T>,
) -> Result<Frame<T>> {
    let encoder =
        |label| device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) });
    let mut hand_over = encoder("cao: states");
    hand_over.transition_resources(
        std::iter::empty::<wgpu::wgt::BufferTransition<&wgpu::Buffer>>(),
        textures.iter().map(|texture| wgpu::wgt::TextureTransition {
            texture: &texture.texture,
            selector: None,
            state: texture.state,
        }),
    );
    // One that records in Vulkan may do nothing else.
    let mut ours = encoder("cao");
    let record = |raw: Option<&mut wgpu::hal::vulkan::CommandEncoder>| {
        let raw = raw.ok_or_else(|| not_vulkan("command encoder"))?;
        // SAFETY: the handle is not destroyed here; the buffer is recording, outside of passes, and the caller promises the rest. After an error
        // the encoder is dropped, and what it holds is never submitted.
        let mut rec = unsafe { gpu.record_into(raw.raw_handle()) };
        for texture in textures {
            rec.acquire(texture)?;
        }
        let drawn = what(&mut rec)?;
        for texture in textures {
            rec.release(texture)?;
        }
        Ok::<_, Error>((rec.finish()?, drawn))
    };
    // SAFETY: it is not ended, and used by nobody else meanwhile.
    let (recorded, drawn) = unsafe { ours.as_hal_mut::<Vulkan, _, _>(record) }?;
    Ok(Frame { commands: [hand_over.finish(), ours.finish()], recorded, drawn })
}
