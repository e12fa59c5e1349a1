//! A good guest: no memory at any moment leaves what was there before in use, threads and devices do not disturb each other, several volumes make one
//! picture, and a lost device says so.

use crate::scenes::{NAMES, Scene, assert_as_fresh, scene};
use cao::renderer::{COLOUR, Over, Renderer, StereoImage, Target, Targets};
use cao_gpu::{Access, BufferUse, Format, Gpu, ImageDesc, ImageKind, ImageUse, OpenOptions};
use cao_measure::random::Random;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Shape};
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::view::View;
use cao_model::volume::Volume;
use cao_testing::*;
use glam::Vec3;

/// Does something while the first, the second … allocation fails, until none does; `undone` sees the renderer after each failure. How many failed.
fn at_every_allocation<T>(
    gpu: &Gpu,
    renderer: &mut Renderer,
    act: impl Fn(&mut Renderer) -> cao::Result<T>,
    mut undone: impl FnMut(&mut Renderer),
) -> u32 {
    for n in 0.. {
        gpu.fail_after(Some(n));
        let done = act(renderer);
        gpu.fail_after(None);
        match done {
            Ok(_) => return n,
            Err(error) => {
                let said = error.to_string();
                assert!(said.contains("fail_after") && !error.device_lost(), "{said}");
                undone(renderer);
            }
        }
    }
    unreachable!()
}

#[test]
fn without_memory_what_was_there_stays_in_use() {
    let gpu = open();
    for (case, method) in methods().enumerate() {
        let mut random = Random::new(131 + case as u64);
        let mut scene = scene(&mut random, NAMES[case % NAMES.len()], method);
        let size = size_mm(&grid_of(&scene.volume));
        scene.clips = vec![random_clip(&mut random, &Shape::Mesh(concave()), size)];

        // Nothing stays of a renderer that could not be made. One that could holds the pipelines, so that none is compiled for each.
        let made = scene.renderer(&gpu);
        let (held, mut failed) = (gpu.memory_report(), 0);
        loop {
            gpu.fail_after(Some(failed));
            let made = renderer_of(&gpu, &scene.volume, scene.transfer.clone(), scene.setup, COLOUR);
            gpu.fail_after(None);
            match made {
                Ok(_) => break,
                Err(error) => assert!(error.to_string().contains("fail_after"), "{error}"),
            }
            assert_eq!(gpu.memory_report(), held);
            failed += 1;
        }
        assert!(failed > 10, "{failed}");
        drop(made);
        assert_eq!(gpu.memory_report(), []);

        let mut renderer = scene.renderer(&gpu);
        let as_before = |scene: &Scene, what: &str| {
            let (fresh, what) = (scene.renderer(&gpu), format!("{}: {what}", method.name()));
            move |renderer: &mut Renderer| {
                renderer.update(&mut |_| ()).unwrap();
                let (found, expected) = (renderer.read_ambient().unwrap(), fresh.read_ambient().unwrap());
                assert!(found.iter().map(|a| a.to_bits()).eq(expected.iter().map(|a| a.to_bits())), "{what}");
            }
        };
        let other = methods().find(|other| *other != method).unwrap();
        let others =
            Setup { method: other, maps: scene.setup.maps, ..Setup::of(other, scene.volume.min_spacing()) };
        let mesh = random_clip(&mut random, &Shape::Mesh(convex()), size);
        let part = Volume::new([3; 3], scene.volume.spacing, Values::U8(vec![7; 27])).unwrap();
        let views = eyes(&scene.volume, 30.0);

        let count =
            at_every_allocation(&gpu, &mut renderer, |r| r.set_setup(others), as_before(&scene, "method"));
        assert!(count > 0);
        renderer.set_setup(scene.setup).unwrap();
        let clips = [scene.clips[0].clone(), mesh];
        let count =
            at_every_allocation(&gpu, &mut renderer, |r| r.set_clips(&clips), as_before(&scene, "clips"));
        assert!(count > 0);
        renderer.set_clips(&scene.clips).unwrap();
        at_every_allocation(
            &gpu,
            &mut renderer,
            |r| r.set_values([1; 3], &part),
            as_before(&scene, "values"),
        );
        let Values::U8(values) = &mut scene.volume.values else { panic!("bytes") };
        let [x, y, _] = scene.volume.dims;
        (0..9).for_each(|i| values[((1 + i / 3) * y + 1 + i % 3) * x + 1..][..3].fill(7));
        at_every_allocation(
            &gpu,
            &mut renderer,
            |r| {
                r.invalidate();
                r.update(&mut |_| ())
            },
            as_before(&scene, "update"),
        );
        let draw = |r: &Renderer| r.draw(&views, &Look::default(), [9, 8]).map(|(image, _)| image.colour);
        let before = draw(&renderer).unwrap();
        let count = at_every_allocation(&gpu, &mut renderer, |r| draw(r), |_| ());
        assert!(count > 0);
        assert!(draw(&renderer).unwrap() == before);
        let context = || format!("{} at the end", method.name());
        assert_as_fresh(&scene, &renderer, &scene.renderer(&gpu), &context);
    }
    close(gpu);
}

