//! Pictures in bands: the same bits whatever their height, memory that does not grow with the picture, and refusals with both numbers.

use cao::draw::picture::{HALF_COLOUR, Picture};
use cao::renderer::{Bands, COLOUR, Renderer, StereoImage};
use cao_gpu::{Access, BufferUse, Gpu, Image};
use cao_model::builtin::builtin_box;
use cao_model::look::Look;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::View;
use cao_testing::*;

/// A renderer of a small built-in volume, up to date, and its eyes.
fn scene(gpu: &Gpu, name: &str) -> (Renderer, [View; 2]) {
    let volume = builtin_box(name, [16, 18, 14], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut renderer =
        Renderer::new(gpu, &volume, transfer, Setup::new(volume.min_spacing()), COLOUR).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    (renderer, eyes(&volume, 30.0))
}

/// Both eyes' bits, colours and depths.
fn bits(image: &StereoImage) -> Vec<u32> {
    let colours = image.colour.iter().flatten().flatten().map(|c| c.to_bits());
    colours.chain(image.depth.iter().flatten().map(|d| d.to_bits())).collect()
}

/// A picture put together from bands of this many rows, and how many there were.
fn in_bands(renderer: &Renderer, views: &[View; 2], bands: Bands) -> (StereoImage, usize) {
    let mut whole = StereoImage { size: bands.size, colour: Default::default(), depth: Default::default() };
    let (mut next, mut count) = (0, 0);
    renderer
        .draw_bands(views, &Look::default(), bands, &mut |first, band: &StereoImage| {
            assert_eq!((first, band.size[0]), (next, bands.size[0]));
            assert!(band.size[1] == bands.rows || first + band.size[1] == bands.size[1]);
            for view in 0..2 {
                whole.colour[view].extend_from_slice(&band.colour[view]);
                whole.depth[view].extend_from_slice(&band.depth[view]);
            }
            (next, count) = (next + band.size[1], count + 1);
            Ok::<_, cao::Error>(())
        })
        .unwrap();
    assert_eq!(next, bands.size[1]);
    (whole, count)
}

/// Texels of a layer.
fn read<T: bytemuck::Pod>(gpu: &Gpu, image: &Image, layer: u32) -> Vec<T> {
    let dims = image.desc().dims;
    let bytes = u64::from(dims[0] * dims[1]) * image.desc().format.bytes();
    let back = gpu.buffer("back", bytes, BufferUse::Readback).unwrap();
    run(gpu, |rec| {
        rec.copy_image_to_buffer(image, layer, [0; 3], dims, &back, 0).unwrap();
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    });
    bytemuck::pod_collect_to_vec(&back.read(0, bytes).unwrap())
}

#[test]
fn no_bit_depends_on_the_bands() {
    let gpu = open();
    let (renderer, views) = scene(&gpu, "fruit");
    // Neither is a multiple of a tile; the second takes several submissions a band.
    for size in [[37, 29], [203, 181]] {
        let picture = Picture::new(&gpu, size, 2).unwrap();
        run(&gpu, |rec| {
            renderer.record_picture(rec, &views, &Look::default(), &picture).unwrap();
        });
        let recorded = StereoImage {
            size,
            colour: [0, 1].map(|layer| read(&gpu, &picture.colour, layer)),
            depth: [0, 1].map(|layer| read(&gpu, &picture.depth, layer)),
        };
        let expected = bits(&recorded);
        assert!(recorded.colour.iter().flatten().filter(|c| c[3] > 0.5).count() > 100);
        let drawn = renderer.draw(&views, &Look::default(), size).unwrap().0;
        assert_eq!(drawn.size, size);
        assert!(bits(&drawn) == expected, "{size:?}");
        for rows in [1, 3, 7, 8, 20, size[1], 500] {
            let (image, count) = in_bands(&renderer, &views, Bands { size, rows });
            assert_eq!(count as u32, size[1].div_ceil(rows));
            assert!(bits(&image) == expected, "{size:?} in bands of {rows}");
        }
        // The comparison can tell: rows in another order are another picture.
        let mut turned = recorded;
        turned.colour[0].rotate_left(size[0] as usize);
        assert!(bits(&turned) != expected);
    }
    drop(renderer);
    close(gpu);
}

/// Device memory of a picture, images and read-back, bytes: 32 MiB each, and what alignment adds.
const MOST: u64 = 2 * (32 << 20) + (1 << 20);

#[test]
fn memory_does_not_grow_with_the_picture() {
    let gpu = open();
    let (renderer, views) = scene(&gpu, "empty");
    // In one piece these would be 77 MiB of images, and as much for reading back.
    let size = [1400, 1440];
    let before: u64 = gpu.memory_report().iter().map(|(_, bytes)| bytes).sum();
    let (mut most, mut count) = (0, 0);
    let bands = Bands::new(&gpu, size, 2).unwrap();
    renderer
        .draw_bands(&views, &Look::default(), bands, &mut |_, _: &StereoImage| {
            let now: u64 = gpu.memory_report().iter().map(|(_, bytes)| bytes).sum();
            (most, count) = (most.max(now - before), count + 1);
            Ok::<_, cao::Error>(())
        })
        .unwrap();
    assert!(count > 1 && most > MOST / 2 && most <= MOST, "{most} bytes in {count} bands");
    for size in [[1, 1], [16384, 16384], [4096, 1 << 30]] {
        for views in 1..=View::MAX {
            let rows = Bands::new(&gpu, size, views).unwrap().rows;
            let bytes = 20 * u64::from(size[0]) * u64::from(rows) * views as u64;
            assert!(rows > 0 && bytes <= 32 << 20, "{size:?}, {views} views: {rows} rows");
        }
    }
    drop(renderer);
    close(gpu);
}

#[test]
fn what_takes_bands_can_end_the_drawing() {
    let gpu = open();
    let (renderer, views) = scene(&gpu, "engine");
    let mut seen = 0;
    let mut full = |_: u32, _: &StereoImage| {
        seen += 1;
        if seen == 2 { Err(cao_model::Error::refused("disk", "full").into()) } else { Ok(()) }
    };
    let bands = Bands { size: [16, 16], rows: 2 };
    let error = renderer.draw_bands::<2, cao::Error>(&views, &Look::default(), bands, &mut full).unwrap_err();
    assert!(error.to_string().contains("disk: full") && seen == 2, "{error} {seen}");
    // And the next drawing is whole.
    let drawn = renderer.draw(&views, &Look::default(), [16, 16]).unwrap().0;
    assert!(bits(&drawn) == bits(&in_bands(&renderer, &views, bands).0));
    drop(renderer);
    close(gpu);
}

/// More than there is, by both numbers; nothing is allocated for it.
#[test]
fn what_memory_cannot_hold_is_refused_with_the_numbers() {
    let gpu = open();
    let (renderer, views) = scene(&gpu, "engine");
    let wide = gpu.info().max_image_2d;
    let said = |error: cao::Error, parts: &[String]| {
        let message = error.to_string();
        assert!(parts.iter().all(|part| message.contains(part)), "{parts:?}: {message}");
    };
    let before = gpu.memory_report();
    let draw = |size| renderer.draw(&views, &Look::default(), size).unwrap_err();
    // 20 bytes a pixel and eye: 640 GiB and more.
    let bytes = 40 * u64::from(wide) * (1 << 24);
    said(draw([wide, 1 << 24]), &[bytes.to_string(), "memory".into(), "draw_bands".into()]);
    said(draw([wide + 1, 8]), &[(wide + 1).to_string(), wide.to_string()]);
    said(draw([8, 0]), &["8 x 0".into()]);
    let device = |picture: cao::Result<Picture>| picture.err().unwrap();
    for (pixel, error) in [
        (20, device(Picture::new(&gpu, [wide, 1 << 24], 4))),
        (12, device(Picture::half(&gpu, [wide, 1 << 24], 4))),
    ] {
        let bytes = pixel * 4 * u64::from(wide) * (1 << 24);
        said(error, &[bytes.to_string(), "device memory".into(), "limit is".into()]);
    }
    assert_eq!(gpu.memory_report(), before);
    drop(renderer);
    close(gpu);
}

/// Half floats are the same colours in eleven bits, rounded down where a device likes, and the same depths.
#[test]
fn half_floats_hold_the_same_picture_in_eleven_bits() {
    let gpu = open();
    let (renderer, views) = scene(&gpu, "fruit");
    let size = [45, 31];
    let (full, half) = (Picture::new(&gpu, size, 2).unwrap(), Picture::half(&gpu, size, 2).unwrap());
    assert_eq!(half.colour.desc().format, HALF_COLOUR);
    run(&gpu, |rec| {
        for picture in [&full, &half] {
            renderer.record_picture(rec, &views, &Look::default(), picture).unwrap();
        }
    });
    let mut shown = 0;
    for layer in 0..2 {
        let expected: Vec<f32> = read(&gpu, &full.colour, layer);
        let found: Vec<u16> = read(&gpu, &half.colour, layer);
        for (found, expected) in found.into_iter().map(half_float).zip(expected) {
            // 2^-24 is the smallest half float.
            assert!((found - expected).abs() <= expected / 1024.0 + 6e-8, "{found} {expected}");
            shown += usize::from(expected > 0.1);
        }
        assert!(read::<u32>(&gpu, &full.depth, layer) == read::<u32>(&gpu, &half.depth, layer));
    }
    assert!(shown > 100, "{shown}");
    drop((renderer, full, half));
    close(gpu);
}
