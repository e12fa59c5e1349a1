//! Drawing: orientation, culling, depth, layers, places, blending, and refusal of what does not fit.

use cao_gpu::Access::*;
use cao_gpu::{
    Attachments, Bind, Blend, BufferUse, Cull, DepthTest, Format, Gpu, GraphicsDesc, Image, ImageDesc,
    ImageKind, ImageUse,
};
use cao_testing::wgsl::compile;
use cao_testing::{close, open};

/// One triangle that covers the picture's upper left half, counter-clockwise as seen, at the depth and in the colour of the immediates.
const SHADER: &str = "
    struct Push { colour: vec4f, depth: f32, flip: f32 }
    var<immediate> push: Push;
    @vertex fn triangle(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
        var corners = array(vec2f(-1.0, -1.0), vec2f(-1.0, 1.0), vec2f(1.0, -1.0));
        let c = corners[i];
        return vec4f(select(c, c.yx, push.flip > 0.0), push.depth, 1.0);
    }
    @fragment fn colour() -> @location(0) vec4f { return push.colour; }
";

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Push {
    colour: [f32; 4],
    depth: f32,
    flip: f32,
    pad: [f32; 2],
}

fn push(colour: [f32; 4], depth: f32, flip: bool) -> Vec<u8> {
    bytemuck::bytes_of(&Push { colour, depth, flip: if flip { 1.0 } else { 0.0 }, pad: [0.0; 2] }).to_vec()
}

fn target(gpu: &Gpu, name: &str, format: Format, layers: u32) -> Image {
    let desc =
        ImageDesc { dims: [5, 5, 1], layers, format, kind: ImageKind::D2, usage: ImageUse::ATTACHMENT };
    gpu.image(name, &desc).unwrap()
}

/// Texel (x, y) of a layer, of an image of floats that was last drawn to.
fn texel<const N: usize>(gpu: &Gpu, image: &Image, layer: u32, [x, y]: [u32; 2]) -> [f32; N] {
    let back = gpu.buffer("back", 4 * N as u64, BufferUse::Readback).unwrap();
    let mut rec = gpu.recorder("read").unwrap();
    rec.copy_image_to_buffer(image, layer, [x, y, 0], [1; 3], &back, 0).unwrap();
    rec.submit_and_wait().unwrap();
    let bytes = back.read(0, 4 * N as u64).unwrap();
    std::array::from_fn(|i| bytemuck::pod_read_unaligned(&bytes[4 * i..4 * i + 4]))
}

const UPPER_LEFT: [u32; 2] = [0, 0];
const LOWER_RIGHT: [u32; 2] = [4, 4];
const RED: [f32; 4] = [1.0, 0.0, 0.0, 1.0];
const CLEAR: [f32; 4] = [0.25, 0.5, 0.75, 1.0];

#[test]
fn y_points_down_and_counter_clockwise_triangles_face_front() {
    let gpu = open();
    let shader = compile(SHADER);
    let image = target(&gpu, "picture", Format::Rgba32Float, 1);
    for (cull, flip, visible) in [
        (Cull::None, false, true),
        (Cull::None, true, true),
        (Cull::Back, false, true),
        (Cull::Back, true, false),
        (Cull::Front, false, false),
        (Cull::Front, true, true),
    ] {
        let desc = GraphicsDesc {
            vertex: "triangle",
            fragment: "colour",
            colours: &[Format::Rgba32Float],
            cull,
            ..Default::default()
        };
        let pipeline = gpu.graphics(shader, &desc).unwrap();
        let mut rec = gpu.recorder("draw").unwrap();
        rec.discard(&image);
        let onto = Attachments {
            colours: &[(&image, Some(CLEAR))],
            depth: None,
            layer: None,
            at: [0; 2],
            size: [5, 5],
        };
        rec.draw(&pipeline, &[], &push(RED, 0.0, flip), onto, 3).unwrap();
        rec.submit_and_wait().unwrap();
        assert_eq!(texel(&gpu, &image, 0, UPPER_LEFT), if visible { RED } else { CLEAR }, "{cull:?} {flip}");
        assert_eq!(texel(&gpu, &image, 0, LOWER_RIGHT), CLEAR, "{cull:?} {flip}");
    }
    drop(image);
    close(gpu);
}

