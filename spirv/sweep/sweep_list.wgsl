// Compaction for a sweep (method.md section 4, sparse sweeps; section 5.2): for every direction and tile of lines the runs of
// chunks to walk, so that nothing is walked elsewhere. Chunks are fixed in the lattice, so what a voxel's value is does not
// depend on what is listed.
//
// For the voxel of step i its ray forwards is found in step i, and its ray backwards a window and a step before. The rays that meet
// it, in either direction, are found in these and the steps between. So both need the same runs, of bricks to compute anew
// or of voxels that changed. Chunks are counted from `lag` before a line's first voxel, so that none is negative.

struct ListParams {
    dims: vec3<u32>,
    // 1: rays that meet a change are listed; 0: all rays of bricks to compute anew
    amend: u32,
    bricks: vec3<u32>,
    // edge of what is looked at: OCTANT or BRICK
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

// As near.wgsl writes them.
struct Chosen {
    bricks: u32,
    low: array<u32, 6>,
    high: array<u32, 6>,
}

#include "shared/sweep.wgsl"
#include "shared/todo.wgsl"

struct CountedHead {
    groups_x: atomic<u32>,
    groups_y: atomic<u32>,
    groups_z: u32,
    count: atomic<u32>,
    at: u32,
}

struct CountedList {
    head: array<CountedHead, MOST_RAYS>,
    runs: array<Run>,
}

var<immediate> params: ListParams;
@group(0) @binding(0) var<storage, read> directions: Directions;
@group(0) @binding(1) var<storage, read> todo: Todo;
@group(0) @binding(2) var<storage, read_write> list: CountedList;
@group(0) @binding(3) var<storage, read> chosen: Chosen;

// The voxels from x, in the volume, to the end of its cell or of the volume, whichever comes first.
fn piece(x: i32, size: i32) -> i32 {
    return min(params.cell - (x & (params.cell - 1)), size - x);
}

// Whether a brick to compute anew, or an octant that changed, meets the box, which wraps round, in the cells' layer of `along`.
fn any_cell(box: Across, along: i32, axis: u32, dims: vec3<i32>) -> bool {
    let across = line_axes(axis);
    let extent = line_extent(axis, dims);
    var voxel = vec3(along);
    var w = box.begin.y;
    for (var left = box.size.y; left > 0; ) {
        let rows = piece(w, extent.y);
        voxel[across.y] = w;
        var u = box.begin.x;
        for (var left = box.size.x; left > 0; ) {
            let columns = piece(u, extent.x);
            voxel[across.x] = u;
            let at = vec3<u32>(voxel);
            let word = todo.brick[brick_index(at / BRICK, params.bricks)];
            if (word & select(ANEW, changed_bit(at), params.amend == 1u)) != 0u {
                return true;
            }
            left -= columns;
            u = select(u + columns, 0, u + columns == extent.x);
        }
        left -= rows;
        w = select(w + rows, 0, w + rows == extent.y);
    }
    return false;
}

// Along an axis, of the brick at a place.
fn first_voxel(place: u32) -> i32 {
    return i32(BRICK) * i32(place);
}

fn last_voxel(place: u32) -> i32 {
    return i32(BRICK) * i32(place) + i32(BRICK - 1u);
}

// Whether `size` voxels from `begin` on, wrapped into the extent, miss bricks first ... last.
fn misses(begin: i32, size: i32, extent: i32, first: u32, last: u32) -> bool {
    let end = begin + size - 1;
    return (begin > last_voxel(last) || end < first_voxel(first)) && end - extent < first_voxel(first);
}

// What the lines of a tile pass across the walk in steps i ... j: where it begins, wrapped into the volume, and its size.
struct Across {
    begin: vec2<i32>,
    size: vec2<i32>,
}

fn across_steps(line: vec3<i32>, i: i32, j: i32, d: Direction, dims: vec3<i32>) -> Across {
    let across = line_axes(d.axis);
    let extent = line_extent(d.axis, dims);
    let slope = vec2(d.step[across.x], d.step[across.y]);
    let width = min(vec2<i32>(TILE), extent - line.xy);
    let low = line.xy + min(i * slope, j * slope);
    return Across(vec2(wrap(low.x, extent.x), wrap(low.y, extent.y)), abs((j - i) * slope) + width);
}

// The first step of chunk c of a tile's lines, or one not far before it, that has something, or -1; conservative by the tile's
// bounding boxes.
fn first_wanted(line: vec3<i32>, c: i32, steps: i32, d: Direction, dims: vec3<i32>) -> i32 {
    let stride = d.step[d.axis];
    let size = chunk_size(i32(d.window));
    // Those beside a segment lie in the box of its ends, so among what lies between a step, the one before and the one behind.
    let beside = i32(d.beside * params.amend);
    var i = c * size;
    let last = min(i + size + beside, steps) - 1;
    let origin = select(line.z, dims[d.axis] - 1 - line.z, stride < 0);

    // Where there is something at all.
    let kind = select(OF_ANEW, OF_CHANGED, params.amend == 1u);
    let first = vec3(chosen.low[kind], chosen.low[kind + 1u], chosen.low[kind + 2u]);
    let end = vec3(chosen.high[kind], chosen.high[kind + 1u], chosen.high[kind + 2u]);
    let axes = line_axes(d.axis);
    let extent = line_extent(d.axis, dims);
    let ends = origin + vec2(i - beside, last + beside) * stride;
    let chunk = across_steps(line, i - beside, last + beside, d, dims);
    if max(ends.x, ends.y) < first_voxel(first[d.axis]) || min(ends.x, ends.y) > last_voxel(end[d.axis])
        || misses(chunk.begin.x, chunk.size.x, extent.x, first[axes.x], end[axes.x])
        || misses(chunk.begin.y, chunk.size.y, extent.y, first[axes.y], end[axes.y]) {
        return -1;
    }
    while i <= last {
        // Steps i ... j are in the same layer of cells.
        let a = origin + i * stride;
        let inside = a & (params.cell - 1);
        let j = min(i + quotient(select(params.cell - 1 - inside, inside, stride < 0), abs(stride)), last);
        let across = across_steps(line, i - beside, j + beside, d, dims);
        // Also where a line ends between two layers of cells.
        let along = clamp(a + vec3(0, -beside, j - i + beside) * stride, vec3(0), vec3(dims[d.axis] - 1));
        for (var k = 0; k <= 2 * beside; k++) {
            if any_cell(across, along[k], d.axis, dims) {
                return i;
            }
        }
        i = j + 1;
    }
    return -1;
}

fn add_run(direction: u32, run: Run) {
    let slot = atomicAdd(&list.head[direction].count, 1u);
    list.runs[list.head[direction].at + slot] = run;
    let through = groups_through(slot);
    atomicMax(&list.head[direction].groups_x, through.x);
    atomicMax(&list.head[direction].groups_y, through.y);
}

// One invocation a tile and direction.
@compute @workgroup_size(LANES)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let d = directions.direction[id.y];
    let kind = select(OF_ANEW, OF_CHANGED, params.amend == 1u);
    if id.x >= d.count || chosen.low[kind] > chosen.high[kind] {
        return;
    }
    let dims = vec3<i32>(params.dims);
    let line = line_at(id.x, vec2(0u), d.tiles, d.axis, dims);
    let steps = line_steps(line.z, d.axis, dims, d.step);
    let window = i32(d.window);
    let size = chunk_size(window);
    let lag = chunk_lag(window);
    let chunks = quotient(steps + size - 1, size);
    // Rays backwards are amended where they begin, up to so many chunks behind a run: no other run may work there.
    let apart = select(0, lag - 1, params.amend == 1u);
    // The run that is open: from its first chunk to before `end`.
    var first = 0;
    var end = 0;
    for (var c = 0; c <= chunks; c++) {
        let step = select(-1, first_wanted(line, c, steps, d, dims), c < chunks);
        // The rays that it needs begin a window before it at the earliest.
        let begin = quotient(step + lag * size - window - 1, size);
        if end > first && (c == chunks || (step >= 0 && begin > end + apart)) {
            add_run(id.y, Run(id.x, u32(first), u32(end - first)));
            end = first;
        }
        if step >= 0 {
            first = select(begin, first, end > first);
            end = c + lag + 1;
        }
    }
}
