// What the pixels of several views show: a normal and a depth each, all that ambient occlusion of pixels is made of.

#include "shared/eye.wgsl"

// The views, in the order of the pixels.
struct Eyes {
    eye: array<Eye, MOST_VIEWS>,
}

struct Geometry {
    // for each pixel, rows from the top, view after view: the unit normal of the surface, of the side that is seen, and the view depth in
    // mm; a depth of 0 where nothing is
    pixel: array<vec4<f32>>,
}

// Index of a pixel of a view.
fn pixel_index(size: vec2<u32>, view: u32, pixel: vec2<u32>) -> u32 {
    return (view * size.y + pixel.y) * size.x + pixel.x;
}

// World direction through a place of a view's image in pixels, mm of way a mm of depth.
fn direction_through(eye: Eye, size: vec2<u32>, place: vec2<f32>) -> vec3<f32> {
    let uv = place / vec2<f32>(size);
    return eye.base.xyz + uv.x * eye.along_u.xyz + uv.y * eye.along_v.xyz;
}

// World position of what is at a depth in the middle of a pixel.
fn position_of(eye: Eye, size: vec2<u32>, pixel: vec2<u32>, depth: f32) -> vec3<f32> {
    return eye.origin.xyz + depth * direction_through(eye, size, vec2<f32>(pixel) + 0.5);
}

// How far from where it is computed a place may be, of its distances from eye and origin: some roundings of f32. What is nearer to a surface
// than this is taken for the surface itself.
const UNCERTAIN = 1e-5;

fn uncertainty(position: vec3<f32>, depth: f32) -> f32 {
    return UNCERTAIN * (length(position) + depth);
}

// Where a world position is in a view's image: the place in pixels, and its view depth in mm; in front of the eye where that is above 0.
fn place_of(eye: Eye, size: vec2<u32>, position: vec3<f32>) -> vec3<f32> {
    let clip = eye.view_projection * vec4(position, 1.0);
    return vec3((clip.xy / clip.w * 0.5 + 0.5) * vec2<f32>(size), clip.w);
}
