// Occlusion of one pixel of each block of pixels.

struct Sparse {
    // for each block, view after view, the sum over all triangles
    block: array<f32>,
}

// What `upsample` writes for a pixel that no block is like: below any accessibility.
const FAILED = -1.0;
