// How far a ray may leap: for each brick of 8x8x8 voxels the Chebyshev distance in bricks to the nearest one that can show
// something, so that every brick nearer than that shows nothing. In three passes, along x, y and z in turn, for
// max(|dx|, |dy|, |dz|) is least where it is least along one axis after the other:
//   d_x(b) = min |dx| over bricks that show something,  d_y(b) = min max(|dy|, d_x),  d_z(b) = min max(|dz|, d_y).
//
// A word holds two distances of 12 bits, to the nearest brick with opacity and to the nearest that is not wholly hidden by
// the clips either, and a bit for each clip that may hide some of it.

struct BrickDistanceParams {
    bricks: vec3<u32>,
    // of `next`: 1 y, 2 z
    axis: u32,
}

struct Occupancy {
    visible: array<u32>,
}

struct Distances {
    word: array<u32>,
}

const FAR = 0xfffu;

var<immediate> params: BrickDistanceParams;
@group(0) @binding(0) var<storage, read> occupancy: Occupancy;
@group(0) @binding(1) var<storage, read> clip_bricks: ClipBricks;
@group(0) @binding(2) var<storage, read> before: Distances;
@group(0) @binding(3) var<storage, read_write> distances: Distances;

#include "shared/clip_codes.wgsl"

fn brick_of(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.x + id.y * groups.x * 64u;
}

fn count() -> u32 {
    return params.bricks.x * params.bricks.y * params.bricks.z;
}

// Whether the clips hide all that a ray reads in a brick, and which may hide some. To a ray a brick reaches from voxel centre 8b
// to 8b + 8, half a voxel into those above it, whose boxes hold whole voxels.
fn to_rays(index: u32) -> vec2<u32> {
    let brick = vec3(index % params.bricks.x, index / params.bricks.x % params.bricks.y, index / (params.bricks.x * params.bricks.y));
    var hidden = 1u;
    var asked = 0u;
    for (var i = 0u; i < 8u; i++) {
        let at = min(brick + vec3(i & 1u, i >> 1u & 1u, i >> 2u), params.bricks - 1u);
        let code = clip_bricks.code[(at.z * params.bricks.y + at.y) * params.bricks.x + at.x];
        let whole = (code & 3u) == HIDDEN;
        hidden &= u32(whole);
        // Who hides it whole the code does not say.
        asked |= select(code >> 4u & 0xffu, 0xffu, whole);
    }
    return vec2(hidden, asked);
}

fn first_of(index: u32) -> vec2<u32> {
    if occupancy.visible[index] == 0u {
        return vec2(FAR);
    }
    return vec2(0u, select(0u, FAR, to_rays(index).x == 1u));
}

fn distances_of(word: u32) -> vec2<u32> {
    return vec2(word & FAR, word >> 12u & FAR);
}

fn word_of(distance: vec2<u32>, asked: u32) -> u32 {
    return distance.x | distance.y << 12u | asked << 24u;
}

// One invocation a brick.
@compute @workgroup_size(64)
fn first(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = brick_of(id, groups);
    if index >= count() {
        return;
    }
    let x = index % params.bricks.x;
    var nearest = vec2(FAR);
    for (var d = 0u; d < params.bricks.x && any(vec2(d) < nearest); d++) {
        if d <= x {
            nearest = min(nearest, max(first_of(index - d), vec2(d)));
        }
        if x + d < params.bricks.x {
            nearest = min(nearest, max(first_of(index + d), vec2(d)));
        }
    }
    distances.word[index] = word_of(nearest, to_rays(index).y);
}

@compute @workgroup_size(64)
fn next(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = brick_of(id, groups);
    if index >= count() {
        return;
    }
    let along_y = params.axis == 1u;
    let stride = select(params.bricks.x * params.bricks.y, params.bricks.x, along_y);
    let length = select(params.bricks.z, params.bricks.y, along_y);
    let place = index / stride % length;
    var nearest = vec2(FAR);
    for (var d = 0u; d < length && any(vec2(d) < nearest); d++) {
        if d <= place {
            nearest = min(nearest, max(distances_of(before.word[index - d * stride]), vec2(d)));
        }
        if place + d < length {
            nearest = min(nearest, max(distances_of(before.word[index + d * stride]), vec2(d)));
        }
    }
    distances.word[index] = word_of(nearest, before.word[index] >> 24u);
}