/// What a host may move to other threads and share between them.
#[test]
fn handles_can_be_sent_and_shared() {
    fn both<T: Send + Sync>() {}
    both::<Gpu>();
    both::<Renderer>();
    both::<cao_gpu::Image>();
    both::<cao_gpu::Buffer>();
    both::<cao_gpu::Recorded>();
    both::<cao::renderer::LateViews>();
}

/// Two threads with a renderer each, on one device and on one each: what they make is what one alone makes.
#[test]
fn renderers_of_two_threads_do_not_disturb_each_other() {
    let work = |gpu: &Gpu, seed: u64| {
        let method = methods().nth(seed as usize % methods().count()).unwrap();
        let mut random = Random::new(140 + seed);
        let mut scene = scene(&mut random, NAMES[seed as usize % NAMES.len()], method);
        let mut renderer = scene.renderer(gpu);
        let mut found = Vec::new();
        for _ in 0..8 {
            scene.edit(&mut random, &mut renderer);
            renderer.update(&mut |_| ()).unwrap();
            found.push(renderer.read_ambient().unwrap());
        }
        let views = eyes(&scene.volume, 20.0);
        (found, renderer.draw(&views, &Look::default(), [8, 8]).unwrap().0.colour)
    };
    let (one, other) = (open(), open());
    let alone = [0, 1].map(|seed| work(&one, seed));
    for devices in [[&one, &one], [&one, &other]] {
        let together = std::thread::scope(|threads| {
            let running = [0, 1].map(|seed: usize| threads.spawn(move || work(devices[seed], seed as u64)));
            running.map(|thread| thread.join().unwrap())
        });
        assert!(together == alone);
    }
    close(one);
    close(other);
}

/// Several volumes: a renderer each, the farthest first, each over what is there; places differ by where the eyes are.
#[test]
fn volumes_behind_one_another_are_laid_over_from_the_back() {
    const SIZE: [u32; 2] = [32, 28];
    let gpu = open();
    let renderer = |name: &str, opacity: f32| {
        let volume = builtin_box(name, [12, 12, 12], [1.0; 3]).unwrap();
        let colour = vec![[0.0, 1.0, 0.4, 0.2]];
        let transfer = TransferFunction::new(vec![[0.0, 0.0], [255.0, opacity]], colour, None).unwrap();
        let mut renderer = renderer_of(&gpu, &volume, transfer, Setup::new(1.0), COLOUR).unwrap();
        renderer.set_clips(&[Clip::remove(Shape::Sphere)]).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        renderer
    };
    let (near, far) = (renderer("fruit", 0.3), renderer("engine", 0.9));
    let views = eyes(&builtin_box("fruit", [12, 12, 12], [1.0; 3]).unwrap(), 30.0);
    // The far volume's centre is away from the near one's, so the eyes are away from it by as much more.
    let away = (views[0].orientation * Vec3::NEG_Z) * 25.0;
    let views_of_far = views.map(|view| View { position: view.position - away, ..view });
    let target = |format| {
        let usage = ImageUse::ATTACHMENT;
        let desc = ImageDesc { dims: [SIZE[0], SIZE[1], 1], layers: 2, format, kind: ImageKind::D2, usage };
        gpu.image("target", &desc).unwrap()
    };
    let (colour, depth) = (target(COLOUR), target(Format::D32Float));
    let targets = Target::layers(&colour, &depth, 2);
    let bytes = u64::from(16 * SIZE[0] * SIZE[1]);
    let back = gpu.buffer("back", bytes, BufferUse::Readback).unwrap();
    run(&gpu, |rec| {
        rec.discard(&colour);
        rec.discard(&depth);
        rec.barrier(&[], &[Access::AttachmentWrite]);
        far.record_draw(rec, &views_of_far, &Look::default(), &Targets::new(&targets, SIZE)).unwrap();
        rec.barrier(&[Access::AttachmentWrite], &[Access::AttachmentWrite]);
        let over = Targets { over: Over::Scene, ..Targets::new(&targets, SIZE) };
        near.record_draw(rec, &views, &Look::default(), &over).unwrap();
        rec.barrier(&[Access::AttachmentWrite], &[Access::TransferRead]);
        rec.copy_image_to_buffer(&colour, 1, [0; 3], [SIZE[0], SIZE[1], 1], &back, 0).unwrap();
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    });
    let found: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&back.read(0, bytes).unwrap());
    let alone = |renderer: &Renderer, views: &[View; 2]| -> StereoImage {
        renderer.draw(views, &Look::default(), SIZE).unwrap().0
    };
    let (front, behind) = (alone(&near, &views), alone(&far, &views_of_far));
    let mut both = 0;
    for (i, found) in found.iter().enumerate() {
        let (front, behind) = (front.colour[1][i], behind.colour[1][i]);
        for c in 0..4 {
            let expected = front[c] + (1.0 - front[3]) * behind[c];
            // A product and a sum in floats.
            assert!((found[c] - expected).abs() < 1e-6, "{i}: {found:?} for {expected}");
        }
        both += u32::from(front[3] > 0.05 && behind[3] > 0.05);
    }
    assert!(both > 20, "{both}");
    drop((near, far, colour, depth, back));
    close(gpu);
}

