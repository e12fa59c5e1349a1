// A workgroup's brick of a list, and which of its voxels need a value. Needs what solid.wgsl needs, the binding `list` and `params.base`,
// `params.bricks`.

#include "shared/solid.wgsl"

// Its lowest voxel, and 1 where there is such a brick. Every invocation of the workgroup calls it.
fn listed_brick(group: vec3<u32>, lane: u32) -> vec4<u32> {
    let entry = params.base + item_of_group(group);
    let listed = entry < list.count;
    let corner = brick_at(list.items[select(0u, entry, listed)], params.bricks) * BRICK;
    find_solid(corner, lane);
    return vec4(corner, u32(listed));
}
