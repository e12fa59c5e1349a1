// A block of channels around a workgroup's voxels, normalised, in workgroup memory. Needs `params.dims`, the grid, and the binding `norms`. A
// workgroup has TEAM invocations and TILE voxels, of which each takes eight, one above the other.

#include "shared/tensors.wgsl"
#include "shared/norms.wgsl"

// Voxels of a workgroup along x, y, z.
const TILE_X = 8u;
const TILE_Y = 8u;
const TILE_Z = 8u;
// Invocations of a workgroup.
const TEAM = 64u;
// With a voxel around.
const ROW = TILE_X + 2u;
const PLANE = ROW * (TILE_Y + 2u);
const HELD = PLANE * (TILE_Z + 2u);
// With a voxel on one side only.
const PART_X = TILE_X + 1u;
const PART_Y = TILE_Y + 1u;
const PART = PART_X * PART_Y * (TILE_Z + 1u);

var<workgroup> tile: array<vec4<u32>, HELD>;

// Where in a tile its entry i is.
fn held(i: u32) -> vec3<u32> {
    return vec3(i % ROW, i / ROW % (TILE_Y + 2u), i / PLANE);
}

// The channels of a voxel, normalised.
fn normalised(words: vec4<u32>, norm: Norm) -> vec4<u32> {
    let eight = unpacked(words);
    return packed(Eight((eight.low - norm.mean_low) * norm.by_low, (eight.high - norm.mean_high) * norm.by_high));
}

// Corner of a tile of the grid.
fn corner_of(item: u32) -> vec3<u32> {
    let tiles = (params.dims + vec3(TILE_X, TILE_Y, TILE_Z) - 1u) / vec3(TILE_X, TILE_Y, TILE_Z);
    return place_at(item, tiles) * vec3(TILE_X, TILE_Y, TILE_Z);
}

// The lowest of an invocation's voxels, in its tile.
fn place_of(lane: u32) -> vec3<u32> {
    return vec3(lane % TILE_X, lane / TILE_X % TILE_Y, 0u);
}
