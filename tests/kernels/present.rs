//! The kernel `present`: attachments of every colour format hold what the picture holds, rounded to that format.

use cao::draw::picture::Picture;
use cao::renderer::{COLOUR, Drawn, Place, Quality, Target, Targets};
use cao_gpu::{Access, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse, Recorder};
use cao_model::builtin::builtin_box;
use cao_model::look::Look;
use cao_model::view::{View, with_insets};
use cao_testing::*;

/// Neither is a multiple of a tile.
const SIZE: [u32; 2] = [37, 29];

fn views(count: usize) -> Vec<View> {
    let volume = builtin_box("fruit", [16, 18, 14], [1.0; 3]).unwrap();
    let all = with_insets(eyes(&volume, 30.0), 0.5).unwrap();
    all[..count].to_vec()
}

fn attachments(gpu: &Gpu, format: Format, layers: u32) -> [Image; 2] {
    [format, Format::D32Float].map(|format| {
        let (dims, usage) = ([SIZE[0] + 3, SIZE[1] + 2, 1], ImageUse::ATTACHMENT);
        gpu.image("attachment", &ImageDesc { dims, layers, format, kind: ImageKind::D2, usage }).unwrap()
    })
}

/// Texels of a layer's upper left.
fn read<T: bytemuck::Pod>(gpu: &Gpu, image: &Image, layer: u32) -> Vec<T> {
    let bytes = u64::from(SIZE[0] * SIZE[1]) * image.desc().format.bytes();
    let back = gpu.buffer("back", bytes, BufferUse::Readback).unwrap();
    run(gpu, |rec| {
        rec.copy_image_to_buffer(image, layer, [0; 3], [SIZE[0], SIZE[1], 1], &back, 0).unwrap();
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    });
    bytemuck::pod_collect_to_vec(&back.read(0, bytes).unwrap())
}

/// Components of a layer.
fn components(gpu: &Gpu, image: &Image, layer: u32) -> Vec<f32> {
    match image.desc().format {
        Format::Rgba8Unorm => {
            read::<u8>(gpu, image, layer).into_iter().map(|b| f32::from(b) / 255.0).collect()
        }
        Format::Rgba16Float => read::<u16>(gpu, image, layer).into_iter().map(half_float).collect(),
        _ => read(gpu, image, layer),
    }
}

#[test]
fn attachments_hold_the_picture_rounded_to_their_format() {
    let gpu = open();
    // Relative and absolute.
    for (format, [rounding, step]) in [
        (Format::Rgba32Float, [0.0, 0.0]),
        // Eleven bits, and Vulkan lets a device round down; below 2^-14 they are 2^-24 apart.
        (Format::Rgba16Float, [1.0 / 1024.0, 2f32.powi(-24)]),
        // Half a step, 0.6 of one where a device is allowed its error.
        (Format::Rgba8Unorm, [0.0, 0.6 / 255.0]),
    ] {
        let renderer = fruit(&gpu, format);
        for count in 1..=View::MAX {
            let (views, look) = (views(count), Look::default());
            let [colour, depth] = attachments(&gpu, format, count as u32);
            let picture = Picture::new(&gpu, SIZE, count).unwrap();
            run(&gpu, |rec| {
                rec.discard(&colour);
                rec.discard(&depth);
                rec.barrier(&[], &[Access::AttachmentWrite]);
                renderer
                    .record_draw(
                        rec,
                        &views,
                        &look,
                        &Targets::new(&Target::layers(&colour, &depth, views.len()), SIZE),
                    )
                    .unwrap();
                renderer.record_picture(rec, &views, &look, &picture).unwrap();
            });
            for layer in 0..count as u32 {
                let (found, expected) =
                    (components(&gpu, &colour, layer), components(&gpu, &picture.colour, layer));
                assert!(expected.iter().any(|c| *c > 0.2), "view {layer} sees the volume");
                for (i, (f, e)) in found.iter().zip(&expected).enumerate() {
                    // What a format cannot hold is clamped.
                    let e = if format == Format::Rgba8Unorm { e.clamp(0.0, 1.0) } else { *e };
                    assert!((f - e).abs() <= (rounding * e).max(step), "{format:?}, {i}: {f} for {e}");
                }
                let depths: [Vec<u32>; 2] = [read(&gpu, &depth, layer), read(&gpu, &picture.depth, layer)];
                assert!(depths[0] == depths[1], "{format:?}: depth of view {layer}");
            }
        }
    }
    close(gpu);
}

