// Opacities of one feature (fdAO eq. (6)), in a volume of their own: V_o,k = V_o where the voxel's feature is k, 0 elsewhere. Masked here, they are
// interpolated by the sampler like those of all matter. Only bricks in which opacities or features changed are written.
//
// `list_bricks` lists them; `main` writes those of one feature, and whether each brick holds any of its matter.

struct MaskParams {
    dims: vec3<u32>,
    // k
    feature: u32,
    // 1: every brick is listed
    all: u32,
}

#include "shared/change.wgsl"
#include "shared/growing.wgsl"
#include "shared/held.wgsl"

var<immediate> params: MaskParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
@group(0) @binding(1) var labels: texture_3d<u32>;
@group(0) @binding(2) var<storage, read> change: Change;
@group(0) @binding(3) var<storage, read_write> growing: GrowingList;
@group(0) @binding(4) var<storage, read> list: BrickList;
@group(0) @binding(5) var<storage, read_write> held: Held;
@group(0) @binding(6) var masked: texture_storage_3d<r16unorm, write>;

// One invocation a brick.
@compute @workgroup_size(LANES)
fn list_bricks(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = item_of(id, groups);
    var wanted = false;
    if index < brick_count(bricks_of(params.dims)) {
        wanted = params.all == 1u || change.distance[index] == 0.0;
    }
    put_in(index, wanted, lane);
}

var<workgroup> found: atomic<u32>;

// One workgroup a brick; each invocation takes two slices.
@compute @workgroup_size(BRICK, BRICK, SLICES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let entry = item_of_group(group);
    let listed = entry < list.count;
    let bricks = bricks_of(params.dims);
    let index = list.items[select(0u, entry, listed)];
    let corner = brick_at(index, bricks) * BRICK;
    if lane == 0u {
        atomicStore(&found, 0u);
    }
    workgroupBarrier();
    for (var slice = 0u; slice < BRICK; slice += SLICES) {
        let voxel = corner + local + vec3(0u, 0u, slice);
        if listed && all(voxel < params.dims) {
            let own = textureLoad(labels, voxel, 0).r == params.feature;
            let a = select(0.0, textureLoad(opacity, voxel, 0).r, own);
            textureStore(masked, voxel, vec4(a, 0.0, 0.0, 0.0));
            if a > 0.0 {
                atomicStore(&found, 1u);
            }
        }
    }
    workgroupBarrier();
    if lane == 0u && listed {
        held.bricks[(params.feature - 1u) * brick_count(bricks) + index] = atomicLoad(&found);
    }
}
