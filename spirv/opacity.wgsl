// Stage 1, opacity classification V -> V_o: the transfer function's opacity at every voxel.

struct OpacityParams {
    dims: vec3<u32>,
    // value = texel * scale + bias
    scale: f32,
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
    let value = textureLoad(volume, voxel, 0).r * params.scale + params.bias;
    textureStore(full_opacity, voxel, vec4(opacity_of(value), 0.0, 0.0, 0.0));
}
