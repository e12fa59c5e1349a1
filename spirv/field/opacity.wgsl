// Stage 1, opacity classification V -> V_o: the transfer function's opacity at every voxel.

struct OpacityParams {
    dims: vec3<u32>,
    // value = stored * slope + bias; stored integers of a UNORM texel, 1: the texel is the stored value
    levels: f32,
    slope: f32,
    bias: f32,
}

#include "shared/transfer.wgsl"

var<immediate> params: OpacityParams;
@group(0) @binding(0) var volume: texture_3d<f32>;
@group(0) @binding(2) var full_opacity: texture_storage_3d<r32float, write>;

@compute @workgroup_size(8, 8, 4)
fn main(@builtin(global_invocation_id) voxel: vec3<u32>) {
    if any(voxel >= params.dims) {
        return;
    }
    // A UNORM texel is a rounded quotient; rounded back to the integer that the file holds, so that it falls on the right
    // side of a step of the transfer function.
    let texel = textureLoad(volume, voxel, 0).r;
    let value = select(texel, round(texel * params.levels), params.levels > 1.0) * params.slope + params.bias;
    textureStore(full_opacity, voxel, vec4(opacity_of(value), 0.0, 0.0, 0.0));
}
