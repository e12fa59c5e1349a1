// What is known of a brick under the clips.

#include "shared/clip_bits.wgsl"

// Visibility of a box's points.
const HIDDEN = 0u;
const CUT = 1u;
const VISIBLE = 2u;
// As CUT, but no bound of a smaller box would tell more: look at every sample.
const SAMPLED = 3u;

// Which of a box's points have a point that some clip hides within reach.
const NONE = 0u;
const SOME = 1u;
const ALL = 2u;

// A word a brick, x fastest: visibility (2 bits), reach (2 bits), a bit for each clip that cuts it, and a bit for each clip that
// reaches some of its voxels.
struct ClipBricks {
    code: array<u32>,
}

const VISIBILITY_MASK = 3u;
const REACH_AT = 2u;
const REACH_MASK = 3u;
const CUTTING_AT = 4u;
const REACHING_AT = CUTTING_AT + MOST_CLIPS;

// The word of a brick of which nothing is known: every voxel is tested and every sample taken.
const UNKNOWN = SAMPLED | SOME << REACH_AT | ALL_CLIPS << CUTTING_AT | ALL_CLIPS << REACHING_AT;

fn code_of(visibility: u32, reach: u32, cutting: u32, reaching: u32) -> u32 {
    return visibility | reach << REACH_AT | cutting << CUTTING_AT | reaching << REACHING_AT;
}

fn visibility_in(code: u32) -> u32 {
    return code & VISIBILITY_MASK;
}

fn reach_in(code: u32) -> u32 {
    return code >> REACH_AT & REACH_MASK;
}

fn cutting_in(code: u32) -> u32 {
    return code >> CUTTING_AT & ALL_CLIPS;
}
