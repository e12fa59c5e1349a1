// The features that V_AO is computed from, in a volume of its own: an update that spans frames goes on with them whatever the scene's become.
// Where one changed, its brick counts as changed (method.md section 5.2), though its opacity may not have.

struct LabelsParams {
    dims: vec3<u32>,
}

#include "shared/change.wgsl"
#include "shared/bricks.wgsl"

var<immediate> params: LabelsParams;
@group(0) @binding(0) var features: texture_3d<u32>;
@group(0) @binding(1) var labels: texture_storage_3d<r8uint, read_write>;
@group(0) @binding(2) var<storage, read_write> change: Change;

var<workgroup> different: atomic<u32>;

// One workgroup a brick; each invocation takes two slices.
@compute @workgroup_size(BRICK, BRICK, SLICES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = item_of_group(group);
    let bricks = bricks_of(params.dims);
    let there = index < brick_count(bricks);
    let corner = brick_at(index, bricks) * BRICK;
    if lane == 0u {
        atomicStore(&different, 0u);
    }
    workgroupBarrier();
    for (var slice = 0u; slice < BRICK; slice += SLICES) {
        let voxel = corner + local + vec3(0u, 0u, slice);
        if there && all(voxel < params.dims) {
            let now = textureLoad(features, voxel, 0).r;
            if textureLoad(labels, voxel).r != now {
                textureStore(labels, voxel, vec4(now, 0u, 0u, 0u));
                atomicStore(&different, 1u);
            }
        }
    }
    workgroupBarrier();
    if lane == 0u && there && atomicLoad(&different) != 0u {
        change.distance[index] = 0.0;
    }
}
