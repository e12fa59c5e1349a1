//! A host with its own Vulkan: its device is used, its command buffer recorded into, and its handles survive.

use crate::host::Host;
use ash::vk;
use cao::mesh::ambient::ByRays;
use cao::mesh_renderer::MeshRenderer;
use cao::renderer::{Renderer, Target, Targets};
use cao_gpu::Access::*;
use cao_gpu::Error;
use cao_gpu::{BufferUse, Format, Gpu, ImageDesc, ImageKind, ImageUse, Phase, Stage, ValidationLog};
use cao_model::clip::{Clip, Shape};
use cao_model::look::Look;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::StereoRig;
use cao_testing::wgsl::{bind, compile};
use cao_testing::worlds::{corner, corner_eyes};
use cao_testing::{close, methods, open, renderer_of};

const FIRST: Stage = Stage::new("first", Phase::Ambient);
const SECOND: Stage = Stage::new("second", Phase::Draw);

#[test]
fn a_host_keeps_its_handles_and_its_queue() {
    let host = Host::new();
    let gpu = host.adopted(None);
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
}

/// The embedding as the README describes it: the renderer is made with a lent queue, the frame goes into the host's own command
/// buffer, and the ambient volume is that of a renderer with a device of its own.
#[test]
fn a_renderer_lives_on_a_hosts_device_and_in_its_command_buffer() {
    let host = Host::new();
    let gpu = host.adopted(Some(host.queue));
    let volume = cao_formats::open("builtin:fruit:16").unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    for method in methods() {
        let setup = Setup::of(method, volume.min_spacing());
        let clips = [Clip::remove(Shape::Torus)];
        let renderer = |gpu: &Gpu| {
            let mut renderer =
                renderer_of(gpu, &volume, transfer.clone(), setup, Format::Rgba16Float).unwrap();
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
        hosted
            .record_draw(
                &mut rec,
                &views,
                &Look::default(),
                &Targets::new(&Target::layers(&colour, &depth, views.len()), [16, 16]),
            )
            .unwrap();
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

/// An instance of Vulkan 1.1 hides what is of 1.3; a queue that is not to draw still makes pictures, and refuses meshes and attachments
/// by name. What is drawn is the same to the bit.
#[test]
fn older_instances_and_queues_without_graphics_give_the_same_picture() {
    let volume = cao_formats::open("builtin:fruit:16").unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let views = StereoRig::framing(volume.size_mm(), 30.0, 20.0).views(1.0, 1.0, 500.0).unwrap();
    let mut pictures = Vec::new();
    for (version, compute_only) in
        [(vk::API_VERSION_1_3, false), (vk::API_VERSION_1_3, true), (vk::API_VERSION_1_1, false)]
    {
        let host = Host::of_version(version);
        let gpu = host.adopted_for(Some(host.queue), compute_only);
        assert!(gpu.on_trust().iter().any(|what| what.contains("synchronization2")), "{:?}", gpu.on_trust());
        let setup = Setup::new(volume.min_spacing());
        let mut renderer = renderer_of(&gpu, &volume, transfer.clone(), setup, Format::Rgba16Float).unwrap();
        renderer.set_clips(&[Clip::remove(Shape::Torus)]).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        let (image, timings) = renderer.draw(&views, &Look::default(), [16, 16]).unwrap();
        assert!(timings.iter().any(|t| t.stage.name == "raycast"), "{timings:?}");
        pictures.push(image.colour);
        let mesh = Clip::remove(Shape::Mesh(cao_testing::convex()));
        let clipped = renderer.set_clips(&[mesh]);
        assert_eq!(clipped.is_err(), compute_only);
        if let Err(error) = clipped {
            let error = error.to_string();
            assert!(
                error.contains("peel") && error.contains("graphics") && error.contains("clip meshes"),
                "{error}"
            );
            let usage = ImageUse::ATTACHMENT;
            let desc = ImageDesc {
                dims: [16, 16, 1],
                layers: 2,
                format: Format::Rgba16Float,
                kind: ImageKind::D2,
                usage,
            };
            let colour = gpu.image("swapchain", &desc).unwrap();
            let depth = gpu.image("swapchain", &ImageDesc { format: Format::D32Float, ..desc }).unwrap();
            renderer.update(&mut |_| ()).unwrap();
            let mut rec = gpu.recorder("refused").unwrap();
            let targets = Target::layers(&colour, &depth, 2);
            let drawn =
                renderer.record_draw(&mut rec, &views, &Look::default(), &Targets::new(&targets, [16, 16]));
            assert!(drawn.unwrap_err().to_string().contains("record_picture"));
        }
        drop(renderer);
        drop(gpu);
        host.destroy();
    }
    assert!(pictures[0] == pictures[1] && pictures[0] == pictures[2]);
    assert!(pictures[0][0].iter().any(|c| c[3] > 0.5));
}

/// A device without an extension, and one that hides what is needed, are refused by name.
#[test]
fn a_device_that_lacks_a_call_is_refused_by_its_name() {
    for (version, without, word) in [
        (vk::API_VERSION_1_3, ash::khr::push_descriptor::NAME, "VK_KHR_push_descriptor"),
        (vk::API_VERSION_1_1, ash::khr::synchronization2::NAME, "VK_KHR_synchronization2"),
        (vk::API_VERSION_1_1, ash::khr::dynamic_rendering::NAME, "VK_KHR_dynamic_rendering"),
    ] {
        let host = Host::without(version, Some(without));
        let refused = host.try_adopted().map(drop).unwrap_err().to_string();
        assert!(refused.contains(word), "{refused}");
        host.destroy();
    }
    let words = [Gpu::required(), Gpu::optional()].concat().join("; ");
    for word in ["VK_KHR_push_descriptor", "dynamicRendering", "barriers", "R16_UNORM", "without"] {
        assert!(words.contains(word), "{words}");
    }
}

/// Ray queries of a host's device are used where it says that there are some, and its word is checked as far as anybody can.
#[test]
fn ray_queries_of_a_host_are_taken_at_its_word() {
    let host = Host::new();
    let refused = host.adopted_for_ray_queries().map(drop).unwrap_err().to_string();
    assert!(refused.contains("feature::RAY_QUERIES") && refused.contains("without ray_queries"), "{refused}");
    let gpu = host.adopted(None);
    assert!(!gpu.ray_queries() && !gpu.on_trust().concat().contains("rayQuery"));
    drop(gpu);
    host.destroy();
    let ours = open();
    if !ours.ray_queries() {
        eprintln!("skipped: this device has no ray queries");
        return close(ours);
    }
    close(ours);
    let host = Host::with_ray_queries();
    let gpu = host.adopted_for_ray_queries().unwrap();
    assert!(gpu.ray_queries() && gpu.on_trust().concat().contains("rayQuery"));
    let world = corner();
    let [walks, queries] = [ByRays::walks(&gpu, 8), ByRays::queries(&gpu, 8)].map(|method| {
        let mut renderer = MeshRenderer::with(&gpu, &world, Box::new(method.unwrap()), 40.0).unwrap();
        renderer.draw(&corner_eyes([16, 12]), &Look::default(), [16, 12], None, &mut |_| ()).unwrap();
        renderer.accessibility().unwrap()
    });
    assert!(walks.iter().any(|value| *value < 1.0));
    let apart = walks.iter().zip(&queries).filter(|(a, b)| (**a - **b).abs() > 1e-5).count();
    assert!(
        apart * 100 <= walks.len(),
        "{apart} pixels; tests/kernels/trace_queries.rs says why there may be any"
    );
    drop(gpu);
    host.destroy();
}
