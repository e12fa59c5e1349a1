// Opacity after features, and by their intervals which voxel is whose:
//
//   f(x) = the first k with low_k <= V(x) < high_k, else 0        V_f(x) = min(factor_f(x) TF_o(V(x)), 1)
//
// Voxels are classified first and interpolated then: between two features no value stands for a third.

struct FeaturesParams {
    dims: vec3<u32>,
    // value = stored * slope + bias; stored integers of a UNORM texel, 1: the texel is the stored value
    levels: f32,
    slope: f32,
    bias: f32,
}

#include "shared/features.wgsl"
#include "shared/transfer.wgsl"

var<immediate> params: FeaturesParams;
@group(0) @binding(0) var volume: texture_3d<f32>;
@group(0) @binding(2) var<uniform> features: Features;
@group(0) @binding(3) var feature_index: texture_3d<u32>;
@group(0) @binding(4) var found: texture_storage_3d<r8uint, write>;
@group(0) @binding(5) var classified: texture_storage_3d<r32float, write>;

fn value_of(voxel: vec3<u32>) -> f32 {
    // As in opacity.wgsl: a UNORM texel is rounded back to the integer that the file holds.
    let texel = textureLoad(volume, voxel, 0).r;
    return select(texel, round(texel * params.levels), params.levels > 1.0) * params.slope + params.bias;
}

// Which voxel is whose, by values.
@compute @workgroup_size(8, 8, 4)
fn by_intervals(@builtin(global_invocation_id) voxel: vec3<u32>) {
    if any(voxel >= params.dims) {
        return;
    }
    let value = value_of(voxel);
    var k = 1u;
    while k <= features.count && !(features.each[k].low <= value && value < features.each[k].high) {
        k++;
    }
    textureStore(found, voxel, vec4(select(k, 0u, k > features.count), 0u, 0u, 0u));
}

@compute @workgroup_size(8, 8, 4)
fn main(@builtin(global_invocation_id) voxel: vec3<u32>) {
    if any(voxel >= params.dims) {
        return;
    }
    let factor = features.each[textureLoad(feature_index, voxel, 0).r].factor;
    textureStore(classified, voxel, vec4(min(factor * opacity_of(value_of(voxel)), 1.0), 0.0, 0.0, 0.0));
}
