// What a frame does of a build that spans frames, and how it ends (method.md section 5.5). `choose`: how many bricks of the list are this
// slice's, and whether they are its last. `halves`, `fours` and `floats`: what was computed into a volume of its own becomes the one that is shown,
// brick by brick, after the last slice and never before; one for each format of V_AO.

struct CommitParams {
    dims: vec3<u32>,
    // entry of the list at which the slice begins
    first: u32,
    // bricks that it takes at most
    most: u32,
    // 1: every brick is new, not only those of the list
    all: u32,
}

// Arguments of two indirect dispatches.
struct Turn {
    slice_x: u32,
    slice_y: u32,
    slice_z: u32,
    commit_x: u32,
    commit_y: u32,
    commit_z: u32,
}

#include "shared/bricks.wgsl"

var<immediate> params: CommitParams;
@group(0) @binding(0) var<storage, read> list: BrickList;
@group(0) @binding(1) var<storage, read_write> turn: Turn;
@group(0) @binding(2) var made: texture_3d<f32>;
@group(0) @binding(3) var half_shown: texture_storage_3d<r16unorm, write>;
@group(0) @binding(4) var shown: texture_storage_3d<r32float, write>;
@group(0) @binding(5) var fours_shown: texture_storage_3d<rgba16unorm, write>;

fn groups_for(items: u32) -> vec2<u32> {
    return select(groups_through(max(items, 1u) - 1u), vec2(0u), items == 0u);
}

@compute @workgroup_size(1)
fn choose() {
    let left = list.count - min(params.first, list.count);
    let slice = groups_for(min(left, params.most));
    turn.slice_x = slice.x;
    turn.slice_y = slice.y;
    turn.slice_z = 1u;
    // Of an empty list the first slice is the last.
    let last = (left > 0u || params.first == 0u) && left <= params.most;
    let bricks = select(list.count, brick_count(bricks_of(params.dims)), params.all == 1u);
    let commit = groups_for(select(0u, bricks, last));
    turn.commit_x = commit.x;
    turn.commit_y = commit.y;
    turn.commit_z = 1u;
}

// The first voxel of a group's brick; beyond all where the group has none.
fn corner_of(group: vec3<u32>) -> vec3<u32> {
    let bricks = bricks_of(params.dims);
    var index = item_of_group(group);
    var there = index < brick_count(bricks);
    if params.all == 0u {
        there = index < list.count;
        index = list.items[select(0u, index, there)];
    }
    return select(params.dims, brick_at(index, bricks) * BRICK, there);
}

// One workgroup a brick; each invocation takes two slices.
@compute @workgroup_size(BRICK, BRICK, SLICES)
fn halves(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let corner = corner_of(group);
    for (var slice = 0u; slice < BRICK; slice += SLICES) {
        let voxel = corner + local + vec3(0u, 0u, slice);
        if all(voxel < params.dims) {
            textureStore(half_shown, voxel, vec4(textureLoad(made, voxel, 0).r, 0.0, 0.0, 0.0));
        }
    }
}

@compute @workgroup_size(BRICK, BRICK, SLICES)
fn fours(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let corner = corner_of(group);
    for (var slice = 0u; slice < BRICK; slice += SLICES) {
        let voxel = corner + local + vec3(0u, 0u, slice);
        if all(voxel < params.dims) {
            textureStore(fours_shown, voxel, textureLoad(made, voxel, 0));
        }
    }
}

@compute @workgroup_size(BRICK, BRICK, SLICES)
fn floats(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let corner = corner_of(group);
    for (var slice = 0u; slice < BRICK; slice += SLICES) {
        let voxel = corner + local + vec3(0u, 0u, slice);
        if all(voxel < params.dims) {
            textureStore(shown, voxel, vec4(textureLoad(made, voxel, 0).r, 0.0, 0.0, 0.0));
        }
    }
}
