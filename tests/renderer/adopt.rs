//! A host with its own Vulkan: its device is used, its command buffer recorded into, and its handles survive.

use ash::vk;
use cao::renderer::Renderer;
use cao_gpu::Access::*;
use cao_gpu::Error;
use cao_gpu::{Adopted, BufferUse, Format, Gpu, ImageDesc, ImageKind, ImageUse, Phase, Stage, ValidationLog};
use cao_model::clip::{Clip, Shape};
use cao_model::look::Look;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::StereoRig;
use cao_testing::methods;
use cao_testing::wgsl::{bind, compile};
use std::ffi::{CStr, c_void};
use std::sync::Mutex;

const FIRST: Stage = Stage::new("first", Phase::Ambient);
const SECOND: Stage = Stage::new("second", Phase::Draw);

/// What the validation layer said to the host.
static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

unsafe extern "system" fn listen(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    _: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan passes a valid message.
    let text = unsafe { (*data).message_as_c_str() }.map(CStr::to_string_lossy).unwrap_or_default();
    MESSAGES.lock().unwrap().push(text.into_owned());
    vk::FALSE
}

/// A minimal engine.
struct Host {
    entry: ash::Entry,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    device: ash::Device,
    family: u32,
    queue: vk::Queue,
    pool: vk::CommandPool,
}

