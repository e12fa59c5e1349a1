// A picture into a host's attachments, all views in one multiview pass; enlarged where only a part of it was drawn.

struct PresentParams {
    // pixels that were drawn, the picture's upper left, and those to be shown
    drawn: vec2<u32>,
    size: vec2<u32>,
}

var<immediate> params: PresentParams;

// premultiplied, linear; Vulkan's 0 ... 1
@group(0) @binding(0) var colours: texture_2d_array<f32>;
@group(0) @binding(1) var depths: texture_2d_array<f32>;

struct Pixel {
    @location(0) colour: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

// Vertices to draw.
const CORNERS = 6u;

// Two triangles that make a rectangle of the whole image: one large triangle would do, but the software driver of Mesa 22.3
// forgets the view of triangles that are not half of an upright rectangle.
@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let right = index == 2u || index == 3u || index == 5u;
    let below = index == 1u || index == 4u || index == 5u;
    return vec4(select(-1.0, 1.0, right), select(-1.0, 1.0, below), 0.0, 1.0);
}

// By hand: a sampler would mix in what lies beside the part that was drawn.
fn interpolated(at: vec2<f32>, view: u32) -> vec4<f32> {
    let last = vec2<i32>(params.drawn) - 1;
    let low = vec2<i32>(floor(at));
    let w = at - floor(at);
    let a = clamp(low, vec2(0), last);
    let b = clamp(low + 1, vec2(0), last);
    return mix(
        mix(textureLoad(colours, a, view, 0), textureLoad(colours, vec2(b.x, a.y), view, 0), w.x),
        mix(textureLoad(colours, vec2(a.x, b.y), view, 0), textureLoad(colours, b, view, 0), w.x),
        w.y,
    );
}

@fragment
fn fragment(@builtin(position) place: vec4<f32>, @builtin(view_index) view: u32) -> Pixel {
    if all(params.drawn == params.size) {
        let at = vec2<u32>(place.xy);
        return Pixel(textureLoad(colours, at, view, 0), textureLoad(depths, at, view, 0).r);
    }
    let at = place.xy * vec2<f32>(params.drawn) / vec2<f32>(params.size);
    let nearest = min(vec2<u32>(at), params.drawn - 1u);
    return Pixel(interpolated(at - 0.5, view), textureLoad(depths, nearest, view, 0).r);
}
