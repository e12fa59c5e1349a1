//! What Vulkan leaves undefined no safe function lets through: each is refused with the name of the thing, and the validation layer
//! has nothing to say.

use cao_gpu::{
    Access, Attachments, Blend, BufferUse, DepthTest, Format, Gpu, GraphicsDesc, Image, ImageDesc, ImageKind,
    ImageUse, Pipeline,
};
use cao_testing::wgsl::{bind, compile, device_buffer, read_back};
use cao_testing::{close, open};

const PICTURE: &str = "
    @vertex fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {
        return vec4(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.5, 1.0);
    }
    @fragment fn fragment() -> @location(0) vec4<f32> { return vec4(1.0); }
    @fragment fn number() -> @location(0) u32 { return 1u; }
    @fragment fn nothing() {}";

fn message<T>(result: cao_gpu::Result<T>) -> String {
    result.err().expect("a refusal").to_string()
}

fn image(gpu: &Gpu, format: Format) -> Image {
    let usage = ImageUse::ATTACHMENT | ImageUse::SAMPLED;
    gpu.image("target", &ImageDesc { dims: [8, 8, 1], layers: 1, format, kind: ImageKind::D2, usage })
        .unwrap()
}

#[test]
fn drawing_to_nothing_is_refused() {
    let gpu = open();
    let desc = GraphicsDesc { vertex: "vertex", fragment: "nothing", ..GraphicsDesc::default() };
    let found = message(gpu.graphics(compile(PICTURE), &desc));
    assert!(found.contains("vertex+nothing: draws to nothing"), "{found}");
    close(gpu);
}

#[test]
fn blending_into_formats_that_cannot_is_refused() {
    let gpu = open();
    let make = |fragment, format| {
        let desc = GraphicsDesc {
            vertex: "vertex",
            fragment,
            colours: &[format],
            blend: Blend::Premultiplied,
            ..GraphicsDesc::default()
        };
        gpu.graphics(compile(PICTURE), &desc)
    };
    for format in [Format::R32Uint, Format::R8Uint] {
        let found = message(make("number", format));
        assert!(found.contains(&format!("blends into {format:?}")), "{found}");
    }
    drop(make("fragment", Format::Rgba8Unorm).unwrap());
    close(gpu);
}

#[test]
fn depths_outside_0_to_1_are_no_clear_values() {
    let gpu = open();
    let desc = GraphicsDesc {
        vertex: "vertex",
        fragment: "nothing",
        depth: Some(Format::D32Float),
        depth_test: DepthTest::Less,
        depth_write: true,
        ..GraphicsDesc::default()
    };
    let pipeline = gpu.graphics(compile(PICTURE), &desc).unwrap();
    let target = image(&gpu, Format::D32Float);
    let mut rec = gpu.recorder("test").unwrap();
    rec.discard(&target);
    for depth in [f32::NAN, -0.5, 1.5, f32::INFINITY] {
        let to = Attachments {
            colours: &[],
            depth: Some((&target, Some(depth))),
            layer: None,
            at: [0; 2],
            size: [8, 8],
        };
        let draw = message(rec.draw(&pipeline, &[], &[], to, 3));
        let clear = message(rec.clear_image(&target, [depth; 4]));
        for found in [draw, clear] {
            assert!(found.contains(&format!("image target: is cleared to depth {depth}")), "{found}");
        }
    }
    for depth in [0.0, 1.0] {
        rec.clear_image(&target, [depth, f32::NAN, 7.0, -1.0]).unwrap();
        rec.barrier(&[Access::TransferWrite], &[Access::TransferWrite]);
    }
    rec.submit_and_wait().unwrap();
    drop((pipeline, target));
    close(gpu);
}

