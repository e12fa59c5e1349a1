// Filters of accessibility: the mean of 4 × 4 pixels that Crytek's mirrors ask for, and the joint bilateral filter along a row or a column that
// takes HBAO's noise out. `cao_twin::image_space::blur` has the equations.
//
// In: normals and depths, the eyes, values of pixels. Out: `accessibility`, one write a pixel. Cost: 16 values a pixel; 2 reach + 1 values and
// texels of the geometry.

struct BlurParams {
    size: vec2<u32>,
    // bilateral: from one pixel to the next
    step: vec2<i32>,
    // bilateral: pixels to each side
    reach: i32,
    // bilateral: standard deviation of the distance to the pixel's tangent plane, mm
    thickness: f32,
}

#include "shared/seen.wgsl"

var<immediate> params: BlurParams;
@group(0) @binding(0) var<storage, read> geometry: Geometry;
@group(0) @binding(1) var<uniform> eyes: Eyes;
@group(0) @binding(2) var<storage, read> unfiltered: Accessibility;
@group(0) @binding(3) var<storage, read_write> accessibility: Accessibility;

fn inside(pixel: vec2<i32>) -> bool {
    return all(pixel >= vec2(0)) && all(pixel < vec2<i32>(params.size));
}

@compute @workgroup_size(8, 8)
fn square(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let index = pixel_index(params.size, id.z, id.xy);
    if geometry.pixel[index].w <= 0.0 {
        accessibility.pixel[index] = 1.0;
        return;
    }
    var sum = 0.0;
    var count = 0.0;
    for (var i = 0; i < 16; i++) {
        let pixel = vec2<i32>(id.xy) + vec2(i % 4, i / 4) - 2;
        if inside(pixel) {
            sum += unfiltered.pixel[pixel_index(params.size, id.z, vec2<u32>(pixel))];
            count += 1.0;
        }
    }
    accessibility.pixel[index] = sum / count;
}

@compute @workgroup_size(8, 8)
fn bilateral(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let index = pixel_index(params.size, id.z, id.xy);
    let here = geometry.pixel[index];
    if here.w <= 0.0 {
        accessibility.pixel[index] = 1.0;
        return;
    }
    let eye = eyes.eye[id.z];
    let position = position_of(eye, params.size, id.xy, here.w);
    // A deviation of half of the reach.
    let nearness = -2.0 / max(f32(params.reach * params.reach), 1.0);
    let flatness = -0.5 / (params.thickness * params.thickness);
    // The pixel itself.
    var sum = unfiltered.pixel[index];
    var weights = 1.0;
    for (var i = -params.reach; i <= params.reach; i++) {
        let pixel = vec2<i32>(id.xy) + i * params.step;
        if i == 0 || !inside(pixel) {
            continue;
        }
        let other = pixel_index(params.size, id.z, vec2<u32>(pixel));
        let there = geometry.pixel[other];
        if there.w <= 0.0 {
            continue;
        }
        let off = dot(here.xyz, position_of(eye, params.size, vec2<u32>(pixel), there.w) - position);
        let alike = max(dot(here.xyz, there.xyz), 0.0);
        let squared = alike * alike;
        let fourth = squared * squared;
        let weight = exp(nearness * f32(i * i) + flatness * off * off) * fourth * fourth;
        sum += weight * unfiltered.pixel[other];
        weights += weight;
    }
    accessibility.pixel[index] = sum / weights;
}
