// Which bricks an edit concerns: those within reach of a changed brick that need values, or have some that nothing needs any more
// (method.md section 5).
//
// `spread` is one pass of a separable distance transform over bricks, along one axis; the distance between two bricks is that of their
// nearest voxels. Where a change reaches in a ball distances are Euclidean. Where it reaches in a box none has a length, and how many bricks
// are looked at along each axis says it all. After three passes `choose` decides, and lists the bricks to compute.

struct NearParams {
    bricks: vec3<u32>,
    axis: u32,
    // mm; 0 for a box
    spacing: vec3<f32>,
    // how far a change of opacity reaches, mm; 0 for a box
    reach: f32,
    // bricks to look at on each side
    most: vec3<u32>,
    // 1: voxels that no sample with opacity interpolates get a value too
    unneeded: u32,
}

struct Distance {
    squared: array<f32>,
}

// Bits of a squared distance that is farther than any volume reaches: what no brick is near to. After `choose` hosts fill with it.
const FAR = 0x7e000000u;

#include "shared/growing.wgsl"
#include "shared/todo.wgsl"

var<immediate> params: NearParams;
@group(0) @binding(0) var<storage, read> before: Distance;
@group(0) @binding(1) var<storage, read_write> after: Distance;
@group(0) @binding(2) var<storage, read> contact: Contact;
@group(0) @binding(3) var<storage, read_write> todo: Todo;
@group(0) @binding(4) var<storage, read_write> growing: GrowingList;

// One invocation a brick.
@compute @workgroup_size(LANES)
fn spread(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = item_of(id, groups);
    if index >= brick_count(params.bricks) {
        return;
    }
    let here = i32(brick_at(index, params.bricks)[params.axis]);
    let size = i32(params.bricks[params.axis]);
    let stride = vec3(1u, params.bricks.x, params.bricks.x * params.bricks.y)[params.axis];
    let edge = params.spacing[params.axis];
    let first = index - u32(here) * stride;
    let most = i32(params.most[params.axis]);
    // Bricks n apart have BRICK (n - 1) + 1 voxels' spacing between their nearest voxels.
    var least = before.squared[index];
    for (var there = max(here - most, 0); there <= min(here + most, size - 1); there++) {
        let gap = f32(max(i32(BRICK) * abs(there - here) - i32(BRICK - 1u), 0)) * edge;
        least = min(least, before.squared[first + u32(there) * stride] + gap * gap);
    }
    after.squared[index] = least;
}

// Whether a sample with opacity interpolates a value of a brick.
fn needed(index: u32) -> bool {
    let own = brick_at(index, params.bricks);
    var needed = params.unneeded;
    // The brick's own opacity, or a neighbour's that touches it.
    for (var n = 0; n < 27; n++) {
        let place = vec3<i32>(own) + vec3(n % 3, n / 3 % 3, n / 9) - 1;
        if all(place >= vec3(0)) && all(place < vec3<i32>(params.bricks)) {
            needed |= contact.bits[brick_index(vec3<u32>(place), params.bricks)] >> u32(26 - n) & 1u;
        }
    }
    return needed == 1u;
}

// One invocation a brick.
@compute @workgroup_size(LANES)
fn choose(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = item_of(id, groups);
    var chosen = false;
    if index < brick_count(params.bricks) {
        let needs = needed(index);
        let valued = (todo.brick[index] & VALUED) != 0u;
        let near = before.squared[index] <= params.reach * params.reach;
        // Where nothing needs its values any more they go back to 1.
        chosen = near && (needs || valued);
        let kept = select(valued, needs, near);
        todo.brick[index] = select(0u, TODO, chosen) | select(0u, VALUED, kept);
    }
    put_in(index, chosen, lane);
}