#[test]
fn buffers_smaller_than_the_shaders_struct_are_refused() {
    let gpu = open();
    let shader = compile(
        "struct Fixed { a: vec4<f32>, b: vec4<u32>, c: u32 }
         struct List { count: u32, items: array<vec2<u32>> }
         @group(0) @binding(0) var<uniform> fixed: Fixed;
         @group(0) @binding(1) var<storage, read_write> list: List;
         @compute @workgroup_size(1) fn main() { list.items[0] = vec2(fixed.c); }",
    );
    let pipeline = gpu.compute(shader, "main").unwrap();
    let buffer = |words: usize| device_buffer(&gpu, "made", &vec![0; words]);
    let mut rec = gpu.recorder("test").unwrap();
    // 48 bytes of a struct that is a multiple of 16; a count, a gap and one item.
    for (fixed, list, refusal) in [
        (11, 4, Some("binding `fixed`: is given 44 bytes of buffer made, the shader takes at least 48")),
        (12, 3, Some("binding `list`: is given 12 bytes of buffer made, the shader takes at least 16")),
        (12, 4, None),
    ] {
        let (fixed, list) = (buffer(fixed), buffer(list));
        let result = rec.dispatch(&pipeline, &[bind("fixed", &fixed), bind("list", &list)], &[], [1; 3]);
        match refusal {
            Some(refusal) => assert!(message(result).contains(refusal)),
            None => result.unwrap(),
        }
    }
    rec.submit_and_wait().unwrap();
    drop(pipeline);
    close(gpu);
}

const COUNT: &str = "
    struct Arguments { x: atomic<u32>, y: u32, z: u32, more: u32 }
    @group(0) @binding(0) var<storage, read_write> a: Arguments;
    @compute @workgroup_size(1) fn main() { atomicAdd(&a.x, 1u); }";

#[test]
fn indirect_arguments_are_what_every_device_can_run() {
    let gpu = open();
    let pipeline = gpu.compute(compile(COUNT), "main").unwrap();
    let other = device_buffer(&gpu, "other", &[0; 4]);
    let refused = |rec: &mut cao_gpu::Recorder, pipeline: &Pipeline, arguments: &cao_gpu::Buffer| {
        let found = message(rec.dispatch_indirect(pipeline, &[bind("a", &other)], &[], arguments, 0));
        assert!(
            found.contains("indirect arguments in buffer arguments at 0") && found.contains("65535"),
            "{found}"
        );
    };
    let both = |rec: &mut cao_gpu::Recorder| {
        let all = [Access::TransferWrite, Access::StorageRead, Access::StorageWrite, Access::IndirectRead];
        rec.barrier(&all, &all);
    };
    let arguments = gpu.buffer("arguments", 16, BufferUse::Device).unwrap();
    let mut rec = gpu.recorder("test").unwrap();
    // Nobody wrote them.
    refused(&mut rec, &pipeline, &arguments);
    for bad in [[65536, 1, 1], [1, u32::MAX, 1], [1, 1, 70000]] {
        rec.update(&arguments, 0, bytemuck::cast_slice(&bad)).unwrap();
        both(&mut rec);
        refused(&mut rec, &pipeline, &arguments);
    }
    // Piece by piece they become right.
    rec.fill(&arguments, 0, 8, 1).unwrap();
    both(&mut rec);
    refused(&mut rec, &pipeline, &arguments);
    rec.fill(&arguments, 8, 8, 1).unwrap();
    both(&mut rec);
    rec.dispatch_indirect(&pipeline, &[bind("a", &other)], &[], &arguments, 0).unwrap();
    both(&mut rec);
    // Something behind them is no matter; one of them is.
    rec.fill(&arguments, 12, 4, u32::MAX).unwrap();
    both(&mut rec);
    rec.dispatch_indirect(&pipeline, &[bind("a", &other)], &[], &arguments, 0).unwrap();
    rec.submit_and_wait().unwrap();
    assert_eq!(read_back(&gpu, &other)[0], 2);

    // The next recording knows, and that a copy may bring anything.
    let mut rec = gpu.recorder("test").unwrap();
    rec.dispatch_indirect(&pipeline, &[bind("a", &other)], &[], &arguments, 0).unwrap();
    both(&mut rec);
    let all = [Access::TransferWrite, Access::StorageWrite, Access::TransferRead];
    rec.barrier(&all, &all);
    rec.copy_buffer(&other, 0, &arguments, 4, 4).unwrap();
    both(&mut rec);
    refused(&mut rec, &pipeline, &arguments);
    rec.submit_and_wait().unwrap();
    let found = message(gpu.recorder("test").unwrap().dispatch_indirect(
        &pipeline,
        &[bind("a", &other)],
        &[],
        &arguments,
        2,
    ));
    assert!(found.contains("at a multiple of 4"), "{found}");
    let found = message(gpu.recorder("test").unwrap().dispatch_indirect(
        &pipeline,
        &[bind("a", &other)],
        &[],
        &arguments,
        8,
    ));
    assert!(found.contains("buffer arguments: range of 12 bytes at 8 is outside"), "{found}");
    drop((pipeline, other, arguments));
    close(gpu);
}
