//! Every kind of missing barrier is refused by the recorder; with the barrier the commands run, give the right numbers, and the
//! validation layer is silent.

use cao_gpu::Access::*;
use cao_gpu::Error;
use cao_gpu::{
    Access, Attachments, Bind, BufferUse, Format, Gpu, GraphicsDesc, Image, ImageDesc, ImageKind, ImageUse,
    Recorder,
};
use cao_testing::wgsl::{bind, compile, device_buffer, read_back};
use cao_testing::{close, open};

const N: u32 = 37;

/// Kernels over 37 numbers, or over an image of 5 × 3 × 2 texels: sizes that no workgroup divides.
const KERNELS: &str = "
    struct Numbers { x: array<u32> }
    @group(0) @binding(0) var<storage, read> a: Numbers;
    @group(0) @binding(1) var<storage, read_write> b: Numbers;
    @group(0) @binding(2) var sampled: texture_3d<f32>;
    @group(0) @binding(3) var write_only: texture_storage_3d<r32float, write>;
    @group(0) @binding(4) var in_place: texture_storage_3d<r32float, read_write>;
    @group(0) @binding(5) var flat: texture_2d<f32>;

    @compute @workgroup_size(8) fn double(@builtin(global_invocation_id) id: vec3u) {
        if id.x < arrayLength(&b.x) { b.x[id.x] = b.x[id.x] * 2u; }
    }
    @compute @workgroup_size(8) fn copy(@builtin(global_invocation_id) id: vec3u) {
        if id.x < arrayLength(&b.x) { b.x[id.x] = a.x[id.x]; }
    }
    @compute @workgroup_size(8) fn count(@builtin(global_invocation_id) id: vec3u) {
        if id.x < arrayLength(&b.x) { b.x[id.x] = id.x; }
    }
    @compute @workgroup_size(1) fn arguments() { b.x[0] = 3u; b.x[1] = 1u; b.x[2] = 1u; }
    @compute @workgroup_size(4, 4, 2) fn paint(@builtin(global_invocation_id) id: vec3u) {
        textureStore(write_only, id, vec4f(f32(id.x + 10u * id.y + 100u * id.z)));
    }
    fn add_one(p: vec3u) { textureStore(in_place, p, textureLoad(in_place, p) + 1.0); }
    @compute @workgroup_size(4, 4, 2) fn increment(@builtin(global_invocation_id) id: vec3u) {
        if all(id < textureDimensions(in_place)) { add_one(id); }
    }
    @compute @workgroup_size(4, 4, 2) fn sample(@builtin(global_invocation_id) id: vec3u) {
        if all(id < textureDimensions(sampled)) {
            let size = textureDimensions(sampled);
            b.x[(id.z * size.y + id.y) * size.x + id.x] = u32(textureLoad(sampled, id, 0).r);
        }
    }
    @compute @workgroup_size(1) fn look() { b.x[0] = u32(textureLoad(flat, vec2u(1u, 1u), 0).r); }
    @vertex fn cover(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
        return vec4f(f32(i32(i & 1u) * 4 - 1), f32(i32(i >> 1u) * 4 - 1), 0.0, 1.0);
    }
    @fragment fn seven() -> @location(0) vec4f { return vec4f(7.0); }
    @fragment fn first() -> @location(0) vec4f { return vec4f(f32(a.x[0])); }
";

/// Records `first`, then `second` without a barrier, which must be refused in these words; then with it, which must work.
fn refused_then_fine(
    rec: &mut Recorder,
    (before, after): (Access, Access),
    second: impl Fn(&mut Recorder) -> cao_gpu::Result<()>,
) {
    match second(rec) {
        Err(Error::Hazard { problem }) => {
            let barrier = format!("rec.barrier(&[{before:?}], &[{after:?}])");
            assert!(problem.contains(&barrier), "{problem} does not propose {barrier}");
        }
        other => panic!("{before:?} then {after:?} without a barrier was not refused: {other:?}"),
    }
    rec.barrier(&[before], &[after]);
    second(rec).unwrap();
}

fn volume(gpu: &Gpu, usage: ImageUse) -> Image {
    let desc = ImageDesc { dims: [5, 3, 2], layers: 1, format: Format::R32Float, kind: ImageKind::D3, usage };
    gpu.image("volume", &desc).unwrap()
}

