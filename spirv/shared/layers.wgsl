// Depth layers and dilation maps of mesh clips.

// Depth of a map's pixel in which nothing was drawn.
const EMPTY = 1.0;
// Front and back of what holds nothing: behind and before everything.
const NO_FRONT = 2.0;
const NO_BACK = -1.0;

// Depths that are less apart than this are one: what f32 plane equations over the whole map leave of faces that touch.
const ONE_DEPTH = 4e-6;

// Pixels along the edge of a block of layers.
const BLOCK = 16u;
// What is kept of each block and pair, in this order: nearest front and farthest back (NO_FRONT and NO_BACK where nothing is
// inside), farthest front and nearest back (NO_FRONT and NO_BACK where a pixel has no inside).
const BLOCK_BOUNDS = 4u;

struct Layers {
    // of each mesh, for each pair: front map, back map; rows of y, x fastest; depth 0 ... 1 of the clip camera; EMPTY fronts. Behind
    // them, for each pair, over blocks of pixels: maps of BLOCK_BOUNDS
    depth: array<f32>,
}

struct Dilation {
    // for each pair: front map, back map, as in Layers
    depth: array<f32>,
}
