#include "shared/parts.wgsl"

struct Look {
    tint: vec3<f32>,
}

var<immediate> look: Look;
@group(0) @binding(0) var<storage, read> corners: array<Inner>;
@group(0) @binding(1) var before: texture_2d<f32>;

@vertex
fn corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4(corners[index].direction, 1.0);
}

@fragment
fn shade(@builtin(position) place: vec4<f32>) -> @location(0) vec4<f32> {
    return textureLoad(before, vec2<i32>(place.xy), 0) * vec4(look.tint, 1.0);
}
