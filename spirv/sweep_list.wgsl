// Compaction for a sweep (method.md section 4, sparse sweeps; section 5.2): for every direction and tile of lines the runs of
// chunks to walk, so that nothing is walked elsewhere. Chunks are fixed in the lattice, so what a voxel's value is does not
// depend on what is listed.
//
// For a voxel in chunk c its ray forwards is found in chunk c, and its ray backwards up to `lag` chunks before. The rays that meet a
// voxel in chunk c, in either direction, are found in chunks c - lag ... c too. So both need the same runs, of bricks
// to compute anew or of voxels that changed.

struct ListParams {
    dims: vec3<u32>,
    // 1: rays that meet a change are listed; 0: all rays of bricks to compute anew
    amend: u32,
    bricks: vec3<u32>,
    // edge of what is looked at, a brick's octants or bricks: 4 or 8
    cell: i32,
}

struct Direction {
    step: vec3<i32>,
    axis: u32,
    tiles: vec2<u32>,
    // tiles in all layers
    count: u32,
    window: u32,
    // 1: segments have samples between lattice points, which interpolate voxels beside the line
    beside: u32,
}

struct Directions {
    direction: array<Direction>,
}

struct Todo {
    brick: array<u32>,
}

// As near.wgsl writes them.
struct Bounds {
    bricks: u32,
    low: array<u32, 6>,
    high: array<u32, 6>,
}

#include "shared/bricks.wgsl"
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
@group(0) @binding(3) var<storage, read> bounds: Bounds;

// Wrapped into the volume, and voxels from there to the end of its cell or of the volume, whichever comes first.
fn piece(x: i32, size: i32) -> vec2<i32> {
    var at = x % size;
    at += select(0, size, at < 0);
    return vec2(at, min(params.cell - (at & (params.cell - 1)), size - at));
}

// Whether a brick to compute anew, or an octant that changed, meets the box low ... high (inclusive, wrapping across the walk)
// in the cells' layer of `along`.
fn any_cell(low: vec2<i32>, high: vec2<i32>, along: i32, axis: u32, dims: vec3<i32>) -> bool {
    let across = line_axes(axis);
    let extent = line_extent(axis, dims);
    var voxel = vec3(along);
    for (var w = low.y; w <= high.y; ) {
        let row = piece(w, extent.y);
        voxel[across.y] = row.x;
        for (var u = low.x; u <= high.x; ) {
            let column = piece(u, extent.x);
            voxel[across.x] = column.x;
            let at = vec3<u32>(voxel) / 8u;
            let word = todo.brick[(at.z * params.bricks.y + at.y) * params.bricks.x + at.x];
            let octant = vec3<u32>(voxel) / 4u & vec3(1u);
            if (word & select(ANEW, CHANGED << (octant.x + 2u * octant.y + 4u * octant.z), params.amend == 1u)) != 0u {
                return true;
            }
            u += column.y;
        }
        w += row.y;
    }
    return false;
}

// Whether the voxels low ... high, wrapped into the extent, miss bricks first ... last.
fn misses(low: i32, high: i32, extent: i32, first: u32, last: u32) -> bool {
    var begin = low % extent;
    begin += select(0, extent, begin < 0);
    let end = begin + high - low;
    let wanted = vec2(8 * i32(first), 8 * i32(last) + 7);
    return (begin > wanted.y || end < wanted.x) && end - extent < wanted.x;
}

// Whether chunk c of a tile's lines has something; conservative by the tile's bounding boxes.
fn wanted(line: vec3<i32>, c: i32, steps: i32, d: Direction, dims: vec3<i32>) -> bool {
    let across = line_axes(d.axis);
    let extent = line_extent(d.axis, dims);
    let slope = vec2(d.step[across.x], d.step[across.y]);
    let stride = d.step[d.axis];
    let width = min(vec2<i32>(TILE), extent - line.xy) - 1;
    let size = chunk_size(i32(d.window));
    // Where there is something at all.
    let box = 3u * params.amend;
    let first = vec3(bounds.low[box], bounds.low[box + 1u], bounds.low[box + 2u]);
    let end = vec3(bounds.high[box], bounds.high[box + 1u], bounds.high[box + 2u]);
    // Those beside a segment lie in the box of its ends, so among what lies between a step, the one before and the one behind.
    let beside = i32(d.beside * params.amend);
    var i = c * size;
    let last = min(i + size + beside, steps) - 1;
    while i <= last {
        // Steps i ... j are in the same layer of cells.
        let a = select(line.z, dims[d.axis] - 1 - line.z, stride < 0) + i * stride;
        let inside = a & (params.cell - 1);
        let j = min(i + select(params.cell - 1 - inside, inside, stride < 0) / abs(stride), last);
        let low = line.xy + min((i - beside) * slope, (j + beside) * slope);
        let high = line.xy + max((i - beside) * slope, (j + beside) * slope) + width;
        let hit = !misses(low.x, high.x, extent.x, first[across.x], end[across.x])
            && !misses(low.y, high.y, extent.y, first[across.y], end[across.y]);
        // Also where a line ends between two layers of cells.
        let before = clamp(a - beside * stride, 0, dims[d.axis] - 1);
        let behind = clamp(a + (j - i + beside) * stride, 0, dims[d.axis] - 1);
        for (var k = 0; hit && k <= 2 * beside; k++) {
            let along = vec3(a, before, behind)[k];
            let brick = u32(along) / 8u;
            if brick >= first[d.axis] && brick <= end[d.axis] && any_cell(low, high, along, d.axis, dims) {
                return true;
            }
        }
        i = j + 1;
    }
    return false;
}

fn add_run(direction: u32, run: Run) {
    let slot = atomicAdd(&list.head[direction].count, 1u);
    list.runs[list.head[direction].at + slot] = run;
    atomicMax(&list.head[direction].groups_x, min(slot + 1u, GROUPS_PER_ROW));
    atomicMax(&list.head[direction].groups_y, slot / GROUPS_PER_ROW + 1u);
}

// One invocation a tile and direction.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let d = directions.direction[id.y];
    if id.x >= d.count || bounds.low[3u * params.amend] > bounds.high[3u * params.amend] {
        return;
    }
    let dims = vec3<i32>(params.dims);
    let line = line_at(id.x, vec2(0u), d.tiles, d.axis, dims);
    let steps = line_steps(line.z, d.axis, dims, d.step);
    let size = chunk_size(i32(d.window));
    let lag = chunk_lag(i32(d.window));
    let chunks = (steps + size - 1) / size;
    // Rays backwards are amended where they begin, up to so many chunks behind a run: no other run may work there.
    let apart = select(0, lag - 1, params.amend == 1u);
    // The run that is open: from its first chunk to before `end`.
    var first = 0;
    var end = 0;
    for (var c = 0; c <= chunks; c++) {
        let more = c < chunks && wanted(line, c, steps, d, dims);
        if end > first && (c == chunks || (more && c > end + apart)) {
            add_run(id.y, Run(id.x, u32(first), u32(end - first)));
            end = first;
        }
        if more {
            first = select(c, first, end > first);
            end = c + lag + 1;
        }
    }
}
