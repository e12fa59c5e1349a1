//! A host that records into its own command buffer gets what `update` and `draw` make, to the bit, and pays nothing for a
//! frame in which nothing changed.

use cao::renderer::{COLOUR, Renderer, Target, Targets};
use cao_gpu::{Access, Format, Gpu, ImageDesc, ImageKind, ImageUse, Phase};
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::look::Look;
use cao_model::mesh::TriangleMesh;
use cao_model::methods::Method;
use cao_model::settings::{MapSettings, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::view::StereoRig;

use cao_testing::{kinds, methods, renderer_of};
use glam::Vec3;
use std::sync::Arc;

fn renderer(gpu: &Gpu, method: Method) -> Renderer {
    let volume = cao_formats::open("builtin:engine:24").unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let setup = Setup::of(method, volume.min_spacing());
    renderer_of(gpu, &volume, transfer, setup, COLOUR).unwrap()
}

fn clip(shape: Shape, at: f32) -> Clip {
    let pose = Pose { translate_mm: Vec3::splat(at), scale: Vec3::splat(6.0), ..Pose::default() };
    Clip { shape, mode: Mode::Remove, pose }
}

#[test]
fn recorded_updates_equal_updates_on_the_own_queue() {
    let gpu = cao_testing::open();
    let mesh = Shape::Mesh(Arc::new(TriangleMesh::torus(24, 12)));
    for method in methods() {
        let (mut hosted, mut own) = (renderer(&gpu, method), renderer(&gpu, method));
        for clips in [
            vec![],
            vec![clip(Shape::Sphere, 5.0)],
            vec![clip(Shape::Sphere, 4.0), clip(mesh.clone(), -3.0)],
            vec![clip(mesh.clone(), 2.0)],
        ] {
            own.set_clips(&clips).unwrap();
            own.update(&mut |_| ()).unwrap();

            let before = gpu.counts().submissions;
            hosted.set_clips(&clips).unwrap();
            let mut rec = gpu.recorder("host frame").unwrap();
            hosted.record_update(&mut rec).unwrap();
            assert_eq!(gpu.counts().submissions, before, "nothing but the host's own");
            let stages = rec.submit_and_wait().unwrap();
            assert!(stages.of(Phase::Clip) > 0.0, "{stages:?}");

            assert_eq!(hosted.read_opacity().unwrap(), own.read_opacity().unwrap());
            let bits =
                |r: &Renderer| r.read_ambient().unwrap().into_iter().map(f32::to_bits).collect::<Vec<_>>();
            assert_eq!(bits(&hosted), bits(&own), "{method:?}, {} clips", clips.len());
        }
        let mut rec = gpu.recorder("host frame").unwrap();
        hosted.record_update(&mut rec).unwrap();
        assert_eq!(*rec.submit_and_wait().unwrap(), [], "nothing changed, so nothing runs");
    }
    cao_testing::close(gpu);
}

/// Layers are those of a mesh's form: a larger one of the same form has the same. With dilation maps, those are made again.
#[test]
fn another_scale_of_a_clip_mesh_draws_no_layers() {
    let gpu = cao_testing::open();
    let mesh = Shape::Mesh(Arc::new(TriangleMesh::torus(24, 12)));
    let scaled = |scale: Vec3| {
        let mut clip = clip(mesh.clone(), 2.0);
        clip.pose.scale = scale;
        [clip]
    };
    let form = Vec3::new(4.0, 6.0, 5.0);
    for method in kinds() {
        let mut r = renderer(&gpu, method);
        // Which maps this clip asks for.
        let mut made = |clips: &[Clip]| {
            let before = gpu.counts().submissions;
            r.set_clips(clips).unwrap();
            assert_eq!(gpu.counts().submissions, before, "{method:?}");
            let times = r.update(&mut |_| ()).unwrap();
            let mut fresh = renderer(&gpu, method);
            fresh.set_clips(clips).unwrap();
            fresh.update(&mut |_| ()).unwrap();
            assert!(r.read_opacity().unwrap() == fresh.read_opacity().unwrap(), "{method:?}");
            assert!(r.read_ambient().unwrap() == fresh.read_ambient().unwrap(), "{method:?}");
            [cao::stages::PEEL, cao::stages::DILATE].map(|stage| times.iter().any(|t| t.stage == stage))
        };
        let dilates = [Method::Lao, Method::Cao].contains(&method);
        assert_eq!(made(&scaled(form)), [true, dilates]);
        for times in [2.0, 0.5, 1.0] {
            assert_eq!(made(&scaled(times * form)), [false, dilates], "{method:?} {times}");
        }
        assert_eq!(made(&scaled(form)), [false, false], "{method:?}");
        // Another form has layers of its own.
        assert_eq!(made(&scaled(Vec3::new(4.0, 4.0, 6.0))), [true, dilates], "{method:?}");
    }
    cao_testing::close(gpu);
}

#[test]
fn recorded_frames_draw_both_eyes_into_the_hosts_images() {
    let gpu = cao_testing::open();
    for method in methods() {
        let mut r = renderer(&gpu, method);
        let size = [24, 20];
        let views = StereoRig::framing([24.0; 3], 30.0, 20.0).views(1.2, 1.0, 200.0).unwrap();
        let target = |format| {
            let usage = ImageUse::ATTACHMENT | ImageUse::SAMPLED;
            let dims = [size[0], size[1], 1];
            gpu.image("swapchain", &ImageDesc { dims, layers: 2, format, kind: ImageKind::D2, usage })
                .unwrap()
        };
        let (colour, depth) = (target(COLOUR), target(Format::D32Float));
        let mut rec = gpu.recorder("host frame").unwrap();
        rec.discard(&colour);
        rec.discard(&depth);
        rec.barrier(&[], &[Access::AttachmentWrite]);
        r.record_update(&mut rec).unwrap();
        r.record_draw(
            &mut rec,
            &views,
            &Look::default(),
            &Targets::new(&Target::layers(&colour, &depth, views.len()), size),
        )
        .unwrap();
        let stages: Vec<_> = rec.submit_and_wait().unwrap().into_iter().map(|t| t.stage).collect();
        assert!(stages.ends_with(&[cao::stages::RAYCAST, cao::stages::PRESENT]), "{stages:?}");

        let (drawn, _) = r.draw(&views, &Look::default(), size).unwrap();
        let bytes = u64::from(size[0] * size[1]) * 16;
        let back = gpu.buffer("back", bytes, cao_gpu::BufferUse::Readback).unwrap();
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
    }
    cao_testing::close(gpu);
}

fn bits(values: Vec<f32>) -> Vec<u32> {
    values.into_iter().map(f32::to_bits).collect()
}

#[test]
fn a_frame_that_was_dropped_is_made_good_after_invalidate() {
    let gpu = cao_testing::open();
    for method in methods() {
        let (mut hosted, mut own) = (renderer(&gpu, method), renderer(&gpu, method));
        let mesh = Shape::Mesh(Arc::new(TriangleMesh::torus(24, 12)));
        for (frame, clips) in [vec![clip(mesh.clone(), 2.0)], vec![clip(Shape::Box, 3.0), clip(mesh, -3.0)]]
            .into_iter()
            .enumerate()
        {
            hosted.set_clips(&clips).unwrap();
            let mut dropped = gpu.recorder("dropped frame").unwrap();
            hosted.record_update(&mut dropped).unwrap();
            drop(dropped);
            hosted.invalidate();
            let times = hosted.update(&mut |_| ()).unwrap();
            assert!(times.of(Phase::Opacity) > 0.0, "everything runs again: {times:?}");
            assert!(times.iter().any(|t| t.stage.name == "peel"), "that of the mesh, too: {times:?}");

            own.set_clips(&clips).unwrap();
            own.update(&mut |_| ()).unwrap();
            assert_eq!(hosted.read_opacity().unwrap(), own.read_opacity().unwrap());
            // That of rays by brick says what the last update computed: there everything.
            if method != Method::Rays {
                assert_eq!(hosted.read_mask().unwrap(), own.read_mask().unwrap());
            }
            let ambient = |r: &Renderer| bits(r.read_ambient().unwrap());
            assert!(ambient(&hosted) == ambient(&own), "{method:?}, frame {frame}");
        }
    }
    cao_testing::close(gpu);
}

#[test]
fn what_is_out_of_date_is_neither_drawn_nor_read() {
    let gpu = cao_testing::open();
    for method in methods() {
        let mut r = renderer(&gpu, method);
        let views = StereoRig::framing([24.0; 3], 30.0, 20.0).views(1.0, 1.0, 200.0).unwrap();
        let look = Look::default();
        let target = |format| {
            let usage = ImageUse::ATTACHMENT | ImageUse::SAMPLED;
            gpu.image("target", &ImageDesc { dims: [8, 8, 1], layers: 2, format, kind: ImageKind::D2, usage })
                .unwrap()
        };
        let (colour, depth) = (target(COLOUR), target(Format::D32Float));
        let uses = |r: &Renderer| -> Vec<(&str, Option<String>)> {
            let mut rec = gpu.recorder("frame").unwrap();
            rec.discard(&colour);
            rec.discard(&depth);
            let said = |result: cao::Result<()>| result.err().map(|error| error.to_string());
            let uses = vec![
                (
                    "record_draw",
                    said(
                        r.record_draw(
                            &mut rec,
                            &views,
                            &look,
                            &Targets::new(&Target::layers(&colour, &depth, views.len()), [8, 8]),
                        )
                        .map(drop),
                    ),
                ),
                ("draw", said(r.draw(&views, &look, [8, 8]).map(drop))),
                ("verify", said(cao::verify::verify(r, &mut |_| ()).map(drop))),
                ("seen_by_both", said(cao::verify::seen_by_both(r, &views, &look, &[Vec3::ZERO]).map(drop))),
                ("read_ambient", said(r.read_ambient().map(drop))),
                ("read_opacity", said(r.read_opacity().map(drop))),
                ("read_mask", said(r.read_mask().map(drop))),
            ];
            rec.submit_and_wait().unwrap();
            uses
        };
        type Change = fn(&mut Renderer);
        let changes: [(&str, Change); 5] = [
            ("new", |_| ()),
            ("clips", |r| r.set_clips(&[clip(Shape::Sphere, 5.0)]).unwrap()),
            ("transfer", |r| {
                r.set_transfer(TransferFunction::preset("paper", (0.0, 255.0)).unwrap()).unwrap()
            }),
            ("setup", |r| {
                let setup = Setup::of(Method::Lao, 2.0);
                r.set_setup(setup).unwrap();
            }),
            ("invalidate", Renderer::invalidate),
        ];
        for (change, make) in changes {
            make(&mut r);
            for (name, error) in uses(&r) {
                let error = error.unwrap_or_else(|| panic!("{name} after {change} must be refused"));
                assert!(error.contains("ambient volume") && error.contains("update"), "{error}");
            }
            r.update(&mut |_| ()).unwrap();
            for (name, error) in uses(&r) {
                assert_eq!(error, None, "{name} after {change} and an update");
            }
        }
        drop((r, colour, depth));
    }
    cao_testing::close(gpu);
}

/// What a frame of the default method asks of Vulkan, whatever changed: one submission once its pace is known, and few commands. A mesh that
/// was not there has a draw and a dispatch for each surface there may be, and on our queue a submission of its own.
#[test]
fn an_update_is_one_submission_of_few_commands() {
    const COMMANDS: u64 = 40;
    const PEELING: u64 = 2 * (2 * MapSettings::MAX_PAIRS as u64 + 3) + 6;
    // A machine that does other things is slow for a while, not for so many updates.
    const TRIES: u32 = 50;
    let gpu = cao_testing::open();
    let volume = cao_formats::open("builtin:engine:24").unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut setup = Setup::new(volume.min_spacing());
    // Far from a tenth of a second on any device.
    setup.occlusion.radius_mm = 3.0;
    let mut r = renderer_of(&gpu, &volume, transfer.clone(), setup, COLOUR).unwrap();
    r.update(&mut |_| ()).unwrap();
    type Change<'a> = &'a dyn Fn(&mut Renderer);
    let mesh = [clip(Shape::Mesh(Arc::new(TriangleMesh::torus(24, 12))), 2.0)];
    let changes: [(&str, Change); 5] = [
        ("a mesh", &|r| r.set_clips(&mesh).unwrap()),
        ("a sphere", &|r| r.set_clips(&[clip(Shape::Sphere, 5.0)]).unwrap()),
        ("it moved", &|r| r.set_clips(&[clip(Shape::Sphere, 4.0)]).unwrap()),
        ("another transfer function", &|r| r.set_transfer(transfer.clone()).unwrap()),
        ("everything", &Renderer::invalidate),
    ];
    for (what, change) in changes {
        // What a busy machine made look slow goes in pieces once and is looked at anew; so the first one of a few counts.
        let mut update = || {
            r.set_clips(&[clip(Shape::Sphere, 3.0)]).unwrap();
            r.update(&mut |_| ()).unwrap();
            change(&mut r);
            let before = gpu.counts();
            r.update(&mut |_| ()).unwrap();
            gpu.counts() - before
        };
        let (submissions, most) = if what == "a mesh" { (2, COMMANDS + PEELING) } else { (1, COMMANDS) };
        let asked = (0..TRIES).map(|_| update()).find(|asked| asked.submissions == submissions);
        let asked = asked.unwrap_or_else(|| panic!("{what}: always more than {submissions} submissions"));
        assert!(asked.commands <= most && asked.calls < 6 * most, "{what}: {asked:?}");

        change(&mut r);
        let mut rec = gpu.recorder("host frame").unwrap();
        r.record_update(&mut rec).unwrap();
        let recorded = rec.counts();
        assert!((1..=most).contains(&recorded.commands), "{what}: {recorded:?}");
        rec.submit_and_wait().unwrap();
    }
    let before = gpu.counts();
    r.update(&mut |_| ()).unwrap();
    assert_eq!(gpu.counts(), before, "nothing changed");
    drop(r);
    cao_testing::close(gpu);
}
