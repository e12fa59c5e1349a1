//! Buffers, images, samplers: round trips, limits, wrong use, and that nothing leaks.

use cao_gpu::Access::*;
use cao_gpu::Error;
use cao_gpu::{
    Bind, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse, Phase, SamplerDesc, Stage,
};
use cao_testing::wgsl::{bind, compile, device_buffer, read_back};
use cao_testing::{close, open};

fn desc(format: Format) -> ImageDesc {
    ImageDesc { dims: [7, 5, 3], layers: 1, format, kind: ImageKind::D3, usage: ImageUse::SAMPLED }
}

fn problem<T>(result: cao_gpu::Result<T>) -> String {
    result.err().expect("must be refused").to_string()
}

fn upload(gpu: &Gpu, image: &Image, bytes: &[u8]) {
    let up = gpu.buffer("up", bytes.len() as u64, BufferUse::Upload).unwrap();
    up.write(0, bytes).unwrap();
    let mut rec = gpu.recorder("upload").unwrap();
    rec.discard(image);
    rec.copy_buffer_to_image(&up, 0, image, [0; 3], image.desc().dims).unwrap();
    rec.submit_and_wait().unwrap();
}

#[test]
fn bytes_come_back_as_they_went_into_a_buffer() {
    let gpu = open();
    let data: Vec<u32> = (0..50_000).collect(); // more than one vkCmdUpdateBuffer can carry
    let x = device_buffer(&gpu, "x", &data);
    assert_eq!(read_back(&gpu, &x), data);
    drop(x);
    close(gpu);
}

#[test]
fn texels_come_back_as_they_went_into_an_image_of_any_format() {
    let gpu = open();
    let formats = [
        Format::R8Unorm,
        Format::R8Uint,
        Format::R16Unorm,
        Format::Rgba16Unorm,
        Format::R32Float,
        Format::R32Uint,
        Format::Rgba16Float,
        Format::Rgba32Float,
    ];
    for format in formats {
        // Those of the list that devices need not have.
        if matches!(format, Format::R16Unorm | Format::Rgba16Unorm) && !gpu.filters(format) {
            eprintln!("skipped: this device does not sample {format:?}");
            continue;
        }
        let (from, to) = (gpu.image("from", &desc(format)).unwrap(), gpu.image("to", &desc(format)).unwrap());
        let bytes: Vec<u8> = (0..7 * 5 * 3 * format.bytes()).map(|i| (i % 59) as u8).collect();
        upload(&gpu, &from, &bytes);
        let back = gpu.buffer("back", bytes.len() as u64, BufferUse::Readback).unwrap();
        let mut rec = gpu.recorder("copy").unwrap();
        rec.discard(&to);
        rec.copy_image(&from, &to).unwrap();
        rec.barrier(&[TransferWrite], &[TransferRead]);
        rec.copy_image_to_buffer(&to, 0, [0; 3], [7, 5, 3], &back, 0).unwrap();
        rec.submit_and_wait().unwrap();
        assert_eq!(back.read(0, back.bytes()).unwrap(), bytes, "{format:?}");
    }
    close(gpu);
}

#[test]
fn one_layer_is_copied_and_cleared_in_the_formats_own_numbers() {
    let gpu = open();
    let flat = ImageDesc {
        dims: [3, 2, 1],
        layers: 4,
        format: Format::R32Uint,
        kind: ImageKind::D2,
        usage: ImageUse::SAMPLED,
    };
    let image = gpu.image("layers", &flat).unwrap();
    let up = device_buffer(&gpu, "up", &[1, 2, 3, 4, 5, 6]);
    let back = gpu.buffer("back", 48, BufferUse::Readback).unwrap();
    let mut rec = gpu.recorder("copy").unwrap();
    rec.discard(&image);
    rec.clear_image(&image, [8.0; 4]).unwrap();
    rec.barrier(&[TransferWrite], &[TransferWrite]);
    rec.copy_buffer_to_image(&up, 0, &image, [0, 0, 2], [3, 2, 1]).unwrap();
    rec.barrier(&[TransferWrite], &[TransferRead]);
    rec.copy_image_to_buffer(&image, 2, [0; 3], [3, 2, 1], &back, 0).unwrap();
    rec.copy_image_to_buffer(&image, 3, [0; 3], [3, 2, 1], &back, 24).unwrap();
    rec.submit_and_wait().unwrap();
    let numbers: Vec<u32> = bytemuck::pod_collect_to_vec(&back.read(0, 48).unwrap());
    assert_eq!(numbers, [1, 2, 3, 4, 5, 6, 8, 8, 8, 8, 8, 8]);
    drop((image, up, back));
    close(gpu);
}

