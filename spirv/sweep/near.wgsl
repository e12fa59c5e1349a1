// Which bricks an edit concerns: those with voxels that need a value and within reach of a changed brick (method.md section 5).
//
// `spread` is one pass of a separable Euclidean distance transform over bricks, along one axis; the distance between two
// bricks is that of their nearest voxels. After three passes `choose` decides: bricks that have values are amended, others, or
// all where more changed than is kept, computed anew.

struct NearParams {
    bricks: vec3<u32>,
    axis: u32,
    // mm
    spacing: vec3<f32>,
    // how far a change of opacity reaches, mm
    reach: f32,
    // 1: voxels that no sample with opacity interpolates get a value too
    unneeded: u32,
    // 1: no value counts any more
    anew: u32,
    // bricks whose former opacity is kept
    capacity: u32,
}

struct Distance {
    squared: array<f32>,
}

// Bits of a squared distance that is farther than any volume reaches: what no brick is near to. After `choose` hosts fill with it.
const FAR = 0x7e000000u;

// What was chosen, in all.
struct Chosen {
    // bricks to do
    bricks: atomic<u32>,
    // least and greatest place x, y, z of the bricks to compute anew, then of those that changed
    low: array<atomic<u32>, 6>,
    high: array<atomic<u32>, 6>,
}

// Bricks that have values.
struct Valued {
    brick: array<u32>,
}

#include "shared/todo.wgsl"

var<immediate> params: NearParams;
@group(0) @binding(0) var<storage, read> before: Distance;
@group(0) @binding(1) var<storage, read_write> after: Distance;
@group(0) @binding(2) var<storage, read> contact: Contact;
@group(0) @binding(3) var<storage, read_write> todo: Todo;
@group(0) @binding(4) var<storage, read_write> chosen: Chosen;
@group(0) @binding(5) var<storage, read_write> solid: Solid;
@group(0) @binding(6) var<storage, read_write> valued: Valued;
@group(0) @binding(7) var<storage, read> changed: BrickList;

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
    // Bricks n apart have BRICK (n - 1) + 1 voxels' spacing between their nearest voxels.
    let most = i32(min(params.reach / (f32(BRICK) * edge) + 2.0, f32(size)));
    var least = before.squared[index];
    for (var there = max(here - most, 0); there <= min(here + most, size - 1); there++) {
        let gap = f32(max(i32(BRICK) * abs(there - here) - i32(BRICK - 1u), 0)) * edge;
        least = min(least, before.squared[first + u32(there) * stride] + gap * gap);
    }
    after.squared[index] = least;
}

fn bound(brick: vec3<u32>, first: u32) {
    for (var axis = 0u; axis < 3u; axis++) {
        atomicMin(&chosen.low[first + axis], brick[axis]);
        atomicMax(&chosen.high[first + axis], brick[axis]);
    }
}

// One invocation a brick.
@compute @workgroup_size(LANES)
fn choose(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = item_of(id, groups);
    if index >= brick_count(params.bricks) {
        return;
    }
    let own = brick_at(index, params.bricks);
    var bits = 0u;
    for (var n = 0u; n < 8u; n++) {
        let beside = vec3(n & 1u, n >> 1u & 1u, n >> 2u);
        let at = own + beside;
        if all(at < params.bricks) && contact.bits[brick_index(at, params.bricks)] != 0u {
            // Every subset of axes that contains this one's.
            for (var s = n; s < 8u; s++) {
                bits |= select(0u, 1u << s, (s & n) == n);
            }
        }
    }
    solid.bits[index] = bits;
    var needed = params.unneeded;
    // The brick's own opacity, or a neighbour's that touches it.
    for (var n = 0; n < 27; n++) {
        let place = vec3<i32>(own) + vec3(n % 3, n / 3 % 3, n / 9) - 1;
        if all(place >= vec3(0)) && all(place < vec3<i32>(params.bricks)) {
            needed |= contact.bits[brick_index(vec3<u32>(place), params.bricks)] >> u32(26 - n) & 1u;
        }
    }
    // Octants that changed, by carve.wgsl.
    var word = todo.brick[index] & ALL_CHANGED;
    if needed == 1u && before.squared[index] <= params.reach * params.reach {
        // A value that is not there, or opacities that are not, cannot be amended.
        let anew = params.anew == 1u || valued.brick[index] == 0u || changed.count > params.capacity;
        word |= select(TODO, TODO | ANEW, anew);
        atomicAdd(&chosen.bricks, 1u);
        if anew {
            bound(own, OF_ANEW);
        }
    }
    if (word & ALL_CHANGED) != 0u {
        bound(own, OF_CHANGED);
    }
    todo.brick[index] = word;
    valued.brick[index] = needed;
}
