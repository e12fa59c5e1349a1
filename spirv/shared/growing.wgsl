// A BrickList while invocations put bricks into it. Needs the binding `growing`.

#include "shared/bricks.wgsl"

struct GrowingList {
    groups_x: atomic<u32>,
    groups_y: atomic<u32>,
    groups_z: u32,
    count: atomic<u32>,
    items: array<u32>,
}

// Places for so many more items: the first of them.
fn places_for(count: u32) -> u32 {
    let first = atomicAdd(&growing.count, count);
    let through = groups_through(first + count - 1u);
    atomicMax(&growing.groups_x, through.x);
    atomicMax(&growing.groups_y, through.y);
    return first;
}

// Items of this workgroup, and where the list has them.
var<workgroup> joining: atomic<u32>;
var<workgroup> joined_at: u32;

// Puts in the items of the invocations of a workgroup that want it. All of them call it, once: the group asks for its places together, for
// thousands of requests to one address queue.
fn put_in(item: u32, wanted: bool, lane: u32) {
    if lane == 0u {
        atomicStore(&joining, 0u);
    }
    workgroupBarrier();
    var slot = 0u;
    if wanted {
        slot = atomicAdd(&joining, 1u);
    }
    workgroupBarrier();
    let count = atomicLoad(&joining);
    if lane == 0u && count > 0u {
        joined_at = places_for(count);
    }
    workgroupBarrier();
    if wanted {
        growing.items[joined_at + slot] = item;
    }
}