#[test]
fn raw_from_producer_to_consumer_in_buffers() {
    let gpu = open();
    let shader = compile(KERNELS);
    let (count, copy) = (gpu.compute(shader, "count").unwrap(), gpu.compute(shader, "copy").unwrap());
    let (x, y) = (device_buffer(&gpu, "x", &[0; N as usize]), device_buffer(&gpu, "y", &[0; N as usize]));
    let mut rec = gpu.recorder("test").unwrap();
    rec.dispatch_over(&count, &[bind("b", &x)], &[], [N, 1, 1]).unwrap();
    refused_then_fine(&mut rec, (StorageWrite, StorageRead), |rec| {
        rec.dispatch_over(&copy, &[bind("a", &x), bind("b", &y)], &[], [N, 1, 1])
    });
    rec.submit_and_wait().unwrap();
    assert_eq!(read_back(&gpu, &y), (0..N).collect::<Vec<_>>());
    drop((x, y, count, copy));
    close(gpu);
}

#[test]
fn in_place_on_a_buffer() {
    let gpu = open();
    let double = gpu.compute(compile(KERNELS), "double").unwrap();
    let x = device_buffer(&gpu, "x", &[5; N as usize]);
    let mut rec = gpu.recorder("test").unwrap();
    let twice = |rec: &mut Recorder| rec.dispatch_over(&double, &[bind("b", &x)], &[], [N, 1, 1]);
    twice(&mut rec).unwrap();
    assert!(matches!(twice(&mut rec), Err(Error::Hazard { .. })));
    rec.barrier(&[StorageWrite], &[StorageRead]);
    assert!(matches!(twice(&mut rec), Err(Error::Hazard { .. })), "the write after the write is not ordered");
    rec.barrier(&[StorageWrite], &[StorageRead, StorageWrite]);
    twice(&mut rec).unwrap();
    rec.submit_and_wait().unwrap();
    assert_eq!(read_back(&gpu, &x), [20; N as usize]);
    drop((x, double));
    close(gpu);
}

/// Load and store happen in a function that the entry point calls.
#[test]
fn in_place_on_an_image_also_through_a_function() {
    let gpu = open();
    let shader = compile(KERNELS);
    let (increment, sample) =
        (gpu.compute(shader, "increment").unwrap(), gpu.compute(shader, "sample").unwrap());
    let image = volume(&gpu, ImageUse::STORAGE | ImageUse::SAMPLED);
    let out = device_buffer(&gpu, "out", &[0; 30]);
    let mut rec = gpu.recorder("test").unwrap();
    rec.discard(&image);
    rec.clear_image(&image, [4.0; 4]).unwrap();
    let step = |rec: &mut Recorder| {
        rec.dispatch_over(&increment, &[("in_place", Bind::Image(&image))], &[], [5, 3, 2])
    };
    assert!(matches!(step(&mut rec), Err(Error::Hazard { .. })));
    rec.barrier(&[TransferWrite], &[StorageRead, StorageWrite]);
    step(&mut rec).unwrap();
    assert!(matches!(step(&mut rec), Err(Error::Hazard { .. })));
    rec.barrier(&[StorageWrite], &[StorageRead, StorageWrite]);
    step(&mut rec).unwrap();
    refused_then_fine(&mut rec, (StorageWrite, SampledRead), |rec| {
        rec.dispatch_over(&sample, &[("sampled", Bind::Image(&image)), bind("b", &out)], &[], [5, 3, 2])
    });
    rec.submit_and_wait().unwrap();
    assert_eq!(read_back(&gpu, &out), [6; 30]);
    drop((image, out, increment, sample));
    close(gpu);
}

