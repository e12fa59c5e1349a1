// Bricks of voxels: their places, and compacted lists of them.

// Voxels along the edge of a brick.
const BRICK = 8u;
// Slices of a brick that a workgroup of half a brick takes at once.
const SLICES = BRICK / 2u;

// Invocations of a workgroup that takes an item each.
const LANES = 64u;

// Largest group count along one axis that every device has.
const GROUPS_PER_ROW = 65535u;

// A list of bricks; its head is the argument of an indirect dispatch.
struct BrickList {
    groups_x: u32,
    groups_y: u32,
    groups_z: u32,
    count: u32,
    items: array<u32>,
}

fn bricks_of(dims: vec3<u32>) -> vec3<u32> {
    return (dims + (BRICK - 1u)) / BRICK;
}

fn brick_count(bricks: vec3<u32>) -> u32 {
    return bricks.x * bricks.y * bricks.z;
}

fn brick_index(brick: vec3<u32>, bricks: vec3<u32>) -> u32 {
    return (brick.z * bricks.y + brick.y) * bricks.x + brick.x;
}

fn brick_at(index: u32, bricks: vec3<u32>) -> vec3<u32> {
    return vec3(index % bricks.x, index / bricks.x % bricks.y, index / (bricks.x * bricks.y));
}

// Groups x, y of a dispatch that reaches the item in a slot.
fn groups_through(slot: u32) -> vec2<u32> {
    return vec2(min(slot + 1u, GROUPS_PER_ROW), slot / GROUPS_PER_ROW + 1u);
}

// The item of a group in such a dispatch, where each takes one.
fn item_of_group(group: vec3<u32>) -> u32 {
    return group.x + group.y * GROUPS_PER_ROW;
}

// The item of an invocation in a dispatch of whole rows of groups of LANES, where each takes one.
fn item_of(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.x + id.y * groups.x * LANES;
}
