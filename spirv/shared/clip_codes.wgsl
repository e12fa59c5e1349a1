// What is known of a brick under the clips.

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

// A word a brick of 8x8x8 voxels, x fastest: visibility (2 bits), reach (2 bits), a bit for each clip that cuts it (8), and
// a bit for each clip that reaches some of its voxels (8).
struct ClipBricks {
    code: array<u32>,
}