#[test]
fn a_linear_sampler_blends_to_zero_or_holds_the_border() {
    let gpu = open();
    let shader = compile(
        "@group(0) @binding(0) var image: texture_3d<f32>;
         @group(0) @binding(1) var filter_: sampler;
         @group(0) @binding(2) var<storage, read_write> out: array<f32, 2>;
         @compute @workgroup_size(1) fn main() {
             out[0] = textureSampleLevel(image, filter_, vec3f(1.0 / 7.0, 0.5, 0.5), 0.0).r;
             out[1] = textureSampleLevel(image, filter_, vec3f(0.0, 0.5, 0.5), 0.0).r;
         }",
    );
    let pipeline = gpu.compute(shader, "main").unwrap();
    let image = gpu.image("ramp", &desc(Format::R32Float)).unwrap();
    let ramp: Vec<f32> = (0..7 * 5 * 3).map(|i| 1.0 + (i % 7) as f32).collect();
    upload(&gpu, &image, bytemuck::cast_slice(&ramp));
    let out = device_buffer(&gpu, "out", &[0; 2]);
    // Between the first two texels, and half outside the image.
    for (border_zero, expected) in [(true, [1.5, 0.5]), (false, [1.5, 1.0])] {
        let sampler = gpu.sampler("sampler", SamplerDesc { linear: true, border_zero }).unwrap();
        let mut rec = gpu.recorder("sample").unwrap();
        let binds = [("image", Bind::Image(&image)), ("filter_", Bind::Sampler(&sampler)), bind("out", &out)];
        rec.dispatch(&pipeline, &binds, &[], [1; 3]).unwrap();
        drop(sampler); // the recorder keeps it
        rec.submit_and_wait().unwrap();
        assert_eq!(read_back(&gpu, &out).iter().map(|b| f32::from_bits(*b)).collect::<Vec<_>>(), expected);
    }
    drop((pipeline, image, out));
    close(gpu);
}

#[test]
fn sizes_beyond_the_device_are_refused_with_both_numbers() {
    let gpu = open();
    let limit = gpu.info().max_image_3d;
    let wide = ImageDesc { dims: [limit + 1, 1, 1], ..desc(Format::R8Uint) };
    match gpu.image("wide", &wide) {
        Err(Error::Limit { needed, limit: said, what, .. }) => {
            assert_eq!((needed, said), (u64::from(limit) + 1, u64::from(limit)));
            assert!(what.contains("wide"), "{what}");
        }
        other => panic!("{:?}", other.err()),
    }
    let most = gpu.info().max_buffer;
    if most < u64::MAX {
        let result = gpu.buffer("endless", most + 1, BufferUse::Device);
        assert!(
            matches!(result, Err(Error::Limit { needed, limit, .. }) if (needed, limit) == (most + 1, most))
        );
    }
    for (dims, layers, kind) in
        [([0, 1, 1], 1, ImageKind::D3), ([1; 3], 2, ImageKind::D3), ([1, 1, 2], 1, ImageKind::D2)]
    {
        let message = problem(gpu.image("odd", &ImageDesc { dims, layers, kind, ..desc(Format::R8Uint) }));
        assert!(message.contains("odd"), "{message}");
    }
    assert!(problem(gpu.buffer("nothing", 0, BufferUse::Device)).contains("nothing"));
    let shader = compile("@compute @workgroup_size(1) fn main() {}");
    let pipeline = gpu.compute(shader, "main").unwrap();
    let mut rec = gpu.recorder("test").unwrap();
    let most = gpu.info().max_workgroups[1];
    if most < u32::MAX {
        assert!(matches!(rec.dispatch(&pipeline, &[], &[], [1, most + 1, 1]), Err(Error::Limit { .. })));
    }
    drop((rec, pipeline));
    close(gpu);
}

#[test]
fn a_binding_beyond_the_storage_range_is_refused() {
    let gpu = open();
    let limit = gpu.info().max_storage_range;
    if limit > 1 << 30 {
        return close(gpu); // a buffer too large for a test
    }
    let shader = compile(
        "@group(0) @binding(0) var<storage, read_write> x: array<u32>;
         @compute @workgroup_size(1) fn main() { x[0] = 1u; }",
    );
    let pipeline = gpu.compute(shader, "main").unwrap();
    let x = gpu.buffer("large", limit + 4096, BufferUse::Device).unwrap();
    let mut rec = gpu.recorder("test").unwrap();
    match rec.dispatch(&pipeline, &[bind("x", &x)], &[], [1; 3]) {
        Err(Error::Limit { needed, limit: said, .. }) => assert_eq!((needed, said), (limit + 4096, limit)),
        other => panic!("{other:?}"),
    }
    rec.dispatch(&pipeline, &[("x", Bind::BufferRange(&x, 4096, limit))], &[], [1; 3]).unwrap();
    rec.submit_and_wait().unwrap();
    drop((pipeline, x));
    close(gpu);
}