impl Host {
    fn new() -> Self {
        // SAFETY: the calls follow Vulkan's rules; everything passed lives during its call.
        unsafe {
            let entry = ash::Entry::load().unwrap();
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
            let layers: Vec<_> = cao_testing::validated()
                .then_some(c"VK_LAYER_KHRONOS_validation".as_ptr())
                .into_iter()
                .collect();
            let extensions = [ash::ext::debug_utils::NAME.as_ptr()];
            let mut messenger = vk::DebugUtilsMessengerCreateInfoEXT::default()
                .message_severity(
                    vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                        | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                )
                .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
                .pfn_user_callback(Some(listen));
            let create = vk::InstanceCreateInfo::default()
                .application_info(&application)
                .enabled_layer_names(&layers)
                .enabled_extension_names(&extensions)
                .push_next(&mut messenger);
            let instance = entry.create_instance(&create, None).unwrap();
            let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
            let (physical, family) = instance
                .enumerate_physical_devices()
                .unwrap()
                .into_iter()
                .find_map(|p| {
                    let families = instance.get_physical_device_queue_family_properties(p);
                    Some((p, families.iter().position(|f| f.queue_flags.contains(wanted))? as u32))
                })
                .unwrap();
            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
            let extensions: Vec<_> = Gpu::required_extensions().iter().map(|name| name.as_ptr()).collect();
            let mut features = Gpu::required_features();
            let mut chain = features.chain();
            let create = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions)
                .push_next(&mut chain);
            let device = instance.create_device(physical, &create, None).unwrap();
            let queue = device.get_device_queue(family, 0);
            let pool = vk::CommandPoolCreateInfo::default().queue_family_index(family);
            let pool = device.create_command_pool(&pool, None).unwrap();
            Self { entry, instance, physical, device, family, queue, pool }
        }
    }

    fn begin(&self) -> vk::CommandBuffer {
        let allocate =
            vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        // SAFETY: the pool is alive.
        unsafe {
            let cmd = self.device.allocate_command_buffers(&allocate).unwrap()[0];
            self.device.begin_command_buffer(cmd, &Default::default()).unwrap();
            cmd
        }
    }

    fn submit_and_wait(&self, list: &[vk::CommandBuffer]) {
        // SAFETY: the command buffers are recording and of this device.
        unsafe {
            list.iter().for_each(|cmd| self.device.end_command_buffer(*cmd).unwrap());
            let submit = [vk::SubmitInfo::default().command_buffers(list)];
            self.device.queue_submit(self.queue, &submit, vk::Fence::null()).unwrap();
            self.device.queue_wait_idle(self.queue).unwrap();
        }
    }

    fn destroy(self) {
        // SAFETY: nothing made of them is alive any more.
        unsafe {
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

#[test]
fn a_host_keeps_its_handles_and_its_queue() {
    let host = Host::new();
    let adopted = Adopted {
        entry: host.entry.clone(),
        instance: host.instance.clone(),
        physical_device: host.physical,
        device: host.device.clone(),
        queue_family: host.family,
        queue: None,
    };
    // SAFETY: the handles belong together, have what is required, and outlive `gpu`.
    let gpu = unsafe { Gpu::adopt(adopted) }.unwrap();
    assert!(
        matches!(gpu.recorder("ours"), Err(Error::Config { problem, .. }) if problem.contains("record_into"))
    );

    let shader = compile(
        "struct Numbers { x: array<u32> }
         var<immediate> n: u32;
         @group(0) @binding(0) var<storage, read_write> b: Numbers;
         @compute @workgroup_size(8) fn main(@builtin(global_invocation_id) id: vec3u) {
             if id.x < arrayLength(&b.x) { b.x[id.x] += n + id.x; }
         }",
    );
    let pipeline = gpu.compute(shader, "main").unwrap();
    let x = gpu.buffer("x", 4 * 13, BufferUse::Device).unwrap();
    let back = gpu.buffer("back", 4 * 13, BufferUse::Readback).unwrap();

    // Two command buffers, recorded one after the other and submitted together: what the first left pending is known to the second.
    let commands = [host.begin(), host.begin()];
    // SAFETY: the command buffer is recording and submitted once below; the `Recorded` is kept until then.
    let mut rec = unsafe { gpu.record_into(commands[0]) };
    rec.stage(FIRST).unwrap();
    rec.fill(&x, 0, 4 * 13, 100).unwrap();
    rec.barrier(&[TransferWrite], &[StorageRead, StorageWrite]);
    rec.dispatch_over(&pipeline, &[bind("b", &x)], &5u32.to_ne_bytes(), [13, 1, 1]).unwrap();
    rec.end_stage().unwrap();
    let first = rec.finish().unwrap();
    // SAFETY: as above.
    let mut rec = unsafe { gpu.record_into(commands[1]) };
    rec.stage(SECOND).unwrap();
    let copy = |rec: &mut cao_gpu::Recorder| rec.copy_buffer(&x, 0, &back, 0, 4 * 13);
    assert!(matches!(copy(&mut rec), Err(Error::Hazard { problem }) if problem.contains("test.main")));
    rec.barrier(&[StorageWrite], &[TransferRead]);
    copy(&mut rec).unwrap();
    rec.barrier(&[TransferWrite], &[HostRead]);
    rec.end_stage().unwrap();
    let second = rec.finish().unwrap();

    host.submit_and_wait(&commands);
    for (recorded, stage) in [(&first, FIRST), (&second, SECOND)] {
        let timings = recorded.timings().unwrap().expect("the host has waited");
        assert_eq!((timings.len(), timings[0].stage), (1, stage));
    }
    let numbers: Vec<u32> = bytemuck::pod_collect_to_vec(&back.read(0, back.bytes()).unwrap());
    assert_eq!(numbers, (105..118).collect::<Vec<_>>());

    drop((x, back, pipeline));
    assert_eq!(gpu.memory_report().len(), 2, "kept by the recordings");
    drop((first, second));
    assert_eq!(gpu.memory_report(), []);
    let log: ValidationLog = gpu.validation_log();
    drop(gpu);
    log.assert_clean().unwrap();

    // The host goes on.
    let cmd = host.begin();
    host.submit_and_wait(&[cmd]);
    host.destroy();
    assert_eq!(*MESSAGES.lock().unwrap(), [] as [&str; 0]);
}

/// The embedding as the README describes it: the renderer is made with a lent queue, the frame goes into the host's own command
/// buffer, and the ambient volume is that of a renderer with a device of its own.
#[test]
fn a_renderer_lives_on_a_hosts_device_and_in_its_command_buffer() {
    let host = Host::new();
    let adopted = Adopted {
        entry: host.entry.clone(),
        instance: host.instance.clone(),
        physical_device: host.physical,
        device: host.device.clone(),
        queue_family: host.family,
        queue: Some(host.queue),
    };
    // SAFETY: the handles belong together, have what is required, and outlive `gpu`; the queue is used by this thread alone.
    let gpu = unsafe { Gpu::adopt(adopted) }.unwrap();
    let volume = cao_formats::open("builtin:fruit:16").unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    for method in methods() {
        let setup = Setup::of(method, volume.min_spacing());
        let clips = [Clip::remove(Shape::Torus)];
        let renderer = |gpu: &Gpu| {
            let mut renderer =
                Renderer::new(gpu, &volume, transfer.clone(), setup, Format::Rgba16Float).unwrap();
            renderer.set_clips(&clips).unwrap();
            renderer
        };
        let mut hosted = renderer(&gpu);
        let target = |format| {
            let desc = ImageDesc {
                dims: [16, 16, 1],
                layers: 2,
                format,
                kind: ImageKind::D2,
                usage: ImageUse::ATTACHMENT,
            };
            gpu.image("swapchain", &desc).unwrap()
        };
        let (colour, depth) = (target(Format::Rgba16Float), target(Format::D32Float));
        let views = StereoRig::framing(volume.size_mm(), 30.0, 20.0).views(1.0, 1.0, 500.0).unwrap();

        let cmd = host.begin();
        // SAFETY: the command buffer is recording and submitted once below; the `Recorded` is kept until then.
        let mut rec = unsafe { gpu.record_into(cmd) };
        hosted.record_update(&mut rec).unwrap();
        rec.discard(&colour);
        rec.discard(&depth);
        rec.barrier(&[], &[AttachmentWrite]);
        hosted.record_draw(&mut rec, &views, &Look::default(), &colour, &depth, [16, 16]).unwrap();
        let recorded = rec.finish().unwrap();
        host.submit_and_wait(&[cmd]);
        let stages = recorded.timings().unwrap().expect("the host has waited");
        assert!(stages.iter().any(|t| t.stage.name == "raycast"), "{stages:?}");

        let own_gpu = cao_testing::open();
        let mut own = renderer(&own_gpu);
        own.update(&mut |_| ()).unwrap();
        let bits = |r: &Renderer| r.read_ambient().unwrap().into_iter().map(f32::to_bits).collect::<Vec<_>>();
        assert_eq!(bits(&hosted), bits(&own));

        drop((own, hosted, colour, depth, recorded));
        cao_testing::close(own_gpu);
    }
    assert_eq!(gpu.memory_report(), []);
    drop(gpu);
    host.destroy();
    assert_eq!(*MESSAGES.lock().unwrap(), [] as [&str; 0]);
}

#[test]
fn recordings_end_the_way_they_began() {
    let gpu = cao_testing::open();
    let rec = gpu.recorder("ours").unwrap();
    assert!(
        matches!(rec.finish(), Err(Error::Config { problem, .. }) if problem.contains("submit_and_wait"))
    );
    cao_testing::close(gpu);
}
