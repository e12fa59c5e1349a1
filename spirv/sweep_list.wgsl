// Compaction for a sweep (method.md section 4, sparse sweeps): for every direction and tile of lines the runs of chunks in
// which some voxel is to be computed, and those in which its ray backwards is found, so that nothing is walked elsewhere.
// Chunks are fixed in the lattice, so what a voxel's value is does not depend on what is listed.

struct ListParams {
    dims: vec3<u32>,
    bricks: vec3<u32>,
}

struct Direction {
    step: vec3<i32>,
    axis: u32,
    tiles: vec2<u32>,
    // tiles in all layers
    count: u32,
    window: u32,
}

struct Directions {
    direction: array<Direction>,
}

struct Todo {
    brick: array<u32>,
}

#include "shared/sweep.wgsl"

struct CountedHead {
    groups_x: atomic<u32>,
    groups_y: atomic<u32>,
    groups_z: u32,
    count: atomic<u32>,
    at: u32,
}

struct CountedList {
    head: array<CountedHead, 54>,
    runs: array<Run>,
}

var<immediate> params: ListParams;
@group(0) @binding(0) var<storage, read> directions: Directions;
@group(0) @binding(1) var<storage, read> todo: Todo;
@group(0) @binding(2) var<storage, read_write> list: CountedList;

// Voxels from x to the end of its brick or of the volume, whichever comes first; x may lie outside and wraps round.
fn piece(x: i32, size: i32) -> vec2<i32> {
    var at = x % size;
    at += select(0, size, at < 0);
    return vec2(at >> 3u, min(8 - (at & 7), size - at));
}

// Whether a brick to compute meets the box low ... high (inclusive, wrapping across the walk) in layer `slab` of bricks.
fn any_todo(low: vec2<i32>, high: vec2<i32>, slab: i32, axis: u32, dims: vec3<i32>) -> bool {
    let across = line_axes(axis);
    let extent = line_extent(axis, dims);
    var brick = vec3(slab);
    for (var w = low.y; w <= high.y; ) {
        let row = piece(w, extent.y);
        brick[across.y] = row.x;
        for (var u = low.x; u <= high.x; ) {
            let column = piece(u, extent.x);
            brick[across.x] = column.x;
            let at = vec3<u32>(brick);
            if todo.brick[(at.z * params.bricks.y + at.y) * params.bricks.x + at.x] != 0u {
                return true;
            }
            u += column.y;
        }
        w += row.y;
    }
    return false;
}

// Whether a voxel of chunk c is to be computed; conservative by the tile's bounding boxes.
fn wanted(line: vec3<i32>, c: i32, steps: i32, d: Direction, dims: vec3<i32>) -> bool {
    let across = line_axes(d.axis);
    let slope = vec2(d.step[across.x], d.step[across.y]);
    let stride = d.step[d.axis];
    let width = min(vec2(i32(TILE)), line_extent(d.axis, dims) - line.xy) - 1;
    let size = chunk_size(i32(d.window));
    var i = c * size;
    let last = min(i + size, steps) - 1;
    while i <= last {
        // Steps i ... j are in the same layer of bricks.
        let a = select(line.z, dims[d.axis] - 1 - line.z, stride < 0) + i * stride;
        let left = select(7 - (a & 7), a & 7, stride < 0);
        let j = min(i + left / abs(stride), last);
        let low = line.xy + min(i * slope, j * slope);
        let high = line.xy + max(i * slope, j * slope) + width;
        if any_todo(low, high, a >> 3u, d.axis, dims) {
            return true;
        }
        i = j + 1;
    }
    return false;
}

// One invocation a tile and direction.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let d = directions.direction[id.y];
    if id.x >= d.count {
        return;
    }
    let dims = vec3<i32>(params.dims);
    let line = line_at(id.x, vec2(0u), d.tiles, d.axis, dims);
    let steps = line_steps(line.z, d.axis, dims, d.step);
    let size = chunk_size(i32(d.window));
    let lag = chunk_lag(i32(d.window));
    let chunks = (steps + size - 1) / size;
    // The run that is open: from its first chunk to before `end`.
    var first = 0;
    var end = 0;
    for (var c = 0; c <= chunks; c++) {
        let more = c < chunks && wanted(line, c, steps, d, dims);
        if end > first && (c == chunks || (more && c > end)) {
            let slot = atomicAdd(&list.head[id.y].count, 1u);
            list.runs[list.head[id.y].at + slot] = Run(id.x, u32(first), u32(end - first));
            atomicMax(&list.head[id.y].groups_x, min(slot + 1u, GROUPS_PER_ROW));
            atomicMax(&list.head[id.y].groups_y, slot / GROUPS_PER_ROW + 1u);
            end = first;
        }
        if more {
            first = select(c, first, end > first);
            end = c + lag + 1;
        }
    }
}
