//! The kernel `present`: attachments of every colour format hold what the picture holds, rounded to that format.

use cao::draw::picture::Picture;
use cao::draw::present::Present;
use cao::renderer::{COLOUR, Renderer};
use cao_gpu::{Access, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse};
use cao_model::builtin::builtin_box;
use cao_model::look::Look;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::{View, with_insets};
use cao_testing::*;

/// Neither is a multiple of a tile.
const SIZE: [u32; 2] = [37, 29];

/// A renderer of a small volume, up to date, that draws into this format.
fn renderer(gpu: &Gpu, colour: Format) -> Renderer {
    let volume = builtin_box("fruit", [16, 18, 14], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let setup = Setup::new(volume.min_spacing());
    let mut renderer = Renderer::new(gpu, &volume, transfer, setup, colour).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    renderer
}

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
    for (format, rounding) in [
        (Format::Rgba32Float, 0.0),
        // Eleven bits, and Vulkan lets a device round down.
        (Format::Rgba16Float, 1.0 / 1024.0),
        // Half a step, 0.6 of one where a device is allowed its error.
        (Format::Rgba8Unorm, 0.6 / 255.0),
    ] {
        let renderer = renderer(&gpu, format);
        for count in 1..=View::MAX {
            let (views, look) = (views(count), Look::default());
            let [colour, depth] = attachments(&gpu, format, count as u32);
            let picture = Picture::new(&gpu, SIZE, count).unwrap();
            run(&gpu, |rec| {
                rec.discard(&colour);
                rec.discard(&depth);
                rec.barrier(&[], &[Access::AttachmentWrite]);
                renderer.record_draw(rec, &views, &look, &colour, &depth, SIZE).unwrap();
                renderer.record_picture(rec, &views, &look, &picture).unwrap();
            });
            for layer in 0..count as u32 {
                let (found, expected) =
                    (components(&gpu, &colour, layer), components(&gpu, &picture.colour, layer));
                assert!(expected.iter().any(|c| *c > 0.2), "view {layer} sees the volume");
                for (i, (f, e)) in found.iter().zip(&expected).enumerate() {
                    // What a format cannot hold is clamped.
                    let e = if format == Format::Rgba8Unorm { e.clamp(0.0, 1.0) } else { *e };
                    assert!(
                        (f - e).abs() <= rounding * e.max(if rounding > 0.001 { 1.0 } else { 0.0 }),
                        "{format:?}, {i}: {f} for {e}"
                    );
                }
                let depths: [Vec<u32>; 2] = [read(&gpu, &depth, layer), read(&gpu, &picture.depth, layer)];
                assert!(depths[0] == depths[1], "{format:?}: depth of view {layer}");
            }
        }
    }
    close(gpu);
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    let gpu = open();
    let renderer = renderer(&gpu, COLOUR);
    let (views, look) = (views(2), Look::default());
    let mut rec = gpu.recorder("refused").unwrap();
    let picture = Picture::new(&gpu, SIZE, 3).unwrap();
    let error = renderer.record_picture(&mut rec, &views, &look, &picture).unwrap_err().to_string();
    assert!(error.contains("3 views") && error.contains("2"), "{error}");
    for (views, size) in [(0, SIZE), (View::MAX + 1, SIZE), (2, [0, 8]), (2, [1 << 20, 8])] {
        assert!(Picture::new(&gpu, size, views).is_err(), "{views} views of {size:?}");
    }
    // Fewer layers, another format.
    let present = Present::new(&gpu, Format::Rgba8Unorm).unwrap();
    for (format, layers) in [(Format::Rgba8Unorm, 2), (COLOUR, 3)] {
        let [colour, depth] = attachments(&gpu, format, layers);
        let error = present.record(&mut rec, &picture, &colour, &depth).unwrap_err().to_string();
        assert!(error.contains("present"), "{error}");
    }
    drop((rec, renderer, picture, present));
    close(gpu);
}
