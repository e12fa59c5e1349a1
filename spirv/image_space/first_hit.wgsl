// What pixels show of a picture that has depths only, a volume's: view depths, and normals from differences of neighbours' positions.
// `cao_twin::image_space::first_hit` has the equations.
//
// In: `depth` by the views' planes, a layer a view, the eyes. Out: `geometry`, one write a pixel. Cost: five depths a pixel.

struct FirstHitParams {
    size: vec2<u32>,
}

#include "shared/geometry.wgsl"

var<immediate> params: FirstHitParams;
@group(0) @binding(0) var depth: texture_2d_array<f32>;
@group(0) @binding(1) var<uniform> eyes: Eyes;
@group(0) @binding(2) var<storage, read_write> geometry: Geometry;

// Position of what a pixel shows, and its view depth, 0 where it shows nothing or lies outside.
fn point_at(view: u32, pixel: vec2<i32>) -> vec4<f32> {
    if any(pixel < vec2(0)) || any(pixel >= vec2<i32>(params.size)) {
        return vec4(0.0);
    }
    let eye = eyes.eye[view];
    let shown = textureLoad(depth, pixel, view, 0).r;
    // Reversed depths fall.
    let reversed = eye.depth.y > 0.0;
    if select(shown >= 1.0, shown <= 0.0, reversed) {
        return vec4(0.0);
    }
    let t = eye.depth.y / (shown - eye.depth.x);
    return vec4(position_of(eye, params.size, vec2<u32>(pixel), t), t);
}

// The surface's change to the next pixel: of the differences to the two neighbours the shorter one, for the other may cross an edge. 0 where neither
// neighbour shows anything.
fn along(view: u32, here: vec3<f32>, pixel: vec2<i32>, step: vec2<i32>) -> vec3<f32> {
    let ahead = point_at(view, pixel + step);
    let behind = point_at(view, pixel - step);
    let forward = ahead.xyz - here;
    let backward = here - behind.xyz;
    let take_forward = behind.w == 0.0 || (ahead.w != 0.0 && length(forward) <= length(backward));
    return select(backward, forward, take_forward) * f32(ahead.w != 0.0 || behind.w != 0.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let pixel = vec2<i32>(id.xy);
    let index = pixel_index(params.size, id.z, id.xy);
    let here = point_at(id.z, pixel);
    if here.w == 0.0 {
        geometry.pixel[index] = vec4(0.0);
        return;
    }
    let across = cross(along(id.z, here.xyz, pixel, vec2(1, 0)), along(id.z, here.xyz, pixel, vec2(0, 1)));
    let away = here.xyz - eyes.eye[id.z].origin.xyz;
    let steepness = length(across);
    // What has no neighbours faces the eye.
    let normal = select(-normalize(away), across / max(steepness, 1e-30), steepness > 0.0);
    geometry.pixel[index] = vec4(select(normal, -normal, dot(normal, away) > 0.0), here.w);
}
