//! A host with a Vulkan of its own, in miniature: it lends its device and its images, records a frame into its command buffer, submits it
//! itself. `cargo run --release --example host`.

use cao::gpu::ash::{self, vk};
use cao::gpu::{Adopted, Format, Gpu, ImageState, ImageUse, Lent};
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
            ray_queries: false,
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

    /// What an engine renders to: a layer an eye, with its memory.
    fn target(
        &self,
        format: vk::Format,
        usage: vk::ImageUsageFlags,
    ) -> Result<(vk::Image, vk::DeviceMemory), Box<dyn Error>> {
        let create = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(vk::Extent3D { width: SIZE[0], height: SIZE[1], depth: 1 })
            .mip_levels(1)
            .array_layers(2)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(usage);
        // SAFETY: the calls follow Vulkan's rules.
        unsafe {
            let image = self.device.create_image(&create, None)?;
            let needs = self.device.get_image_memory_requirements(image);
            let types = self.instance.get_physical_device_memory_properties(self.physical);
            let local = |i: &u32| {
                let flags = types.memory_types[*i as usize].property_flags;
                needs.memory_type_bits >> i & 1 == 1 && flags.contains(vk::MemoryPropertyFlags::DEVICE_LOCAL)
            };
            let kind = (0..types.memory_type_count).find(local).ok_or("no memory for images")?;
            let allocate =
                vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(kind);
            let memory = self.device.allocate_memory(&allocate, None)?;
            self.device.bind_image_memory(image, memory, 0)?;
            Ok((image, memory))
        }
    }

    fn destroy(self, targets: [(vk::Image, vk::DeviceMemory); 2]) {
        // SAFETY: nothing made of them is alive any more.
        unsafe {
            for (image, memory) in targets {
                self.device.destroy_image(image, None);
                self.device.free_memory(memory, None);
            }
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

/// Pixels of an eye.
const SIZE: [u32; 2] = [256, 256];

fn main() -> Result<(), Box<dyn Error>> {
    let host = Host::new()?;
    // SAFETY: the handles belong together, have what is required, and outlive `gpu`; the queue is used by this thread alone.
    let gpu = unsafe { Gpu::adopt(host.lend()) }?;
    let volume = cao_formats::open("builtin:fruit:32")?;
    let transfer = TransferFunction::preset("auto", volume.range())?;
    let setup = Setup::new(volume.min_spacing());
    // Uses the queue that the host lends; the frames below never do.
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup, Format::Rgba8Srgb)?;
    let eyes = host.target(vk::Format::R8G8B8A8_SRGB, vk::ImageUsageFlags::COLOR_ATTACHMENT)?;
    let planes = host.target(vk::Format::D32_SFLOAT, vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT)?;
    // This host draws nothing of its own before: what its images hold is given up.
    let lend = |image, format, state: ImageState| Lent {
        image,
        size: SIZE,
        layers: 2,
        format,
        usage: ImageUse::ATTACHMENT,
        before: ImageState { layout: vk::ImageLayout::UNDEFINED, ..state },
        after: state,
    };
    let colour = lend(eyes.0, Format::Rgba8Srgb, ImageState::COLOUR_ATTACHMENT);
    let depth = lend(planes.0, Format::D32Float, ImageState::DEPTH_ATTACHMENT);
    // SAFETY: the images are as described, are left and wanted so in every frame, and outlive what is made of them.
    let (colour, depth) = unsafe { (gpu.adopt_image("eyes", &colour)?, gpu.adopt_image("planes", &depth)?) };
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
        rec.acquire(&colour)?;
        rec.acquire(&depth)?;
        let targets = Target::layers(&colour, &depth, views.len());
        renderer.record_draw(&mut rec, &views, &Look::default(), &Targets::new(&targets, SIZE))?;
        rec.release(&colour)?;
        rec.release(&depth)?;
        let recorded = rec.finish()?;
        host.submit_and_wait(cmd)?;
        let stages = recorded.timings()?.ok_or("the host has waited")?;
        println!("frame {frame}: {:.2} ms in {} stages", stages.total(), stages.len());
    }
    drop((renderer, colour, depth));
    drop(gpu);
    host.destroy([eyes, planes]);
    Ok(())
}
