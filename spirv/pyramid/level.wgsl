// One level of the volumes of means (SPAO section 1.2.3): each cell is the mean of eight cells of the level before, in whole numbers, so that
// it is the same whatever was computed when. Cells beyond the volume's matter are 0 and not stored.
//
// In: `finer`, the level before or V_o; out: `coarser`, r16unorm. 8 reads and a write a cell. Which cells is said by `pyramid/level.rs`: `main`
// makes all, `listed` those of the tiles that an edit concerns (tiles.wgsl).

struct LevelParams {
    // cells of this level
    dims: vec3<u32>,
    // length of a voxel / reference length of the opacities; 1 of means
    exponent: f32,
    // of the level before
    before: vec3<i32>,
    // how many of its cells lie from one cell of this level to the next
    stride: vec3<i32>,
    // the first that cell 0 is a mean of
    first: vec3<i32>,
    // how far the others are from it; 0 along an axis that is not doubled
    second: vec3<i32>,
    // tiles of this level
    tiles: vec3<u32>,
}

struct Marks {
    all: array<u32>,
}

#include "shared/bricks.wgsl"
#include "shared/opaque.wgsl"
#include "shared/of_voxel.wgsl"
#include "shared/parts.wgsl"

var<immediate> params: LevelParams;
@group(0) @binding(0) var finer: texture_3d<f32>;
@group(0) @binding(1) var coarser: texture_storage_3d<r16unorm, write>;
@group(0) @binding(2) var<storage, read> list: BrickList;
@group(0) @binding(3) var<storage, read_write> marks: Marks;

fn make(cell: vec3<u32>) {
    if any(cell >= params.dims) {
        return;
    }
    let low = vec3<i32>(cell) * params.stride + params.first;
    var sum = 0u;
    for (var n = 0u; n < 8u; n++) {
        let at = low + select(vec3(0), params.second, (vec3(n, n >> 1u, n >> 2u) & vec3(1u)) == vec3(1u));
        if all(at >= vec3(0)) && all(at < params.before) {
            sum += u32(round(of_voxel(textureLoad(finer, at, 0).r, params.exponent) * PARTS));
        }
    }
    textureStore(coarser, cell, vec4(f32((sum + 4u) >> 3u) / PARTS, 0.0, 0.0, 0.0));
}

@compute @workgroup_size(8, 8, 4)
fn main(@builtin(global_invocation_id) cell: vec3<u32>) {
    make(cell);
}

// One workgroup a tile, of which the mark is taken away.
@compute @workgroup_size(BRICK, BRICK, SLICES)
fn listed(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) place: vec3<u32>) {
    let entry = item_of_group(group);
    if entry >= list.count {
        return;
    }
    let tile = list.items[entry];
    let cell = brick_at(tile, params.tiles) * BRICK + place;
    make(cell);
    make(cell + vec3(0u, 0u, SLICES));
    if all(place == vec3(0u)) {
        marks.all[tile] = 0u;
    }
}
