// Occlusion of one pixel of each block of pixels.

struct Sparse {
    // for each block, view after view, the sum over all triangles, cut off at 1
    block: array<f32>,
}

// Pixels that no block is like.
struct Failures {
    count: atomic<u32>,
    // their indices, in no order
    pixel: array<u32>,
}

