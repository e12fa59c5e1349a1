// Exchanges the opacities of changed bricks with those that they had before (method.md section 5), for what they contributed
// then can be taken back only as it was made. Twice leaves everything as it was.

struct PastParams {
    dims: vec3<u32>,
}

// As carve.wgsl lays them out.
struct Past {
    opacities: array<u32>,
}

#include "shared/bricks.wgsl"

var<immediate> params: PastParams;
@group(0) @binding(0) var<storage, read> changed: BrickList;
@group(0) @binding(1) var<storage, read_write> past: Past;
@group(0) @binding(2) var opacity: texture_storage_3d<r16unorm, read_write>;

// One workgroup a brick; each invocation takes two slices.
@compute @workgroup_size(8, 8, 4)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let entry = group.x + group.y * GROUPS_PER_ROW;
    let at = entry * 256u + lane;
    if entry >= changed.count || at >= arrayLength(&past.opacities) {
        return;
    }
    let bricks = (params.dims + 7u) / 8u;
    let before = past.opacities[at];
    var now = 0u;
    for (var slice = 0u; slice < 2u; slice++) {
        let voxel = brick_at(changed.items[entry], bricks) * 8u + local + vec3(0u, 0u, 4u * slice);
        if all(voxel < params.dims) {
            now |= u32(round(textureLoad(opacity, voxel).r * 65535.0)) << (16u * slice);
            textureStore(opacity, voxel, vec4(f32(before >> (16u * slice) & 0xffffu) / 65535.0, 0.0, 0.0, 0.0));
        }
    }
    past.opacities[at] = now;
}
