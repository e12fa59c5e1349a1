// What is known of each brick, x fastest.

#include "shared/bricks.wgsl"

// Not 0 where it can show something, whatever the clips hide; bits.
const SHOWS = 1u;
// Some of it clips leave whole.
const SPARED = 2u;

struct Occupancy {
    visible: array<u32>,
}

// Where its opacity lies: bit (dx+1) + 3 (dy+1) + 9 (dz+1) is set if a voxel with opacity touches the neighbour brick at
// (dx, dy, dz), and bit 13 if any voxel has opacity.
struct Contact {
    bits: array<u32>,
}

// What is to be done in it, and whether it has values: bits of todo.wgsl.
struct Todo {
    brick: array<u32>,
}
