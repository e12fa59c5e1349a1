// Compaction: lists the bricks that have something to compute, so that nothing is dispatched for the others.
//
// ALL: every brick. NEEDED: bricks in which some voxel or a neighbour of one has opacity; no sample that has opacity
// interpolates any other voxel. CHANGED: bricks in which the clips changed a voxel's neighbourhood (category a or b,
// CAO section 3.3) now or at the last update; the latter go back to V_PAO.

struct BricksParams {
    dims: vec3<u32>,
    mode: u32,
    bricks: vec3<u32>,
}

struct ChangedBefore {
    flags: array<u32>,
}

#include "shared/categories.wgsl"
#include "shared/growing.wgsl"

// Modes.
const ALL = 0u;
const NEEDED = 1u;
const CHANGED = 2u;

// Voxels along the edge of a brick with its neighbours' nearest.
const AROUND = BRICK + 2u;

var<immediate> params: BricksParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
@group(0) @binding(1) var mask: texture_3d<u32>;
@group(0) @binding(2) var<storage, read_write> changed_before: ChangedBefore;
@group(0) @binding(3) var<storage, read_write> growing: GrowingList;

var<workgroup> found: atomic<u32>;

// One workgroup a brick.
@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = group.x + group.y * groups.x;
    let inside = index < brick_count(params.bricks);
    let brick = brick_at(index, params.bricks);
    if lane == 0u {
        atomicStore(&found, 0u);
    }
    workgroupBarrier();
    if inside && params.mode == NEEDED {
        let last = vec3<i32>(params.dims) - 1;
        for (var i = lane; i < AROUND * AROUND * AROUND; i += LANES) {
            let voxel = vec3<i32>(brick * BRICK) + vec3<i32>(brick_at(i, vec3(AROUND))) - 1;
            if all(voxel >= vec3(0)) && all(voxel <= last) && textureLoad(opacity, voxel, 0).r > 0.0 {
                atomicStore(&found, 1u);
                break;
            }
        }
    }
    if inside && params.mode == CHANGED {
        for (var i = lane; i < BRICK * BRICK * BRICK; i += LANES) {
            let voxel = brick * BRICK + brick_at(i, vec3(BRICK));
            if all(voxel < params.dims) && textureLoad(mask, voxel, 0).r != UNTOUCHED {
                atomicStore(&found, 1u);
                break;
            }
        }
    }
    workgroupBarrier();
    if lane == 0u && inside {
        let now = atomicLoad(&found);
        var listed = params.mode == ALL || now == 1u;
        if params.mode == CHANGED {
            listed = listed || changed_before.flags[index] == 1u;
            changed_before.flags[index] = now;
        }
        if listed {
            growing.items[places_for(1u)] = index;
        }
    }
}