#[test]
fn waw_on_buffer_and_image() {
    let gpu = open();
    let shader = compile(KERNELS);
    let (count, paint) = (gpu.compute(shader, "count").unwrap(), gpu.compute(shader, "paint").unwrap());
    let x = device_buffer(&gpu, "x", &[0; N as usize]);
    let image = volume(&gpu, ImageUse::STORAGE);
    let mut rec = gpu.recorder("test").unwrap();
    rec.discard(&image);
    let number = |rec: &mut Recorder| rec.dispatch_over(&count, &[bind("b", &x)], &[], [N, 1, 1]);
    number(&mut rec).unwrap();
    refused_then_fine(&mut rec, (StorageWrite, StorageWrite), number);
    let colour = |rec: &mut Recorder| {
        rec.dispatch_over(&paint, &[("write_only", Bind::Image(&image))], &[], [5, 3, 2])
    };
    colour(&mut rec).unwrap();
    refused_then_fine(&mut rec, (StorageWrite, StorageWrite), colour);
    refused_then_fine(&mut rec, (StorageWrite, TransferWrite), |rec| rec.fill(&x, 0, 4 * u64::from(N), 9));
    rec.submit_and_wait().unwrap();
    assert_eq!(read_back(&gpu, &x), [9; N as usize]);
    drop((x, image, count, paint));
    close(gpu);
}

#[test]
fn war_from_sampling_to_writing() {
    let gpu = open();
    let shader = compile(KERNELS);
    let (paint, sample) = (gpu.compute(shader, "paint").unwrap(), gpu.compute(shader, "sample").unwrap());
    let image = volume(&gpu, ImageUse::STORAGE | ImageUse::SAMPLED);
    let out = device_buffer(&gpu, "out", &[0; 30]);
    let mut rec = gpu.recorder("test").unwrap();
    rec.discard(&image);
    let colour = |rec: &mut Recorder| {
        rec.dispatch_over(&paint, &[("write_only", Bind::Image(&image))], &[], [5, 3, 2])
    };
    colour(&mut rec).unwrap();
    rec.barrier(&[StorageWrite], &[SampledRead, StorageWrite]);
    rec.dispatch_over(&sample, &[("sampled", Bind::Image(&image)), bind("b", &out)], &[], [5, 3, 2]).unwrap();
    refused_then_fine(&mut rec, (SampledRead, StorageWrite), colour);
    rec.submit_and_wait().unwrap();
    let expected: Vec<u32> = (0..30).map(|i| i % 5 + 10 * (i / 5 % 3) + 100 * (i / 15)).collect();
    assert_eq!(read_back(&gpu, &out), expected);
    drop((image, out, paint, sample));
    close(gpu);
}

#[test]
fn transfer_to_dispatch_and_back() {
    let gpu = open();
    let copy = gpu.compute(compile(KERNELS), "copy").unwrap();
    let (x, y) = (device_buffer(&gpu, "x", &[0; N as usize]), device_buffer(&gpu, "y", &[0; N as usize]));
    let back = gpu.buffer("back", 4 * u64::from(N), BufferUse::Readback).unwrap();
    let mut rec = gpu.recorder("test").unwrap();
    rec.fill(&x, 0, x.bytes(), 3).unwrap();
    refused_then_fine(&mut rec, (TransferWrite, StorageRead), |rec| {
        rec.dispatch_over(&copy, &[bind("a", &x), bind("b", &y)], &[], [N, 1, 1])
    });
    refused_then_fine(&mut rec, (StorageWrite, TransferRead), |rec| {
        rec.copy_buffer(&y, 0, &back, 0, y.bytes())
    });
    refused_then_fine(&mut rec, (StorageRead, TransferWrite), |rec| rec.update(&x, 0, &[0; 8]));
    rec.submit_and_wait().unwrap();
    assert_eq!(back.read(0, 8).unwrap(), [3, 0, 0, 0, 3, 0, 0, 0]);
    drop((x, y, back, copy));
    close(gpu);
}

#[test]
fn dispatch_to_indirect_arguments() {
    let gpu = open();
    let shader = compile(KERNELS);
    let (arguments, count) =
        (gpu.compute(shader, "arguments").unwrap(), gpu.compute(shader, "count").unwrap());
    let (args, x) = (device_buffer(&gpu, "args", &[0; 3]), device_buffer(&gpu, "x", &[99; N as usize]));
    let mut rec = gpu.recorder("test").unwrap();
    rec.dispatch(&arguments, &[bind("b", &args)], &[], [1, 1, 1]).unwrap();
    refused_then_fine(&mut rec, (StorageWrite, IndirectRead), |rec| {
        rec.dispatch_indirect(&count, &[bind("b", &x)], &[], &args, 0)
    });
    refused_then_fine(&mut rec, (IndirectRead, TransferWrite), |rec| rec.fill(&args, 0, 12, 0));
    rec.submit_and_wait().unwrap();
    let expected: Vec<u32> = (0..N).map(|i| if i < 24 { i } else { 99 }).collect();
    assert_eq!(read_back(&gpu, &x), expected);
    drop((args, x, arguments, count));
    close(gpu);
}

