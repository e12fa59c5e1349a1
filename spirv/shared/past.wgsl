// What changed bricks held before an edit.

#include "shared/bricks.wgsl"
#include "shared/parts.wgsl"

// Words of a brick: one an invocation, for the voxels of two slices, SLICES apart.
const PAST_WORDS = BRICK * BRICK * SLICES;
// Bits of an opacity in parts: the nearer slice's are the lower.
const PAST_BITS = 16u;
const PAST_MASK = 0xffffu;

// Opacities that listed bricks had, PAST_WORDS each.
struct Past {
    opacities: array<u32>,
}
