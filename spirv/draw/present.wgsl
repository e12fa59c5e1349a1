// A picture into a host's attachments, all views in one multiview pass.

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

@fragment
fn fragment(@builtin(position) place: vec4<f32>, @builtin(view_index) view: u32) -> Pixel {
    let at = vec2<u32>(place.xy);
    return Pixel(textureLoad(colours, at, view, 0), textureLoad(depths, at, view, 0).r);
}
