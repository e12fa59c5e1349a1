// Views and the frame's settings. World is millimetres with the volume's centre at the origin.

#include "shared/eye.wgsl"

// Samples of a pixel, and vectors that hold the places of two each.
const MOST_SAMPLES = 256u;
const PAIRS_OF_SAMPLES = 128u;

struct Frame {
    // one a view, in the order of the image's layers; left and right eye first
    eye: array<Eye, MOST_VIEWS>,
    // voxels along each axis
    dims: vec4<f32>,
    // mm; w: step along the ray in mm
    spacing: vec4<f32>,
    // unit vector towards the light; w: reference length of the opacity in mm
    light: vec4<f32>,
    // parts of the light, and the exponent of the highlight
    ambient: f32,
    diffuse: f32,
    specular: f32,
    shininess: f32,
    // 1: surfaces are lit from behind as from the front
    two_sided: f32,
    // 1: the ambient factor multiplies the ambient part; the other parts
    occluded: f32,
    occluded_rest: f32,
    // it is shown times this, and at most as 1
    gain: f32,
    // what may remain of a ray's light where a level of the picture is a level of light
    remainder: f32,
    // value = texel * scale + bias
    bias: f32,
    scale: f32,
    // samples of a pixel, what each weighs, and where they lie, in pixels from its centre; the first is the nearest to it
    share: f32,
    samples: u32,
    places: array<vec4<f32>, PAIRS_OF_SAMPLES>,
}

fn index_of(world: vec3<f32>) -> vec3<f32> {
    return world / frame.spacing.xyz + 0.5 * (frame.dims.xyz - 1.0);
}

// The ray through a place of an eye's image. Its parameter t is the view depth in mm.
struct Ray {
    // world direction, mm of way a mm of depth
    direction: vec3<f32>,
    // index position is start + t * along
    start: vec3<f32>,
    along: vec3<f32>,
    // where it is inside the volume and between near and far plane; begin > end where it misses
    begin: f32,
    end: f32,
    // depth between samples
    step: f32,
}

// Where a line enters and leaves a box; the first is larger than the second where it misses.
fn crossing(start: vec3<f32>, along: vec3<f32>, lowest: vec3<f32>, highest: vec3<f32>) -> vec2<f32> {
    let low = lowest - start;
    let high = highest - start;
    // Parallel to two faces, a ray is between them all the way or never; in the plane of one the quotient would be 0/0.
    let parallel = along == vec3(0.0);
    let between = (low <= vec3(0.0)) & (high >= vec3(0.0));
    let to_low = select(low / along, select(vec3(1e30), vec3(-1e30), between), parallel);
    let to_high = select(high / along, select(vec3(-1e30), vec3(1e30), between), parallel);
    let entry = select(min(to_low, to_high), to_low, parallel);
    let leave = select(max(to_low, to_high), to_high, parallel);
    return vec2(max(entry.x, max(entry.y, entry.z)), min(leave.x, min(leave.y, leave.z)));
}

fn ray_through(eye: Eye, uv: vec2<f32>) -> Ray {
    let direction = eye.base.xyz + uv.x * eye.along_u.xyz + uv.y * eye.along_v.xyz;
    // Index space: the volume is the box from -0.5 to dims - 0.5.
    let start = index_of(eye.origin.xyz);
    let along = direction / frame.spacing.xyz;
    let inside = crossing(start, along, vec3(-0.5), frame.dims.xyz - 0.5);
    return Ray(
        direction,
        start,
        along,
        max(inside.x, eye.depth.z),
        min(inside.y, eye.depth.w),
        frame.spacing.w / length(direction),
    );
}
