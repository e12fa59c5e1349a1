// Between grids. `shrink` takes V_o to the grid of a network: of each of its voxels the mean of samples of V_o, one a voxel of V_o along each axis
// at least, as opacity per the reference length of the network. `halve` takes every second voxel of a tensor along each axis.

struct ResizeParams {
    // of what comes out
    dims: vec3<u32>,
    // voxels of all blocks that come out
    count: u32,
    // of `shrink`: a voxel of the grid in shares of the volume's edges
    voxel: vec3<f32>,
    // reference length of the network / reference length of V_o
    exponent: f32,
    // of `shrink`: samples along each axis
    samples: vec3<u32>,
    // first voxel to work on
    base: u32,
    // of `shrink`: where in the grid the volume begins
    before: vec3<i32>,
}

#include "shared/grid.wgsl"
#include "shared/tensors.wgsl"

var<immediate> params: ResizeParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
// linear, transparent outside the volume
@group(0) @binding(1) var field: sampler;
@group(0) @binding(2) var<storage, read_write> grid: Grid;
@group(0) @binding(3) var<storage, read> source: Tensor;
@group(0) @binding(4) var<storage, read_write> out: Tensor;

// Invocations of a workgroup.
const TEAM = 64u;

@compute @workgroup_size(TEAM)
fn shrink(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let i = params.base + group.x * TEAM + lane;
    if i >= params.count {
        return;
    }
    let lowest = vec3<f32>(vec3<i32>(place_at(i, params.dims)) - params.before) * params.voxel;
    let step = params.voxel / vec3<f32>(params.samples);
    var sum = 0.0;
    for (var z = 0u; z < params.samples.z; z++) {
        for (var y = 0u; y < params.samples.y; y++) {
            for (var x = 0u; x < params.samples.x; x++) {
                let at = lowest + (vec3<f32>(vec3(x, y, z)) + 0.5) * step;
                sum += textureSampleLevel(opacity, field, at, 0.0).r;
            }
        }
    }
    let mean = sum / f32(params.samples.x * params.samples.y * params.samples.z);
    grid.all[i] = 1.0 - pow(max(1.0 - mean, 0.0), params.exponent);
}

@compute @workgroup_size(TEAM)
fn halve(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let i = params.base + group.x * TEAM + lane;
    if i >= params.count {
        return;
    }
    let voxels = params.dims.x * params.dims.y * params.dims.z;
    let place = 2u * place_at(i % voxels, params.dims);
    out.all[i] = source.all[i / voxels * 8u * voxels + voxel_at(place, 2u * params.dims)];
}
