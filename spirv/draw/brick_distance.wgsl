// How far a ray may leap: for each brick the Chebyshev distance in bricks to the nearest one that can show
// something, so that every brick nearer than that shows nothing. In three passes, along x, y and z in turn, for
// max(|dx|, |dy|, |dz|) is least where it is least along one axis after the other:
//   d_x(b) = min |dx| over bricks that show something,  d_y(b) = min max(|dy|, d_x),  d_z(b) = min max(|dz|, d_y).

struct BrickDistanceParams {
    bricks: vec3<u32>,
    // of `next`: 1 y, 2 z
    axis: u32,
}

var<immediate> params: BrickDistanceParams;
@group(0) @binding(0) var<storage, read> occupancy: Occupancy;
@group(0) @binding(1) var<storage, read> clip_bricks: ClipBricks;
@group(0) @binding(2) var<storage, read> before: Distances;
@group(0) @binding(3) var<storage, read_write> distances: Distances;

#include "shared/clip_codes.wgsl"
#include "shared/distances.wgsl"
#include "shared/words.wgsl"

// Whether the clips hide all that a ray reads in a brick, and which may hide some. To a ray brick b reaches from voxel centre BRICK b
// to BRICK (b + 1), half a voxel into those above it, whose boxes hold whole voxels.
fn to_rays(index: u32) -> vec2<u32> {
    let brick = brick_at(index, params.bricks);
    var hidden = 1u;
    var asked = 0u;
    for (var i = 0u; i < 8u; i++) {
        let at = min(brick + vec3(i & 1u, i >> 1u & 1u, i >> 2u), params.bricks - 1u);
        let code = clip_bricks.code[brick_index(at, params.bricks)];
        let whole = visibility_in(code) == HIDDEN;
        hidden &= u32(whole);
        // Who hides it whole the code does not say.
        asked |= select(cutting_in(code), ALL_CLIPS, whole);
    }
    return vec2(hidden, asked);
}

fn first_of(index: u32) -> u32 {
    let shows = occupancy.visible[index];
    return select(FAR, 0u, shows != 0u && ((shows & SPARED) != 0u || to_rays(index).x == 0u));
}

// One invocation a brick.
@compute @workgroup_size(LANES)
fn first(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = item_of(id, groups);
    if index >= brick_count(params.bricks) {
        return;
    }
    let x = index % params.bricks.x;
    var nearest = FAR;
    for (var d = 0u; d < params.bricks.x && d < nearest; d++) {
        if d <= x {
            nearest = min(nearest, max(first_of(index - d), d));
        }
        if x + d < params.bricks.x {
            nearest = min(nearest, max(first_of(index + d), d));
        }
    }
    distances.word[index] = word_of(nearest, to_rays(index).y);
}

@compute @workgroup_size(LANES)
fn next(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = item_of(id, groups);
    if index >= brick_count(params.bricks) {
        return;
    }
    let along_y = params.axis == 1u;
    let stride = select(params.bricks.x * params.bricks.y, params.bricks.x, along_y);
    let length = select(params.bricks.z, params.bricks.y, along_y);
    let place = index / stride % length;
    var nearest = FAR;
    for (var d = 0u; d < length && d < nearest; d++) {
        if d <= place {
            nearest = min(nearest, max(distance_in(before.word[index - d * stride]), d));
        }
        if place + d < length {
            nearest = min(nearest, max(distance_in(before.word[index + d * stride]), d));
        }
    }
    distances.word[index] = word_of(nearest, asked_in(before.word[index]));
}
