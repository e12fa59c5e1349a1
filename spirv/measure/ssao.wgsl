// Image-space ambient occlusion, the baseline that data-space values are compared with: it knows only what one eye's depth
// image shows. At each pixel a hemisphere of K points within R around the surface, rotated by a hash of the pixel; a point is
// hidden where the surface at its pixel is nearer (cpu/ssao.rs has the sum).

struct SsaoParams {
    // field of view: left, right, up, down, as tangents
    tan: vec4<f32>,
    // mm
    near: f32,
    far: f32,
    radius: f32,
    bias: f32,
    size: vec2<u32>,
    samples: u32,
}

struct Occlusion {
    // one value a pixel, rows from the top
    factor: array<f32>,
}

var<immediate> params: SsaoParams;
// one layer: one eye
@group(0) @binding(0) var depth: texture_depth_2d;
@group(0) @binding(1) var<storage, read_write> occlusion: Occlusion;

#include "shared/hash.wgsl"

// Uniform in [0, 1) of an integer.
fn hash(value: u32) -> f32 {
    return f32(scrambled(value) >> 8u) / 16777216.0;
}

const TAU = 6.28318530718;

// What a pixel shows, in the eye's frame in mm, looking down -z; w is 0 where it shows nothing.
fn point_at(pixel: vec2<i32>) -> vec4<f32> {
    if any(pixel < vec2(0)) || any(pixel >= vec2<i32>(params.size)) {
        return vec4(0.0);
    }
    let d = textureLoad(depth, pixel, 0);
    if d >= 1.0 {
        return vec4(0.0);
    }
    let uv = (vec2<f32>(pixel) + 0.5) / vec2<f32>(params.size);
    let distance = params.near * params.far / (params.far - d * (params.far - params.near));
    let x = params.tan.x + (params.tan.y - params.tan.x) * uv.x;
    let y = params.tan.z + (params.tan.w - params.tan.z) * uv.y;
    return vec4(vec3(x, y, -1.0) * distance, 1.0);
}

// The surface's change to the next pixel: of the differences to the two neighbours the shorter one, for the other may cross
// an edge. w is 0 where neither neighbour shows anything.
fn along(point: vec3<f32>, pixel: vec2<i32>, step: vec2<i32>) -> vec4<f32> {
    let ahead = point_at(pixel + step);
    let behind = point_at(pixel - step);
    let forward = ahead.xyz - point;
    let backward = point - behind.xyz;
    if ahead.w == 0.0 && behind.w == 0.0 {
        return vec4(0.0);
    }
    let take_forward = behind.w == 0.0 || (ahead.w != 0.0 && length(forward) <= length(backward));
    return vec4(select(backward, forward, take_forward), 1.0);
}

// Points of the unit hemisphere around +z, denser towards its centre.
fn hemisphere(i: u32) -> vec3<f32> {
    let height = hash(3u * i + 0x9e3779b9u);
    let angle = hash(3u * i + 1u + 0x9e3779b9u) * TAU;
    let scale = hash(3u * i + 2u + 0x9e3779b9u);
    let ring = sqrt(1.0 - height * height);
    let share = f32(i) / f32(params.samples);
    return vec3(ring * cos(angle), ring * sin(angle), height) * scale * (0.1 + 0.9 * share * share);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let pixel = vec2<i32>(id.xy);
    let index = id.y * params.size.x + id.x;
    let here = point_at(pixel);
    let right = along(here.xyz, pixel, vec2(1, 0));
    let down = along(here.xyz, pixel, vec2(0, 1));
    if here.w == 0.0 || right.w == 0.0 || down.w == 0.0 {
        occlusion.factor[index] = 1.0;
        return;
    }
    let across = cross(down.xyz, right.xyz);
    let steepness = length(across);
    let normal = select(vec3(0.0, 0.0, 1.0), across / steepness, steepness > 0.0);
    // Any direction in the surface (Duff et al. 2017), turned by the pixel's hash.
    let sign = select(-1.0, 1.0, normal.z >= 0.0);
    let a = -1.0 / (sign + normal.z);
    let around = vec3(normal.x * normal.y * a, sign + normal.y * normal.y * a, -normal.y);
    let angle = hash(index) * TAU;
    let tangent = around * cos(angle) + cross(normal, around) * sin(angle);
    let bitangent = cross(normal, tangent);

    var hidden = 0.0;
    for (var i = 0u; i < params.samples; i++) {
        let k = hemisphere(i);
        let sample = here.xyz + (tangent * k.x + bitangent * k.y + normal * k.z) * params.radius;
        if sample.z >= 0.0 {
            continue;
        }
        let tangents = sample.xy / -sample.z;
        let uv = (tangents - params.tan.xz) / (params.tan.yw - params.tan.xz);
        let surface = point_at(vec2<i32>(floor(uv * vec2<f32>(params.size))));
        if surface.w == 0.0 || surface.z < sample.z + params.bias {
            continue;
        }
        let range = params.radius / max(abs(here.z - surface.z), params.radius);
        hidden += range * range * (3.0 - 2.0 * range);
    }
    occlusion.factor[index] = 1.0 - hidden / f32(max(params.samples, 1u));
}
