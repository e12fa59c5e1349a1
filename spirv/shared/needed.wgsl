// The voxels of a brick that need a value: those that have opacity, or one of their 26 neighbours has (method.md section 1), gathered by a
// workgroup. Needs the bindings `opacity` and `ambient`, `params.dims` and `params.unneeded`, and bricks.wgsl.
//
// A workgroup calls clear_needed, mark_rows, gather, with a barrier behind each; then `found` of them are at place_of(0), place_of(1) ... in
// any order, and the others hold 1.

// Invocations of a workgroup.
const TEAM = 256u;
// Voxels of a brick.
const VOXELS = BRICK * BRICK * BRICK;
// Edge of a brick with the voxels around it.
const AROUND = BRICK + 2u;

// Bits x + 1 of the rows of voxels -1 ... BRICK that have opacity, y + 1 + AROUND (z + 1).
var<workgroup> rows: array<atomic<u32>, AROUND * AROUND>;
var<workgroup> found: atomic<u32>;
// Voxels that need a value, two a word.
var<workgroup> members: array<atomic<u32>, VOXELS / 2u>;

fn clear_needed(lane: u32) {
    for (var i = lane; i < AROUND * AROUND; i += TEAM) {
        atomicStore(&rows[i], 0u);
    }
    for (var i = lane; i < VOXELS / 2u; i += TEAM) {
        atomicStore(&members[i], 0u);
    }
    if lane == 0u {
        atomicStore(&found, 0u);
    }
}

// Of the brick whose first voxel is `corner`.
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

// Nothing of a brick that is not `listed`.
fn gather(corner: vec3<u32>, listed: bool, lane: u32) {
    for (var i = lane; i < VOXELS; i += TEAM) {
        let local = inside(i);
        if listed && all(corner + local < params.dims) {
            if params.unneeded == 1u || needed(local) {
                let slot = atomicAdd(&found, 1u);
                atomicOr(&members[slot >> 1u], i << ((slot & 1u) * 16u));
            } else {
                textureStore(ambient, corner + local, vec4(1.0, 0.0, 0.0, 0.0));
            }
        }
    }
}

// Of a voxel that needs a value, in its brick.
fn place_of(slot: u32) -> vec3<u32> {
    return inside(atomicLoad(&members[slot >> 1u]) >> ((slot & 1u) * 16u) & 0xffffu);
}
