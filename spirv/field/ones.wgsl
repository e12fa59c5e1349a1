// Ones in every voxel: an ambient volume in which nothing is occluded. The transfer command that clears an image does the same, slowly
// for 3D images on some GPUs (docs/drivers.md).

struct OnesParams {
    dims: vec3<u32>,
}

#include "shared/bricks.wgsl"

var<immediate> params: OnesParams;
@group(0) @binding(0) var halves_out: texture_storage_3d<r16unorm, write>;
@group(0) @binding(1) var floats_out: texture_storage_3d<r32float, write>;
@group(0) @binding(2) var fours_out: texture_storage_3d<rgba16unorm, write>;

// The first voxel of a group's brick; beyond all where the group has none.
fn corner_of(group: vec3<u32>) -> vec3<u32> {
    let bricks = bricks_of(params.dims);
    let index = item_of_group(group);
    return select(params.dims, brick_at(index, bricks) * BRICK, index < brick_count(bricks));
}

// One workgroup a brick; each invocation takes two slices.
@compute @workgroup_size(BRICK, BRICK, SLICES)
fn halves(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let corner = corner_of(group);
    for (var slice = 0u; slice < BRICK; slice += SLICES) {
        let voxel = corner + local + vec3(0u, 0u, slice);
        if all(voxel < params.dims) {
            textureStore(halves_out, voxel, vec4(1.0, 0.0, 0.0, 0.0));
        }
    }
}

@compute @workgroup_size(BRICK, BRICK, SLICES)
fn floats(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let corner = corner_of(group);
    for (var slice = 0u; slice < BRICK; slice += SLICES) {
        let voxel = corner + local + vec3(0u, 0u, slice);
        if all(voxel < params.dims) {
            textureStore(floats_out, voxel, vec4(1.0, 0.0, 0.0, 0.0));
        }
    }
}

@compute @workgroup_size(BRICK, BRICK, SLICES)
fn fours(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let corner = corner_of(group);
    for (var slice = 0u; slice < BRICK; slice += SLICES) {
        let voxel = corner + local + vec3(0u, 0u, slice);
        if all(voxel < params.dims) {
            textureStore(fours_out, voxel, vec4(1.0));
        }
    }
}
