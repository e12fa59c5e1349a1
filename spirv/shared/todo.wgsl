// What is said of a brick in a word of Todo.

#include "shared/words.wgsl"

// Its values are to be computed or amended.
const TODO = 1u;
// They are to be computed anew, whatever they were.
const ANEW = 2u;
// The first of eight bits, one for each octant x + 2 y + 4 z, that an opacity in it changed.
const CHANGED = 256u;
const ALL_CHANGED = 255u * CHANGED;

// Voxels along the edge of an octant.
const OCTANT = BRICK / 2u;

fn changed_bit(voxel: vec3<u32>) -> u32 {
    let octant = voxel / OCTANT & vec3(1u);
    return CHANGED << (octant.x + 2u * octant.y + 4u * octant.z);
}

// First of the three bounds x, y, z in Chosen: of the bricks to compute anew, and of those that changed.
const OF_ANEW = 0u;
const OF_CHANGED = 3u;