#[test]
fn binding_by_name_refuses_all_that_does_not_fit_and_names_it() {
    let gpu = open();
    let shader = compile(
        "struct Push { n: u32, m: u32 }
         var<immediate> push: Push;
         @group(0) @binding(0) var<storage, read_write> numbers: array<u32>;
         @group(0) @binding(1) var picture: texture_2d<u32>;
         @group(0) @binding(2) var other: texture_storage_3d<r32float, write>;
         @compute @workgroup_size(1) fn main() { numbers[push.n] = textureLoad(picture, vec2u(0u), 0).r; }
         @compute @workgroup_size(1) fn paint() { textureStore(other, vec3u(0u), vec4f(0.0)); }",
    );
    let (main, paint) = (gpu.compute(shader, "main").unwrap(), gpu.compute(shader, "paint").unwrap());
    let x = device_buffer(&gpu, "x", &[0; 64]);
    let layered = ImageDesc {
        dims: [2, 2, 1],
        layers: 2,
        format: Format::R32Uint,
        kind: ImageKind::D2,
        usage: ImageUse::SAMPLED,
    };
    let flat = gpu.image("flat", &layered).unwrap();
    let single = gpu.image("single", &ImageDesc { layers: 1, ..layered }).unwrap();
    let float = gpu.image("float", &ImageDesc { format: Format::R32Float, layers: 1, ..layered }).unwrap();
    let byte = gpu.image("byte", &ImageDesc { usage: ImageUse::STORAGE, ..desc(Format::R8Uint) }).unwrap();
    let sampled = gpu.image("sampled", &desc(Format::R32Float)).unwrap();
    let sampler = gpu.sampler("sampler", SamplerDesc { linear: false, border_zero: false }).unwrap();
    let mut rec = gpu.recorder("test").unwrap();
    rec.discard(&flat);
    rec.discard(&single);
    let (good_x, good_p, push) = (bind("numbers", &x), ("picture", Bind::Layer(&flat, 1)), [0u8; 8]);
    type Case<'a> = (&'a [(&'a str, Bind<'a>)], &'a [&'a str]);
    let binds: &[Case<'_>] = &[
        (&[good_x], &["`picture`", "missing", "test.main"]),
        (&[good_x, good_p, good_x], &["`numbers`", "twice"]),
        (&[good_x, good_p, bind("nubmers", &x)], &["`nubmers`", "numbers, picture"]),
        (&[good_x, good_p, ("other", Bind::Image(&byte))], &["`other`", "not used"]),
        (&[("numbers", Bind::Image(&flat)), good_p], &["`numbers`", "Storage", "image flat"]),
        (&[good_x, bind("picture", &x)], &["`picture`", "Sampled", "buffer x"]),
        (&[good_x, ("picture", Bind::Sampler(&sampler))], &["`picture`", "sampler"]),
        (&[good_x, ("picture", Bind::Image(&flat))], &["`picture`", "D2", "2 layers"]),
        (&[good_x, ("picture", Bind::Layer(&flat, 2))], &["`picture`", "layer 2"]),
        (&[good_x, ("picture", Bind::Image(&float))], &["`picture`", "Uint", "R32Float"]),
        (&[good_x, ("picture", Bind::Image(&byte))], &["`picture`", "byte", "not made for"]),
        (&[("numbers", Bind::BufferRange(&x, 4, 4)), good_p], &["`numbers`", "multiple of"]),
        (&[("numbers", Bind::BufferRange(&x, 0, 300)), good_p], &["buffer x", "256 bytes"]),
    ];
    if gpu.info().storage_alignment > 4 {
        for (binds, words) in binds {
            let message = problem(rec.dispatch(&main, binds, &push, [1; 3]));
            assert!(words.iter().all(|w| message.contains(w)), "{message} lacks one of {words:?}");
        }
    }
    for (image, word) in [(&byte, "R8Uint"), (&sampled, "not made for")] {
        let message = problem(rec.dispatch(&paint, &[("other", Bind::Image(image))], &[], [1; 3]));
        assert!(message.contains(word), "{message}");
    }
    let message = problem(rec.dispatch(&main, &[good_x, good_p], &push[..4], [1; 3]));
    assert!(message.contains("8 bytes") && message.contains('4'), "{message}");
    // What was refused has left nothing behind.
    rec.dispatch(&main, &[good_x, good_p], &push, [1; 3]).unwrap();
    rec.barrier(&[StorageWrite], &[StorageWrite]);
    rec.dispatch(&main, &[good_x, ("picture", Bind::Image(&single))], &push, [1; 3]).unwrap();
    rec.submit_and_wait().unwrap();
    drop((x, flat, single, float, byte, sampled, sampler, main, paint));
    close(gpu);
}

