// Which cells of the volumes of means an edit concerns, in tiles of 8 by 8 by 8: `changed` lists the bricks in which V_o changed, which are the
// tiles of level 0; `mark` lists those of a level that have a cell whose mean takes in a cell of a listed tile of the level before.
//
// Cost: a read a brick, then 64 marks a listed tile, on which no tile that is not concerned costs anything.

struct TilesParams {
    // tiles of this level; of `changed` bricks
    tiles: vec3<u32>,
    // of the level before
    before: vec3<u32>,
    // cells of this level
    dims: vec3<i32>,
    // of level.wgsl
    stride: vec3<i32>,
    first: vec3<i32>,
    second: vec3<i32>,
}

struct Change {
    // 0 where it changed
    squared: array<u32>,
}

struct Marks {
    all: array<atomic<u32>>,
}

#include "shared/growing.wgsl"

var<immediate> params: TilesParams;
@group(0) @binding(0) var<storage, read> change: Change;
@group(0) @binding(1) var<storage, read> list: BrickList;
// 1 of tiles that are listed
@group(0) @binding(2) var<storage, read_write> marks: Marks;
@group(0) @binding(3) var<storage, read_write> growing: GrowingList;

// One invocation a brick.
@compute @workgroup_size(LANES)
fn changed(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = item_of(id, groups);
    var wanted = false;
    if index < brick_count(params.tiles) {
        wanted = change.squared[index] == 0u;
    }
    put_in(index, wanted, lane);
}

// One workgroup a tile of the level before, one invocation a tile that reads it: along each axis by its first or its second cell, and of two
// neighbours one.
@compute @workgroup_size(LANES)
fn mark(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = item_of_group(group);
    let listed = entry < list.count;
    let low = vec3<i32>(brick_at(list.items[select(0u, entry, listed)], params.before) * BRICK);
    let pick = vec3<i32>((vec3(lane) >> vec3(0u, 2u, 4u)) & vec3(3u));
    let start = params.first + select(vec3(0), params.second, (pick & vec3(1)) == vec3(1));
    // Cells c with low <= stride c + start < low + 8; a stride of 1 or 2 divides by shifting, below 0 too.
    let shift = vec3<u32>(params.stride - 1);
    let begin = max((low - start + params.stride - 1) >> shift, vec3(0));
    let last = min((low + i32(BRICK - 1u) - start) >> shift, params.dims - 1);
    let tile = begin / i32(BRICK) + (pick >> vec3(1u));
    var index = 0u;
    var wanted = false;
    if listed && all(begin <= last) && all(tile <= last / i32(BRICK)) {
        index = brick_index(vec3<u32>(tile), params.tiles);
        wanted = atomicExchange(&marks.all[index], 1u) == 0u;
    }
    put_in(index, wanted, lane);
}
