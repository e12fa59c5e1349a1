// The box of the bricks that show something, from their distances: a brick shows something if it is 0 bricks away from one that does.

struct BoundsParams {
    bricks: vec3<u32>,
}

// Bounds while invocations stretch them.
struct GrowingBounds {
    from_first: array<atomic<u32>, 3>,
    to_last: array<atomic<u32>, 3>,
}

var<immediate> params: BoundsParams;
@group(0) @binding(0) var<storage, read> distances: Distances;
@group(0) @binding(1) var<storage, read_write> bounds: GrowingBounds;

#include "shared/bricks.wgsl"
#include "shared/distances.wgsl"

// One invocation a brick; the bounds are 0 before. Looking before asking for a change spares nearly all of them the queue for one address.
@compute @workgroup_size(LANES)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = item_of(id, groups);
    if index >= brick_count(params.bricks) || distance_in(distances.word[index]) > 0u {
        return;
    }
    let brick = brick_at(index, params.bricks);
    for (var axis = 0u; axis < 3u; axis++) {
        let from_first = params.bricks[axis] - brick[axis];
        if from_first > atomicLoad(&bounds.from_first[axis]) {
            atomicMax(&bounds.from_first[axis], from_first);
        }
        if brick[axis] + 1u > atomicLoad(&bounds.to_last[axis]) {
            atomicMax(&bounds.to_last[axis], brick[axis] + 1u);
        }
    }
}