/// A budget that nothing meets gives half of the pixels along each axis; attachments are filled with them, interpolated.
#[test]
fn a_smaller_picture_fills_the_attachments() {
    let gpu = open();
    let renderer = fruit(&gpu, COLOUR);
    let (views, look) = (views(2), Look { budget_ms: Some(1e-6), ..Look::default() });
    let [colour, depth] = attachments(&gpu, COLOUR, 2);
    let picture = Picture::new(&gpu, SIZE, 2).unwrap();
    let frame = |rec: &mut Recorder, look: &Look| {
        rec.discard(&colour);
        rec.discard(&depth);
        rec.barrier(&[], &[Access::AttachmentWrite]);
        renderer
            .record_draw(
                rec,
                &views,
                look,
                &Targets::new(&Target::layers(&colour, &depth, views.len()), SIZE),
            )
            .unwrap()
    };
    // Nothing is known of the first frame.
    let mut drawn = Vec::new();
    run(&gpu, |rec| drawn.push(frame(rec, &look)));
    assert_eq!((drawn[0].size, drawn[0].quality), (SIZE, Quality::FULL));
    renderer.drew(&drawn[0], 5.0);
    run(&gpu, |rec| {
        drawn.push(frame(rec, &look));
        drawn.push(renderer.record_picture(rec, &views, &look, &picture).unwrap());
    });
    assert!(drawn[1] == drawn[2]);
    let Drawn { size, step_mm, quality } = drawn[1];
    assert_eq!((size, step_mm, quality.scale), ([19, 15], 1.0, 0.5));
    // 5 ms for all pixels, a quarter of the samples on a quarter of the pixels.
    assert!((quality.expected_ms.unwrap() - 5.0 / 16.0).abs() < 1e-3, "{quality:?}");
    for layer in 0..2 {
        let found: Vec<[f32; 4]> = read(&gpu, &colour, layer);
        let depths: Vec<f32> = read(&gpu, &depth, layer);
        let (small, far): (Vec<[f32; 4]>, Vec<f32>) =
            (read(&gpu, &picture.colour, layer), read(&gpu, &picture.depth, layer));
        let at = |x: f32, y: f32| {
            let x = (x as usize).min(size[0] as usize - 1);
            x + (y as usize).min(size[1] as usize - 1) * SIZE[0] as usize
        };
        for (i, (found, depth)) in found.iter().zip(&depths).enumerate() {
            let place = [i as u32 % SIZE[0], i as u32 / SIZE[0]];
            let [x, y] = [0, 1].map(|a| (place[a] as f32 + 0.5) * size[a] as f32 / SIZE[a] as f32);
            assert_eq!(*depth, far[at(x, y)], "depth of {place:?}");
            let (x, y) = (x - 0.5, y - 0.5);
            let [wx, wy] = [x - x.floor(), y - y.floor()];
            let load = |dx: f32, dy: f32| small[at((x.floor() + dx).max(0.0), (y.floor() + dy).max(0.0))];
            let corners = [load(0.0, 0.0), load(1.0, 0.0), load(0.0, 1.0), load(1.0, 1.0)];
            let weights = [(1.0 - wx) * (1.0 - wy), wx * (1.0 - wy), (1.0 - wx) * wy, wx * wy];
            for c in 0..4 {
                let expected: f32 = (0..4).map(|n| weights[n] * corners[n][c]).sum();
                // Rounding of the place, a 10⁻⁶th of a pixel, and of sums.
                assert!((found[c] - expected).abs() < 1e-5, "{place:?}: {found:?} for {expected}");
            }
        }
        assert!(found.iter().any(|c| c[3] > 0.5));
    }
    // Stills have no budget.
    let two = [views[0], views[1]];
    let error = renderer.draw(&two, &look, SIZE).unwrap_err().to_string();
    assert!(error.contains("budget_ms") && error.contains("record_draw"), "{error}");
    let none = Look { budget_ms: Some(0.0), ..look };
    let mut rec = gpu.recorder("refused").unwrap();
    let error = renderer.record_picture(&mut rec, &views, &none, &picture).unwrap_err().to_string();
    assert!(error.contains("budget_ms: 0"), "{error}");
    drop((rec, colour, depth, picture, renderer));
    close(gpu);
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    let gpu = open();
    let renderer = fruit(&gpu, COLOUR);
    let (views, look) = (views(2), Look::default());
    let mut rec = gpu.recorder("refused").unwrap();
    let picture = Picture::new(&gpu, SIZE, 3).unwrap();
    let error = renderer.record_picture(&mut rec, &views, &look, &picture).unwrap_err().to_string();
    assert!(error.contains("3 views") && error.contains("2"), "{error}");
    for (views, size) in [(0, SIZE), (View::MAX + 1, SIZE), (2, [0, 8]), (2, [1 << 20, 8])] {
        assert!(Picture::new(&gpu, size, views).is_err(), "{views} views of {size:?}");
    }
    let [colour, depth] = attachments(&gpu, COLOUR, 2);
    let [one, _] = attachments(&gpu, COLOUR, 1);
    let two = Target::layers(&colour, &depth, 2);
    let beyond = Place { at: [5, 0], ..two[0].colour };
    let third = Place { layer: 2, ..two[0].colour };
    [&colour, &depth, &one].into_iter().for_each(|image| rec.discard(image));
    let scene = Place { image: &one, layer: 0, at: [5, 0] };
    let behind = Target { scene: Some(scene), ..two[0] };
    for (target, word) in [
        (behind, "scene of view 0: 37×29 pixels at 5, 0"),
        (Target { colour: beyond, ..two[0] }, "colour of view 0: 37×29 pixels at 5, 0"),
        (Target { colour: third, ..two[0] }, "layer 2"),
        (Target { depth: Some(two[0].colour), ..two[0] }, "colour format"),
        (Target { colour: two[0].depth.unwrap(), ..two[0] }, "depth format"),
        (Target { scene: Some(two[0].colour), ..two[0] }, "all or none"),
    ] {
        let other = Target { scene: (word != "all or none").then_some(target.scene).flatten(), ..two[1] };
        let targets = [target, other];
        rec.barrier(&[Access::AttachmentWrite], &[Access::AttachmentWrite]);
        let error = renderer.record_draw(&mut rec, &views, &look, &Targets::new(&targets, SIZE));
        let error = error.unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
    let error = renderer.record_draw(&mut rec, &views, &look, &Targets::new(&two[..1], SIZE)).unwrap_err();
    assert!(error.to_string().contains("1 of them, for 2 views"), "{error}");
    drop((rec, renderer, picture, colour, depth, one));
    close(gpu);
}
