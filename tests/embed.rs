//! A host that records into its own command buffer gets what `update` and `draw` make, to the bit, and pays nothing for a
//! frame in which nothing changed.

mod gpu_support;

use cao::clip::{Clip, Mode, Pose, Shape};
use cao::gpu::{Access, Format, Gpu, ImageDesc, ImageKind, ImageUse};
use cao::mesh::TriangleMesh;
use cao::renderer::{COLOUR, Renderer, Setup};
use cao::scene::Method;
use cao::stage::eyes::Look;
use cao::transfer::TransferFunction;
use cao::view::StereoRig;
use cao::volume;
use glam::Vec3;
use std::sync::Arc;

fn renderer(gpu: &Gpu, method: Method) -> Renderer {
    let volume = volume::open("builtin:engine:24").unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let setup = Setup { method, ..Setup::paper(volume.min_spacing()) };
    Renderer::new(gpu, &volume, transfer, setup, COLOUR).unwrap()
}

fn clip(shape: Shape, at: f32) -> Clip {
    let pose = Pose { translate_mm: Vec3::splat(at), scale: Vec3::splat(6.0), ..Pose::default() };
    Clip { shape, mode: Mode::Remove, pose }
}

#[test]
fn recorded_updates_equal_updates_on_the_own_queue() {
    let gpu = gpu_support::open();
    let mesh = Shape::Mesh(Arc::new(TriangleMesh::torus(24, 12)));
    for method in [Method::Cao, Method::Lao] {
        let (mut hosted, mut own) = (renderer(&gpu, method), renderer(&gpu, method));
        for clips in [
            vec![],
            vec![clip(Shape::Sphere, 5.0)],
            vec![clip(Shape::Sphere, 4.0), clip(mesh.clone(), -3.0)],
            vec![clip(mesh.clone(), 2.0)],
        ] {
            own.set_clips(&clips).unwrap();
            own.update(&mut |_| ()).unwrap();

            hosted.set_clips(&clips).unwrap();
            let mut rec = gpu.recorder("host frame").unwrap();
            hosted.record_update(&mut rec).unwrap();
            let stages = rec.submit_and_wait().unwrap();
            assert!(stages.iter().any(|(name, _)| name == "classify"), "{stages:?}");

            assert_eq!(hosted.read_opacity().unwrap(), own.read_opacity().unwrap());
            let bits =
                |r: &Renderer| r.read_ambient().unwrap().into_iter().map(f32::to_bits).collect::<Vec<_>>();
            assert_eq!(bits(&hosted), bits(&own), "{method:?}, {} clips", clips.len());
        }
        let mut rec = gpu.recorder("host frame").unwrap();
        hosted.record_update(&mut rec).unwrap();
        assert_eq!(rec.submit_and_wait().unwrap(), [], "nothing changed, so nothing runs");
    }
    gpu_support::close(gpu);
}

#[test]
fn recorded_frames_draw_both_eyes_into_the_hosts_images() {
    let gpu = gpu_support::open();
    let mut r = renderer(&gpu, Method::Cao);
    let size = [24, 20];
    let views = StereoRig::framing([24.0; 3], 30.0, 20.0).views(1.2, 1.0, 200.0).unwrap();
    let target = |format| {
        let usage = ImageUse::ATTACHMENT | ImageUse::SAMPLED;
        let dims = [size[0], size[1], 1];
        gpu.image("swapchain", &ImageDesc { dims, layers: 2, format, kind: ImageKind::D2, usage }).unwrap()
    };
    let (colour, depth) = (target(COLOUR), target(Format::D32Float));
    let mut rec = gpu.recorder("host frame").unwrap();
    rec.discard(&colour);
    rec.discard(&depth);
    rec.barrier(&[], &[Access::AttachmentWrite]);
    r.record_update(&mut rec).unwrap();
    r.record_draw(&mut rec, &views, &Look::default(), &colour, &depth, size).unwrap();
    let stages: Vec<_> = rec.submit_and_wait().unwrap().into_iter().map(|(name, _)| name).collect();
    assert_eq!(stages.last().map(String::as_str), Some("raycast"), "{stages:?}");

    let (drawn, _) = r.draw(&views, &Look::default(), size).unwrap();
    let bytes = u64::from(size[0] * size[1]) * 16;
    let back = gpu.buffer("back", bytes, cao::gpu::BufferUse::Readback).unwrap();
    for eye in 0..2 {
        let mut rec = gpu.recorder("read").unwrap();
        rec.copy_image_to_buffer(&colour, eye, [0; 3], [size[0], size[1], 1], &back, 0).unwrap();
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        rec.submit_and_wait().unwrap();
        let pixels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&back.read(0, bytes).unwrap());
        assert_eq!(pixels, drawn.colour[eye as usize]);
        assert!(pixels.iter().any(|p| p[3] > 0.9), "eye {eye} sees the volume");
    }
    drop((r, colour, depth, back));
    gpu_support::close(gpu);
}
