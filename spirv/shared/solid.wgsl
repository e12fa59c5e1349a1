// Methods by brick, one workgroup a brick: which of its voxels need a value, those with opacity in their 3³. Found once for all of them,
// as bits in workgroup memory. Needs the binding `opacity`, `params.dims`, and TEAM, the invocations of a workgroup.

#include "shared/bricks.wgsl"

// Voxels of a brick.
const VOXELS = BRICK * BRICK * BRICK;
// Edge of a brick with the voxels around it.
const AROUND = BRICK + 2u;

// Bits x + 1 of the rows of voxels -1 ... BRICK that have opacity, y + 1 + AROUND (z + 1).
var<workgroup> rows: array<atomic<u32>, AROUND * AROUND>;

fn clear_rows(lane: u32) {
    for (var i = lane; i < AROUND * AROUND; i += TEAM) {
        atomicStore(&rows[i], 0u);
    }
}

// Of the brick that begins at a corner; behind clear_rows and a barrier.
fn mark_rows(corner: vec3<u32>, lane: u32) {
    for (var i = lane; i < AROUND * AROUND * AROUND; i += TEAM) {
        let place = vec3(i % AROUND, i / AROUND % AROUND, i / (AROUND * AROUND));
        // Beyond the low border it is a large number.
        let voxel = corner + place - 1u;
        if all(voxel < params.dims) && textureLoad(opacity, voxel, 0).r > 0.0 {
            atomicOr(&rows[i / AROUND], 1u << place.x);
        }
    }
}

// Both, with their barriers. Every invocation of the workgroup calls it.
fn find_solid(corner: vec3<u32>, lane: u32) {
    clear_rows(lane);
    workgroupBarrier();
    mark_rows(corner, lane);
    workgroupBarrier();
}

// Of a voxel at this place of the brick.
fn needed(local: vec3<u32>) -> bool {
    var bits = 0u;
    for (var z = 0u; z < 3u; z++) {
        for (var y = 0u; y < 3u; y++) {
            bits |= atomicLoad(&rows[local.y + y + AROUND * (local.z + z)]);
        }
    }
    return (bits >> local.x & 7u) != 0u;
}

// A voxel of a brick, x fastest.
fn inside(i: u32) -> vec3<u32> {
    return vec3(i, i / BRICK, i / (BRICK * BRICK)) % BRICK;
}
