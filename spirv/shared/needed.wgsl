// The voxels of a brick that need a value: those that have opacity, or one of their 26 neighbours has (method.md section 1), gathered by a
// workgroup. Needs the bindings `opacity` and `ambient`, `params.dims` and `params.unneeded`, and bricks.wgsl.
//
// A workgroup calls clear_needed, mark_rows, gather, with a barrier behind each; then `found` of them are at place_of(0), place_of(1) ... in
// any order, and the others hold 1.

#include "shared/solid.wgsl"

// Invocations of a workgroup.
const TEAM = 256u;

var<workgroup> found: atomic<u32>;
// Voxels that need a value, two a word.
var<workgroup> members: array<atomic<u32>, VOXELS / 2u>;

fn clear_needed(lane: u32) {
    clear_rows(lane);
    for (var i = lane; i < VOXELS / 2u; i += TEAM) {
        atomicStore(&members[i], 0u);
    }
    if lane == 0u {
        atomicStore(&found, 0u);
    }
}

// Finds voxel i of a brick if it needs a value; whether there is one that needs none.
fn spares(corner: vec3<u32>, i: u32) -> bool {
    let local = inside(i);
    if any(corner + local >= params.dims) {
        return false;
    }
    if params.unneeded == 1u || needed(local) {
        let slot = atomicAdd(&found, 1u);
        atomicOr(&members[slot >> 1u], i << ((slot & 1u) * 16u));
        return false;
    }
    return true;
}

// Nothing of a brick that is not `listed`.
fn gather(corner: vec3<u32>, listed: bool, lane: u32) {
    for (var i = lane; i < VOXELS; i += TEAM) {
        if listed && spares(corner, i) {
            textureStore(ambient, corner + inside(i), vec4(1.0, 0.0, 0.0, 0.0));
        }
    }
}

// Of a voxel that needs a value, in its brick.
fn place_of(slot: u32) -> vec3<u32> {
    return inside(atomicLoad(&members[slot >> 1u]) >> ((slot & 1u) * 16u) & 0xffffu);
}
