// Compacted list of bricks of 8x8x8 voxels; its head is the argument of an indirect dispatch.

struct BrickList {
    groups_x: u32,
    groups_y: u32,
    groups_z: u32,
    count: u32,
    items: array<u32>,
}

// Largest group count along one axis that every device has.
const GROUPS_PER_ROW = 65535u;

// What is said of a brick: its values are to be computed or amended; anew, whatever they were; and from here on, a bit for each
// octant x + 2 y + 4 z, that an opacity in it changed.
const TODO = 1u;
const ANEW = 2u;
const CHANGED = 256u;
const ALL_CHANGED = 255u * CHANGED;

fn changed_bit(voxel: vec3<u32>) -> u32 {
    let octant = voxel / 4u & vec3(1u);
    return CHANGED << (octant.x + 2u * octant.y + 4u * octant.z);
}

fn brick_index(brick: vec3<u32>, bricks: vec3<u32>) -> u32 {
    return (brick.z * bricks.y + brick.y) * bricks.x + brick.x;
}

// Groups x, y of a dispatch that reaches the item in a slot.
fn groups_through(slot: u32) -> vec2<u32> {
    return vec2(min(slot + 1u, GROUPS_PER_ROW), slot / GROUPS_PER_ROW + 1u);
}

fn brick_at(index: u32, bricks: vec3<u32>) -> vec3<u32> {
    return vec3(index % bricks.x, index / bricks.x % bricks.y, index / (bricks.x * bricks.y));
}