#[test]
fn depth_is_tested_written_kept_and_cleared() {
    let gpu = open();
    let shader = compile(SHADER);
    let desc = GraphicsDesc {
        vertex: "triangle",
        fragment: "colour",
        colours: &[Format::Rgba32Float],
        depth: Some(Format::D32Float),
        depth_test: DepthTest::Less,
        depth_write: true,
        ..Default::default()
    };
    let nearer = gpu.graphics(shader, &desc).unwrap();
    let farther = gpu.graphics(shader, &GraphicsDesc { depth_test: DepthTest::Greater, ..desc }).unwrap();
    let image = target(&gpu, "picture", Format::Rgba32Float, 1);
    let depth = target(&gpu, "depth", Format::D32Float, 1);
    let grey = |v: f32| [v, v, v, v];
    let mut rec = gpu.recorder("draw").unwrap();
    rec.discard(&image);
    rec.discard(&depth);
    let first = Attachments {
        colours: &[(&image, Some(CLEAR))],
        depth: Some((&depth, Some(1.0))),
        layer: None,
        at: [0; 2],
        size: [5, 5],
    };
    let then = Attachments { colours: &[(&image, None)], depth: Some((&depth, None)), ..first };
    let mut draw = |pipeline, onto, z: f32| {
        rec.draw(pipeline, &[], &push(grey(z), z, false), onto, 3).unwrap();
        rec.barrier(&[AttachmentWrite], &[AttachmentWrite]);
    };
    draw(&nearer, first, 0.5);
    draw(&nearer, then, 0.75); // hidden
    draw(&nearer, then, 0.25); // in front
    draw(&farther, then, 0.125); // too near
    draw(&farther, then, 0.375); // behind
    rec.submit_and_wait().unwrap();
    assert_eq!(texel(&gpu, &image, 0, UPPER_LEFT), grey(0.375));
    assert_eq!(texel(&gpu, &depth, 0, UPPER_LEFT), [0.375]);
    assert_eq!(texel(&gpu, &depth, 0, LOWER_RIGHT), [1.0]);
    drop((image, depth, nearer, farther));
    close(gpu);
}

#[test]
fn one_layer_is_drawn_and_the_others_stay() {
    let gpu = open();
    let shader = compile(SHADER);
    let desc = GraphicsDesc {
        vertex: "triangle",
        fragment: "colour",
        colours: &[Format::R32Float],
        ..Default::default()
    };
    let pipeline = gpu.graphics(shader, &desc).unwrap();
    let image = target(&gpu, "layers", Format::R32Float, 3);
    let mut rec = gpu.recorder("draw").unwrap();
    rec.discard(&image);
    rec.clear_image(&image, [9.0; 4]).unwrap();
    rec.barrier(&[TransferWrite], &[AttachmentWrite]);
    for layer in [1, 2] {
        // Different layers need no barrier between them.
        let onto = Attachments {
            colours: &[(&image, None)],
            depth: None,
            layer: Some(layer),
            at: [0; 2],
            size: [5, 5],
        };
        rec.draw(&pipeline, &[], &push([layer as f32; 4], 0.0, false), onto, 3).unwrap();
    }
    rec.submit_and_wait().unwrap();
    let values: Vec<[f32; 1]> = (0..3).map(|layer| texel(&gpu, &image, layer, UPPER_LEFT)).collect();
    assert_eq!(values, [[9.0], [1.0], [2.0]]);
    drop((image, pipeline));
    close(gpu);
}

#[test]
fn what_is_drawn_stays_in_its_rectangle() {
    let gpu = open();
    let desc = GraphicsDesc {
        vertex: "triangle",
        fragment: "colour",
        colours: &[Format::R32Float],
        ..Default::default()
    };
    let pipeline = gpu.graphics(compile(SHADER), &desc).unwrap();
    let image = target(&gpu, "picture", Format::R32Float, 1);
    let mut rec = gpu.recorder("draw").unwrap();
    rec.discard(&image);
    rec.clear_image(&image, [9.0; 4]).unwrap();
    rec.barrier(&[TransferWrite], &[AttachmentWrite]);
    // The viewport's upper left half is drawn, the rest of the rectangle cleared.
    let colours = &[(&image, Some([3.0; 4]))];
    let onto = Attachments { colours, depth: None, layer: None, at: [1, 2], size: [3, 2] };
    rec.draw(&pipeline, &[], &push([1.0; 4], 0.0, false), onto, 3).unwrap();
    rec.submit_and_wait().unwrap();
    for (place, expected) in [([1, 2], 1.0), ([3, 3], 3.0), ([0, 2], 9.0), ([1, 1], 9.0), ([4, 3], 9.0)] {
        assert_eq!(texel(&gpu, &image, 0, place), [expected], "{place:?}");
    }
    drop((image, pipeline));
    close(gpu);
}