#[test]
fn attachment_to_sampled_and_buffer_to_drawing() {
    let gpu = open();
    let shader = compile(KERNELS);
    let desc = GraphicsDesc {
        vertex: "cover",
        fragment: "seven",
        colours: &[Format::R32Float],
        ..Default::default()
    };
    let seven = gpu.graphics(shader, &desc).unwrap();
    let first = gpu.graphics(shader, &GraphicsDesc { fragment: "first", ..desc }).unwrap();
    let (look, count) = (gpu.compute(shader, "look").unwrap(), gpu.compute(shader, "count").unwrap());
    let desc = ImageDesc {
        dims: [4, 3, 1],
        layers: 1,
        format: Format::R32Float,
        kind: ImageKind::D2,
        usage: ImageUse::ATTACHMENT | ImageUse::SAMPLED,
    };
    let picture = gpu.image("picture", &desc).unwrap();
    let (x, out) = (device_buffer(&gpu, "x", &[42; 2]), device_buffer(&gpu, "out", &[0; 1]));
    let mut rec = gpu.recorder("test").unwrap();
    rec.discard(&picture);
    let target = [(&picture, None)];
    let onto = Attachments { colours: &target, depth: None, layer: None, at: [0; 2], size: [4, 3] };
    let look_at = |rec: &mut Recorder| {
        rec.dispatch(&look, &[("flat", Bind::Image(&picture)), bind("b", &out)], &[], [1, 1, 1])
    };
    rec.draw(&seven, &[], &[], onto, 3).unwrap();
    refused_then_fine(&mut rec, (AttachmentWrite, AttachmentWrite), |rec| {
        rec.draw(&seven, &[], &[], onto, 3)
    });
    refused_then_fine(&mut rec, (AttachmentWrite, SampledRead), look_at);
    rec.barrier(&[SampledRead, AttachmentWrite], &[AttachmentWrite]);
    rec.dispatch_over(&count, &[bind("b", &x)], &[], [1, 1, 1]).unwrap();
    refused_then_fine(&mut rec, (StorageWrite, GraphicsRead), |rec| {
        rec.draw(&first, &[bind("a", &x)], &[], onto, 3)
    });
    rec.submit_and_wait().unwrap();
    assert_eq!(read_back(&gpu, &out), [7]);
    let mut rec = gpu.recorder("after a full wait").unwrap();
    look_at(&mut rec).unwrap();
    rec.submit_and_wait().unwrap();
    assert_eq!(read_back(&gpu, &out), [0], "`count` wrote 0 to x[0] before it was drawn");
    drop((picture, x, out, seven, first, look, count));
    close(gpu);
}

#[test]
fn an_image_must_be_discarded_once_and_also_if_it_is_younger_than_the_recorder() {
    let gpu = open();
    let paint = gpu.compute(compile(KERNELS), "paint").unwrap();
    let mut rec = gpu.recorder("test").unwrap();
    let image = volume(&gpu, ImageUse::STORAGE);
    let colour = |rec: &mut Recorder| {
        rec.dispatch_over(&paint, &[("write_only", Bind::Image(&image))], &[], [5, 3, 2])
    };
    assert!(matches!(colour(&mut rec), Err(Error::Hazard { problem }) if problem.contains("rec.discard")));
    rec.discard(&image);
    colour(&mut rec).unwrap();
    drop(rec);
    let mut rec = gpu.recorder("the first was never submitted").unwrap();
    assert!(matches!(colour(&mut rec), Err(Error::Hazard { problem }) if problem.contains("rec.discard")));
    rec.discard(&image);
    rec.submit_and_wait().unwrap();
    let mut rec = gpu.recorder("the second was").unwrap();
    colour(&mut rec).unwrap();
    rec.submit_and_wait().unwrap();
    drop((image, paint));
    close(gpu);
}
