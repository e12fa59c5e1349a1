// Lines of a sweep and the list of their parts that have something to compute.
//
// A line is named by its place (u, w) on the two axes across the walk and by its layer r, the voxel of the walk's axis it
// begins at. Its step i is at voxel (u + i du, w + i dw, r + i |da|), the first two modulo the volume; walked from the upper
// end where da < 0.

#include "shared/ray_set.wgsl"

// Lines of a tile along the faster axis across the walk and along the other: eight lie side by side in memory.
const TILE = vec2(8u, 4u);
// Segments of a chunk, the last window permitting.
const CHUNK = 8;

// Chunks `first` ... `first + count` of the lines of a tile, the first being the one in whose steps the ray backwards from
// step 0 is found.
struct Run {
    tile: u32,
    first: u32,
    count: u32,
}

struct SweepHead {
    // arguments of an indirect dispatch
    groups_x: u32,
    groups_y: u32,
    groups_z: u32,
    count: u32,
    // first run
    at: u32,
}

struct SweepList {
    head: array<SweepHead, MOST_RAYS>,
    runs: array<Run>,
}

// The axes across a walk: the faster first.
fn line_axes(axis: u32) -> vec2<u32> {
    return vec2(select(0u, 1u, axis == 0u), select(2u, 1u, axis == 2u));
}

fn line_extent(axis: u32, dims: vec3<i32>) -> vec2<i32> {
    let across = line_axes(axis);
    return vec2(dims[across.x], dims[across.y]);
}

// floor(a / b) for |a| < 2^24, b > 0. A software driver divides integers lane by lane, floats all at once.
fn quotient(a: i32, b: i32) -> i32 {
    let near = i32(floor(f32(a) / f32(b)));
    let rest = a - near * b;
    return near + select(0, 1, rest >= b) - select(0, 1, rest < 0);
}

// Into 0 ... size - 1.
fn wrap(x: i32, size: i32) -> i32 {
    return x - quotient(x, size) * size;
}

// Place u, w and layer of a line of a tile.
fn line_at(tile: u32, local: vec2<u32>, tiles: vec2<u32>, axis: u32, dims: vec3<i32>) -> vec3<i32> {
    let row = quotient(i32(tile), i32(tiles.x));
    let layer = quotient(row, i32(tiles.y));
    let place = vec2(i32(tile) - row * i32(tiles.x), row - layer * i32(tiles.y));
    return vec3(place * vec2<i32>(TILE) + vec2<i32>(local), layer);
}

// Number of a line's voxels.
fn line_steps(layer: i32, axis: u32, dims: vec3<i32>, step: vec3<i32>) -> i32 {
    let stride = abs(step[axis]);
    return quotient(dims[axis] - layer + stride - 1, stride);
}

// Chunk c is the steps c size ... c size + size - 1.
fn chunk_size(window: i32) -> i32 {
    return min(window, CHUNK);
}

// Whole chunks of a window.
fn chunks_in(window: i32) -> i32 {
    return max(window / CHUNK, 1);
}

// Rays that end in a chunk and go backwards begin up to so many chunks further on.
fn chunk_lag(window: i32) -> i32 {
    return chunks_in(window) + 1;
}

fn line_position(line: vec3<i32>, i: i32, axis: u32, dims: vec3<i32>, step: vec3<i32>) -> vec3<i32> {
    let across = line_axes(axis);
    var begin = vec3(0);
    begin[across.x] = line.x;
    begin[across.y] = line.y;
    begin[axis] = select(line.z, dims[axis] - 1 - line.z, step[axis] < 0);
    let p = begin + i * step;
    return vec3(wrap(p.x, dims.x), wrap(p.y, dims.y), wrap(p.z, dims.z));
}