#[test]
fn a_lost_device_is_told_from_other_failures() {
    let failure = |result| {
        cao::Error::from(cao_gpu::Error::Vulkan { call: "vkQueueSubmit2", object: "frame".into(), result })
    };
    assert!(failure(ash::vk::Result::ERROR_DEVICE_LOST).device_lost());
    assert!(!failure(ash::vk::Result::ERROR_OUT_OF_DEVICE_MEMORY).device_lost());
    assert!(!cao::Error::from(cao_gpu::Error::Device { problem: "none".into() }).device_lost());
}

/// A device that has nothing that is optional: 16-bit values as floats, the methods that need no storage of 16 bits, values of 8 bits
/// interpolated in the kernel, no times, no names. The picture is the same, but for what 16 bits round.
#[test]
fn without_anything_optional_the_picture_is_the_same() {
    let validation = validated();
    let [all, plain] = [false, true]
        .map(|plain| Gpu::open(&OpenOptions { validation, plain, ..OpenOptions::default() }).unwrap());
    let bytes = builtin_box("fruit", [14, 16, 12], [1.0; 3]).unwrap();
    let (low, high) = bytes.range();
    let level = |i: usize| (bytes.value(i) - low) / (high - low);
    let of = |values| Volume::new([14, 16, 12], [1.0; 3], values).unwrap();
    let volumes = [
        of(Values::U8((0..bytes.len()).map(|i| (255.0 * level(i)) as u8).collect())),
        of(Values::U16((0..bytes.len()).map(|i| (65535.0 * level(i)) as u16).collect())),
    ];
    for volume in &volumes {
        let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
        for method in methods() {
            let setup = Setup::of(method, 1.0);
            let make = |gpu: &Gpu| renderer_of(gpu, volume, transfer.clone(), setup, COLOUR);
            let mut there = make(&all).unwrap();
            if ![Method::Lao, Method::Cao].contains(&method) {
                let refused = make(&plain).map(drop).unwrap_err().to_string();
                assert!(refused.contains("cao") && refused.contains("lao"), "{refused}");
                continue;
            }
            let mut here = make(&plain).unwrap();
            let views = eyes(volume, 30.0);
            let draw = |renderer: &mut Renderer| {
                renderer.set_clips(&[Clip::remove(Shape::Sphere)]).unwrap();
                let times = renderer.update(&mut |_| ()).unwrap();
                (renderer.draw(&views, &Look::default(), [20, 18]).unwrap().0.colour, times.total())
            };
            let ((found, none), (expected, some)) = (draw(&mut here), draw(&mut there));
            assert!(none == 0.0 && some > 0.0, "{none} ms, {some} ms");
            for (found, expected) in found.iter().flatten().flatten().zip(expected.iter().flatten().flatten())
            {
                // Half a level of 255: 16 bits of values and factors, magnified by the transfer function.
                assert!((found - expected).abs() < 0.002, "{}: {found} for {expected}", method.name());
            }
        }
    }
    close(all);
    close(plain);
}

/// Targets of other sizes, formats and numbers of views, in turn and again: what is allocated afterwards is what was before.
#[test]
fn resizes_and_formats_leave_nothing_behind() {
    let gpu = open();
    let volume = builtin_box("fruit", [10, 10, 10], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut renderer = renderer_of(&gpu, &volume, transfer, Setup::new(1.0), Format::Rgba8Srgb).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let views = eyes(&volume, 30.0);
    let mut reports = Vec::new();
    for _ in 0..3 {
        for (n, format) in
            [Format::Rgba8Srgb, Format::Rgba16Float, Format::Bgra8Unorm].into_iter().enumerate()
        {
            for count in [2, 1] {
                let size = [16 + 8 * n as u32, 30 - 4 * n as u32];
                let target = |format| {
                    let (dims, usage) = ([size[0], size[1], 1], ImageUse::ATTACHMENT);
                    let desc = ImageDesc { dims, layers: count as u32, format, kind: ImageKind::D2, usage };
                    gpu.image("swapchain", &desc).unwrap()
                };
                let (colour, depth) = (target(format), target(Format::D32Float));
                let targets = Target::layers(&colour, &depth, count);
                run(&gpu, |rec| {
                    rec.discard(&colour);
                    rec.discard(&depth);
                    rec.barrier(&[], &[Access::AttachmentWrite]);
                    let targets = Targets::new(&targets, size);
                    renderer.record_draw(rec, &views[..count], &Look::default(), &targets).unwrap();
                });
            }
        }
        reports.push(gpu.memory_report());
    }
    assert!(reports[0] == reports[1] && reports[1] == reports[2], "{reports:?}");
    assert!(!reports[0].iter().any(|(name, _)| name == "swapchain"), "{:?}", reports[0]);
    drop(renderer);
    close(gpu);
}
