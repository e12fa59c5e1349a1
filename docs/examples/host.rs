//! A host with a Vulkan of its own, in miniature: it lends its device, records a frame into its command buffer, submits it
//! itself. `cargo run --release --example host`.

use cao::gpu::ash::{self, vk};
use cao::gpu::{Access, Adopted, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse};
use cao::renderer::{Target, Targets};
use cao::{Clip, Look, Renderer, Setup, Shape, StereoRig, TransferFunction};
use std::error::Error;

/// What an engine has anyway.
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
    fn new() -> Result<Self, Box<dyn Error>> {
        // SAFETY: the calls follow Vulkan's rules; everything passed lives during its call.
        unsafe {
            let entry = ash::Entry::load()?;
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
            let create = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry.create_instance(&create, None)?;
            let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
            let fits = |p: vk::PhysicalDevice| {
                let families = instance.get_physical_device_queue_family_properties(p);
                Some((p, families.iter().position(|f| f.queue_flags.contains(wanted))? as u32))
            };
            let found = instance.enumerate_physical_devices()?.into_iter().find_map(fits);
            let (physical, family) = found.ok_or("no device")?;
            // What cao needs beside what the engine asks for.
            let extensions: Vec<_> = Gpu::required_extensions().iter().map(|name| name.as_ptr()).collect();
            let mut features = Gpu::required_features();
            let mut chain = features.chain();
            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
            let create = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions)
                .push_next(&mut chain);
            let device = instance.create_device(physical, &create, None)?;
            let queue = device.get_device_queue(family, 0);
            let pool = vk::CommandPoolCreateInfo::default().queue_family_index(family);
            let pool = device.create_command_pool(&pool, None)?;
            Ok(Self { entry, instance, physical, device, family, queue, pool })
        }
    }

    fn lend(&self) -> Adopted {
        Adopted {
            entry: self.entry.clone(),
            instance: self.instance.clone(),
            physical_device: self.physical,
            device: self.device.clone(),
            queue_family: self.family,
            compute_only: false,
            queue: Some(self.queue),
        }
    }

    fn begin(&self) -> Result<vk::CommandBuffer, vk::Result> {
        let one = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        // SAFETY: the pool is alive.
        unsafe {
            let cmd = self.device.allocate_command_buffers(&one)?[0];
            self.device.begin_command_buffer(cmd, &Default::default())?;
            Ok(cmd)
        }
    }

    fn submit_and_wait(&self, cmd: vk::CommandBuffer) -> Result<(), vk::Result> {
        // SAFETY: the command buffer is recording and of this device.
        unsafe {
            self.device.end_command_buffer(cmd)?;
            let submit = [vk::SubmitInfo::default().command_buffers(std::slice::from_ref(&cmd))];
            self.device.queue_submit(self.queue, &submit, vk::Fence::null())?;
            self.device.queue_wait_idle(self.queue)
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

fn target(gpu: &Gpu, format: Format) -> cao::gpu::Result<Image> {
    let (kind, usage) = (ImageKind::D2, ImageUse::ATTACHMENT);
    gpu.image("target", &ImageDesc { dims: [256, 256, 1], layers: 2, format, kind, usage })
}

fn main() -> Result<(), Box<dyn Error>> {
    let host = Host::new()?;
    // SAFETY: the handles belong together, have what is required, and outlive `gpu`; the queue is used by this thread alone.
    let gpu = unsafe { Gpu::adopt(host.lend()) }?;
    let volume = cao_formats::open("builtin:fruit:32")?;
    let transfer = TransferFunction::preset("auto", volume.range())?;
    let setup = Setup::new(volume.min_spacing());
    // Uses the queue that the host lends; the frames below never do.
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup, Format::Rgba16Float)?;
    let (colour, depth) = (target(&gpu, Format::Rgba16Float)?, target(&gpu, Format::D32Float)?);
    let views = StereoRig::framing(volume.size_mm(), 30.0, 20.0).views(1.0, 1.0, 500.0)?;

    for frame in 0..3 {
        let mut clip = Clip::remove(Shape::Sphere);
        clip.pose.translate_mm.x = frame as f32;
        clip.pose.scale = cao::glam::Vec3::splat(8.0);
        renderer.set_clips(&[clip])?;

        let cmd = host.begin()?;
        // SAFETY: the command buffer is recording and submitted once below; `recorded` is kept until it has run.
        let mut rec = unsafe { gpu.record_into(cmd) };
        renderer.record_update(&mut rec)?;
        rec.discard(&colour);
        rec.discard(&depth);
        rec.barrier(&[], &[Access::AttachmentWrite]);
        renderer.record_draw(
            &mut rec,
            &views,
            &Look::default(),
            &Targets::new(&Target::layers(&colour, &depth, views.len()), [256, 256]),
        )?;
        let recorded = rec.finish()?;
        host.submit_and_wait(cmd)?;
        let stages = recorded.timings()?.ok_or("the host has waited")?;
        println!("frame {frame}: {:.2} ms in {} stages", stages.total(), stages.len());
    }
    drop((renderer, colour, depth));
    drop(gpu);
    host.destroy();
    Ok(())
}