#[test]
fn premultiplied_colours_go_over_what_is_there() {
    let gpu = open();
    let desc = GraphicsDesc {
        vertex: "triangle",
        fragment: "colour",
        colours: &[Format::Rgba32Float],
        blend: Blend::Premultiplied,
        ..Default::default()
    };
    let pipeline = gpu.graphics(compile(SHADER), &desc).unwrap();
    let image = target(&gpu, "picture", Format::Rgba32Float, 1);
    let mut rec = gpu.recorder("draw").unwrap();
    rec.discard(&image);
    let onto =
        Attachments { colours: &[(&image, Some(CLEAR))], depth: None, layer: None, at: [0; 2], size: [5, 5] };
    rec.draw(&pipeline, &[], &push([0.5, 0.0, 0.0, 0.5], 0.0, false), onto, 3).unwrap();
    rec.submit_and_wait().unwrap();
    assert_eq!(texel(&gpu, &image, 0, UPPER_LEFT), [0.625, 0.25, 0.375, 1.0]);
    drop((image, pipeline));
    close(gpu);
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    let gpu = open();
    let shader = compile(&format!(
        "{SHADER}
         @group(0) @binding(0) var<storage, read_write> log: array<u32>;
         @fragment fn writes() -> @location(0) vec4f {{ log[0] = 1u; return vec4f(0.0); }}"
    ));
    let problem = |result: cao_gpu::Result<()>| result.expect_err("must be refused").to_string();
    let good = GraphicsDesc {
        vertex: "triangle",
        fragment: "colour",
        colours: &[Format::R32Float],
        ..Default::default()
    };
    for (desc, word) in [
        (GraphicsDesc { vertex: "colour", ..good }, "`colour`"),
        (GraphicsDesc { fragment: "writes", ..good }, "`log`"),
        (GraphicsDesc { depth_write: true, ..good }, "no depth attachment"),
        (GraphicsDesc { depth: Some(Format::R32Float), ..good }, "colour format"),
        (GraphicsDesc { colours: &[Format::D32Float], ..good }, "depth format"),
        (GraphicsDesc { colours: &[Format::R32Float; 5], ..good }, "4 colour"),
    ] {
        let message = problem(gpu.graphics(shader, &desc).map(drop));
        assert!(message.contains(word), "{message}");
    }
    assert!(problem(gpu.compute(shader, "triangle").map(drop)).contains("triangle (Vertex)"));
    let pipeline = gpu.graphics(shader, &good).unwrap();
    let (one, two) = (target(&gpu, "one", Format::R32Float, 1), target(&gpu, "two", Format::R32Float, 2));
    let rgba = target(&gpu, "rgba", Format::Rgba32Float, 1);
    let mut rec = gpu.recorder("draw").unwrap();
    [&one, &two, &rgba].into_iter().for_each(|image| rec.discard(image));
    let push = push(RED, 0.0, false);
    for (image, layer, at, size, word) in [
        (&rgba, None, [0; 2], [5, 5], "Rgba32Float"),
        (&two, None, [0; 2], [5, 5], "2 layers"),
        (&two, Some(2), [0; 2], [5, 5], "Some(2)"),
        (&one, None, [0; 2], [6, 5], "6×5"),
        (&one, None, [0, 3], [5, 3], "5×3 pixels at 0, 3"),
        (&one, None, [u32::MAX, 0], [5, 5], "do not fit"),
        (&one, None, [0; 2], [5, 0], "do not fit"),
    ] {
        let onto = Attachments { colours: &[(image, None)], depth: None, layer, at, size };
        let message = problem(rec.draw(&pipeline, &[], &push, onto, 3));
        assert!(message.contains(word), "{message}");
    }
    assert!(problem(rec.dispatch(&pipeline, &[], &push, [1; 3])).contains("other kind"));
    let onto = Attachments { colours: &[(&one, None)], depth: None, layer: None, at: [0; 2], size: [5, 5] };
    let twice = Attachments { colours: &[(&one, None), (&one, None)], ..onto };
    let pair = gpu.graphics(shader, &GraphicsDesc { colours: &[Format::R32Float; 2], ..good }).unwrap();
    assert!(problem(rec.draw(&pair, &[], &push, twice, 3)).contains("at once"));
    rec.draw(&pipeline, &[], &push, onto, 3).unwrap();
    rec.submit_and_wait().unwrap();
    drop((one, two, rgba, pipeline, pair));
    close(gpu);
}

#[test]
fn depth_images_are_read_as_floats() {
    let gpu = open();
    let shader = compile(
        "@group(0) @binding(0) var plain: texture_2d<f32>;
         @group(0) @binding(1) var depth: texture_depth_2d;
         @group(0) @binding(2) var<storage, read_write> out: array<f32, 2>;
         @compute @workgroup_size(1) fn main() {
             out[0] = textureLoad(plain, vec2u(1u), 0).r;
             out[1] = textureLoad(depth, vec2u(1u), 0);
         }",
    );
    let pipeline = gpu.compute(shader, "main").unwrap();
    let usage = ImageUse::ATTACHMENT | ImageUse::SAMPLED;
    let desc = ImageDesc { dims: [3, 3, 1], layers: 1, format: Format::D32Float, kind: ImageKind::D2, usage };
    let depth = gpu.image("depth", &desc).unwrap();
    let out = cao_testing::wgsl::device_buffer(&gpu, "out", &[0; 2]);
    let mut rec = gpu.recorder("read").unwrap();
    rec.discard(&depth);
    rec.clear_image(&depth, [0.625; 4]).unwrap();
    rec.barrier(&[TransferWrite], &[SampledRead]);
    let binds = [
        ("plain", Bind::Image(&depth)),
        ("depth", Bind::Layer(&depth, 0)),
        cao_testing::wgsl::bind("out", &out),
    ];
    rec.dispatch(&pipeline, &binds, &[], [1; 3]).unwrap();
    rec.submit_and_wait().unwrap();
    assert_eq!(cao_testing::wgsl::read_back(&gpu, &out), [0.625f32.to_bits(); 2]);
    drop((pipeline, depth, out));
    close(gpu);
}