#[test]
fn ranges_outside_and_wrong_directions_are_refused() {
    let gpu = open();
    let device = gpu.buffer("device", 64, BufferUse::Device).unwrap();
    let up = gpu.buffer("up", 64, BufferUse::Upload).unwrap();
    let back = gpu.buffer("back", 64, BufferUse::Readback).unwrap();
    let image = gpu.image("image", &desc(Format::R8Uint)).unwrap();
    assert!(problem(up.write(60, &[0; 8])).contains("64 bytes"));
    assert!(problem(up.write(u64::MAX, &[0; 8])).contains("outside"));
    assert!(problem(device.read(0, 4)).contains("mapped"));
    let mut rec = gpu.recorder("test").unwrap();
    rec.discard(&image);
    assert!(problem(rec.update(&up, 0, &[0; 4])).contains("up"));
    assert!(problem(rec.update(&device, 2, &[0; 4])).contains("multiples of 4"));
    assert!(problem(rec.fill(&device, 0, 68, 0)).contains("outside"));
    assert!(problem(rec.copy_buffer(&back, 0, &device, 0, 4)).contains("back"));
    assert!(problem(rec.copy_buffer(&device, 0, &device, 2, 4)).contains("at once"), "overlapping copy");
    assert!(problem(rec.copy_buffer_to_image(&up, 0, &image, [0, 0, 1], [7, 5, 3])).contains("[7, 5, 3]"));
    assert!(problem(rec.copy_buffer_to_image(&up, 0, &image, [0; 3], [7, 5, 2])).contains("70 bytes"));
    assert!(problem(rec.copy_image_to_buffer(&image, 1, [0; 3], [1; 3], &back, 0)).contains("layer 1"));
    assert!(problem(rec.copy_image(&image, &image)).contains("at once"));
    drop((rec, device, up, back, image));
    close(gpu);
}

#[test]
fn memory_is_reported_by_name_and_is_empty_after_teardown() {
    let gpu = open();
    let x = gpu.buffer("first", 1000, BufferUse::Device).unwrap();
    let image = gpu.image("second", &desc(Format::R32Float)).unwrap();
    let report = gpu.memory_report();
    let names: Vec<_> = report.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["first", "second"]);
    assert!(report[0].1 >= 1000 && report[1].1 >= 7 * 5 * 3 * 4, "{report:?}");
    let total: u64 = report.iter().map(|(_, bytes)| bytes).sum();
    let mut rec = gpu.recorder("test").unwrap();
    rec.discard(&image);
    rec.fill(&x, 0, 1000, 0).unwrap();
    drop((x, image));
    assert_eq!(gpu.memory_report().len(), 2, "a recorder keeps what it refers to");
    rec.submit_and_wait().unwrap();
    assert_eq!(gpu.memory_report(), []);
    assert_eq!(gpu.memory_peak(), total);
    close(gpu);
}

#[test]
fn stages_are_timed_in_order_and_may_nest() {
    let gpu = open();
    let x = gpu.buffer("x", 1 << 20, BufferUse::Device).unwrap();
    let mut rec = gpu.recorder("test").unwrap();
    const NAMES: [&str; 3] = ["one", "two", "three"];
    let stage = |i: u32| Stage::new(NAMES[i as usize % 3], Phase::ALL[i as usize % 5]);
    // More stages than one query pool holds.
    for i in 0..70 {
        rec.stage(stage(i)).unwrap();
        rec.fill(&x, 0, x.bytes(), i).unwrap();
        rec.end_stage().unwrap();
        rec.barrier(&[TransferWrite], &[TransferWrite]);
    }
    rec.stage(Stage::new("outer", Phase::Clip)).unwrap();
    rec.stage(Stage::new("inner", Phase::Clip)).unwrap();
    rec.fill(&x, 0, x.bytes(), 7).unwrap();
    rec.end_stage().unwrap();
    rec.end_stage().unwrap();
    assert!(problem(rec.end_stage()).contains("no stage"));
    let timings = rec.submit_and_wait().unwrap();
    assert_eq!(timings.len(), 72);
    assert_eq!(timings[69].stage, stage(69));
    assert!(timings.iter().all(|t| (0.0..60_000.0).contains(&t.ms)), "{timings:?}");
    assert!(timings[70].ms >= timings[71].ms, "the outer stage contains the inner one: {timings:?}");
    assert!(timings.iter().any(|t| t.ms > 0.0));
    let mut rec = gpu.recorder("open end").unwrap();
    rec.stage(Stage::new("endless", Phase::Clip)).unwrap();
    assert!(problem(rec.submit_and_wait()).contains("endless"));
    drop(x);
    close(gpu);
}
