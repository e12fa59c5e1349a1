// A view of a picture into a rectangle of a host's image: its colours, and its depths where it has any; enlarged where only a part of it
// was drawn.

struct PresentParams {
    // the rectangle's first pixel and size
    first: vec2<u32>,
    size: vec2<u32>,
    // pixels that were drawn, the picture's upper left
    drawn: vec2<u32>,
    // the picture's layer
    view: u32,
    // 1: the host's numbers are sRGB's, though its format does not say so
    coded: u32,
    // depth of nothing; 1: where there is nothing, the host's depth stays
    nothing: f32,
    over: u32,
}

var<immediate> params: PresentParams;

// premultiplied, linear; a host's depth
@group(0) @binding(0) var colours: texture_2d_array<f32>;
@group(0) @binding(1) var depths: texture_2d_array<f32>;

// Vertices to draw.
const CORNERS = 3u;

// A triangle round all of the rectangle.
@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4(select(-1.0, 3.0, index == 1u), select(-1.0, 3.0, index == 2u), 0.0, 1.0);
}

fn colour_at(texel: vec2<i32>) -> vec4<f32> {
    return textureLoad(colours, texel, params.view, 0);
}

// By hand: a sampler would mix in what lies beside the part that was drawn.
fn interpolated(at: vec2<f32>) -> vec4<f32> {
    let last = vec2<i32>(params.drawn) - 1;
    let low = vec2<i32>(floor(at));
    let w = at - floor(at);
    let a = clamp(low, vec2(0), last);
    let b = clamp(low + 1, vec2(0), last);
    return mix(
        mix(colour_at(a), colour_at(vec2(b.x, a.y)), w.x),
        mix(colour_at(vec2(a.x, b.y)), colour_at(b), w.x),
        w.y,
    );
}

// sRGB's curve.
fn coded(linear: vec3<f32>) -> vec3<f32> {
    let c = clamp(linear, vec3(0.0), vec3(1.0));
    return select(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, c <= vec3(0.0031308));
}

// Where the pixel lies in the part that was drawn.
fn place_of(pixel: vec2<f32>) -> vec2<f32> {
    return (pixel - vec2<f32>(params.first)) * vec2<f32>(params.drawn) / vec2<f32>(params.size);
}

@fragment
fn colour(@builtin(position) pixel: vec4<f32>) -> @location(0) vec4<f32> {
    var found = vec4(0.0);
    if all(params.drawn == params.size) {
        found = colour_at(vec2<i32>(pixel.xy) - vec2<i32>(params.first));
    } else {
        found = interpolated(place_of(pixel.xy) - 0.5);
    }
    if params.coded == 1u && found.a > 0.0 {
        return vec4(coded(found.rgb / found.a) * found.a, found.a);
    }
    return found;
}

struct Depth {
    @builtin(frag_depth) depth: f32,
}

@fragment
fn depth(@builtin(position) pixel: vec4<f32>) -> Depth {
    let place = min(vec2<u32>(place_of(pixel.xy)), params.drawn - 1u);
    let depth = textureLoad(depths, place, params.view, 0).r;
    if params.over == 1u && depth == params.nothing {
        discard;
    }
    return Depth(depth);
}
