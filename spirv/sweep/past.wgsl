// Exchanges the opacities of changed bricks with those that they had before (method.md section 5), for what they contributed
// then can be taken back only as it was made. Twice leaves everything as it was.

struct PastParams {
    dims: vec3<u32>,
}

#include "shared/past.wgsl"

var<immediate> params: PastParams;
@group(0) @binding(0) var<storage, read> changed: BrickList;
@group(0) @binding(1) var<storage, read_write> past: Past;
@group(0) @binding(2) var opacity: texture_storage_3d<r16unorm, read_write>;

// One workgroup a brick; each invocation takes two slices.
@compute @workgroup_size(BRICK, BRICK, SLICES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let entry = item_of_group(group);
    let at = entry * PAST_WORDS + lane;
    if entry >= changed.count || at >= arrayLength(&past.opacities) {
        return;
    }
    let bricks = bricks_of(params.dims);
    let before = past.opacities[at];
    var now = 0u;
    for (var slice = 0u; slice < BRICK / SLICES; slice++) {
        let voxel = brick_at(changed.items[entry], bricks) * BRICK + local + vec3(0u, 0u, SLICES * slice);
        if all(voxel < params.dims) {
            now |= u32(round(textureLoad(opacity, voxel).r * PARTS)) << (PAST_BITS * slice);
            textureStore(opacity, voxel, vec4(f32(before >> (PAST_BITS * slice) & PAST_MASK) / PARTS, 0.0, 0.0, 0.0));
        }
    }
    past.opacities[at] = now;
}
