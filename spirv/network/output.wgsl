// From the grid of a network to V_AO: the values around the middle of each voxel that needs one, interpolated. One workgroup a brick of the list.

struct OutputParams {
    dims: vec3<u32>,
    // first entry of the list to work on
    base: u32,
    bricks: vec3<u32>,
    // 1: every voxel gets a value
    unneeded: u32,
    // voxels of the grid
    grid: vec3<u32>,
    pad: u32,
    // of these, before the volume begins
    before: vec3<u32>,
    pad_too: u32,
    // a voxel in voxels of the grid
    voxel: vec3<f32>,
}

#include "shared/grid.wgsl"
#include "shared/listed.wgsl"

var<immediate> params: OutputParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
@group(0) @binding(1) var<storage, read> values: Grid;
@group(0) @binding(2) var<storage, read> list: BrickList;
@group(0) @binding(3) var ambient: texture_storage_3d<r16unorm, write>;

// Invocations of a workgroup.
const TEAM = 128u;

fn row(x: vec2<u32>, y: u32, z: u32, t: f32) -> f32 {
    let begin = (z * params.grid.y + y) * params.grid.x;
    return mix(values.all[begin + x.x], values.all[begin + x.y], t);
}

fn value_of(voxel: vec3<u32>) -> f32 {
    let last = params.grid - 1u;
    let middle = (vec3<f32>(voxel) + 0.5) * params.voxel + vec3<f32>(params.before) - 0.5;
    let at = clamp(middle, vec3(0.0), vec3<f32>(last));
    let low = vec3<u32>(at);
    let high = min(low + 1u, last);
    let t = at - vec3<f32>(low);
    let x = vec2(low.x, high.x);
    let below = mix(row(x, low.y, low.z, t.x), row(x, high.y, low.z, t.x), t.y);
    let above = mix(row(x, low.y, high.z, t.x), row(x, high.y, high.z, t.x), t.y);
    return mix(below, above, t.z);
}

@compute @workgroup_size(TEAM)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let brick = listed_brick(group, lane);
    for (var i = lane; i < VOXELS; i += TEAM) {
        let voxel = brick.xyz + inside(i);
        if brick.w == 1u && all(voxel < params.dims) {
            var value = 1.0;
            if params.unneeded == 1u || needed(inside(i)) {
                value = value_of(voxel);
            }
            textureStore(ambient, voxel, vec4(value, 0.0, 0.0, 0.0));
        }
    }
}
