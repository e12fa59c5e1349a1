// A BrickList while invocations put bricks into it.

#include "shared/bricks.wgsl"

struct GrowingList {
    groups_x: atomic<u32>,
    groups_y: atomic<u32>,
    groups_z: u32,
    count: atomic<u32>,
    items: array<u32>,
}
