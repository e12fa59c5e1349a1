// Line sweep: local ambient occlusion along one lattice direction for every voxel, at a cost that does not depend on the
// radius (method.md section 4). All voxels of a lattice line share its segments; a voxel's ray is a window of consecutive
// segments, each an affine pair (t, s): T' = t T, S' = S + s T. Windows by two scans (van Herk 1992, Gil and Werman 1993):
// a line is cut into blocks as long as the window; a window is the suffix of one block and the prefix of the next. No
// subtraction, and no value depends on samples outside its own window or on which other voxels are computed.
//
// Lines are walked along one axis, one voxel a step in every line, and wrap round along the other two: so lanes stay side by
// side, all lines are equally long and together they meet each voxel once. Where a line leaves the volume (a gap) the window
// goes on through free space, and the next line begins.

struct SweepParams {
    dims: vec3<u32>,
    // axis along which lines are walked
    axis: u32,
    // the lattice direction
    step: vec3<i32>,
    // segments of a block, which is the window behind the first segment
    block: u32,
    bricks: vec3<u32>,
    // 1: the first direction, which begins the sum
    flags: u32,
    // tiles of lines along the other two axes
    tiles: vec2<u32>,
    // this direction's place in the list
    list: u32,
    // pieces of a segment: samples between lattice points and 1
    pieces: u32,
    // length of a piece / reference length of the opacity
    depth: f32,
    // where the ray starts, as a share of the first segment
    start: f32,
    // segments behind the first: `block`, or 0
    far: f32,
    // weight of the direction / length of the ray in segments
    share: f32,
}

struct Todo {
    brick: array<u32>,
}

#include "shared/segment.wgsl"
#include "shared/sweep.wgsl"

const FIRST = 1u;
// Longest block.
const MOST = 128u;
// Both ends opaque: nothing comes through (lao.wgsl).
const OPAQUE = 1e-6;

var<immediate> params: SweepParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
@group(0) @binding(1) var<storage, read> list: SweepList;
@group(0) @binding(2) var<storage, read> todo: Todo;
@group(0) @binding(3) var ambient: texture_storage_3d<r16unorm, read_write>;

// Transmittance of a lattice point; 1 outside the volume.
fn clear_at(p: vec3<i32>) -> f32 {
    let dims = vec3<i32>(params.dims);
    let held = clamp(p, vec3(0), dims - 1);
    return 1.0 - select(0.0, textureLoad(opacity, held, 0).r, all(held == p));
}

fn clear_along_x(p: vec3<i32>, x: f32) -> f32 {
    if x == 0.0 {
        return clear_at(p);
    }
    return mix(clear_at(p), clear_at(p + vec3(1, 0, 0)), x);
}

fn clear_along_xy(p: vec3<i32>, xy: vec2<f32>) -> f32 {
    if xy.y == 0.0 {
        return clear_along_x(p, xy.x);
    }
    return mix(clear_along_x(p, xy.x), clear_along_x(p + vec3(0, 1, 0), xy.x), xy.y);
}

// Trilinear transmittance between lattice points.
fn clear_between(p: vec3<i32>, offset: vec3<f32>) -> f32 {
    let corner = p + vec3<i32>(floor(offset));
    let between = offset - floor(offset);
    if between.z == 0.0 {
        return clear_along_xy(corner, between.xy);
    }
    return mix(clear_along_xy(corner, between.xy), clear_along_xy(corner + vec3(0, 0, 1), between.xy), between.z);
}

// The affine pair of a piece of a segment; lengths in segments.
fn pair_of(q0: f32, e0: f32, q1: f32, e1: f32, length: f32, depth: f32) -> vec2<f32> {
    let x = mean_extinction(q0, e0, q1, e1) * depth;
    let pair = vec2(exp(-x), length * mean_transmittance(x));
    return select(pair, vec2(0.0), max(q0, q1) < OPAQUE);
}

fn compose(near: vec2<f32>, behind: vec2<f32>) -> vec2<f32> {
    return vec2(near.x * behind.x, near.y + near.x * behind.y);
}

// Pairs of the segment from p: whole, and from the ray's start on.
struct Segment {
    whole: vec2<f32>,
    head: vec2<f32>,
}

fn segment(p: vec3<i32>, q0: f32, e0: f32, q1: f32, e1: f32) -> Segment {
    var found = Segment(vec2(1.0, 0.0), vec2(1.0, 0.0));
    let length = 1.0 / f32(params.pieces);
    var qa = q0;
    var ea = e0;
    for (var piece = 1u; piece <= params.pieces; piece++) {
        var qb = q1;
        var eb = e1;
        if piece < params.pieces {
            qb = clear_between(p, vec3<f32>(params.step) * (f32(piece) * length));
            eb = entropy(qb);
        }
        let pair = pair_of(qa, ea, qb, eb, length, params.depth);
        found.whole = compose(found.whole, pair);
        // The share of this piece that lies before the ray's start.
        let before = params.start * f32(params.pieces) - f32(piece - 1u);
        if before <= 0.0 {
            found.head = compose(found.head, pair);
        } else if before < 1.0 {
            let qs = mix(qa, qb, before);
            let rest = 1.0 - before;
            found.head = pair_of(qs, entropy(qs), qb, eb, rest * length, rest * params.depth);
        }
        qa = qb;
        ea = eb;
    }
    return found;
}

fn outside(p: vec3<i32>) -> bool {
    return any(p < vec3(0)) || any(p >= vec3<i32>(params.dims));
}

fn subtract(p: vec3<i32>, occluded: f32) {
    let brick = vec3<u32>(p) / 8u;
    if todo.brick[(brick.z * params.bricks.y + brick.y) * params.bricks.x + brick.x] == 0u {
        return;
    }
    var before = 1.0;
    if (params.flags & FIRST) == 0u {
        before = textureLoad(ambient, p).r;
    }
    textureStore(ambient, p, vec4(before - occluded, 0.0, 0.0, 0.0));
}

// One workgroup a run of blocks of a tile of 8x8 lines.
@compute @workgroup_size(8, 8, 1)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let entry = group.x + group.y * GROUPS_PER_ROW;
    if entry >= list.head[params.list].count {
        return;
    }
    let run = list.runs[list.head[params.list].at + entry];
    let dims = vec3<i32>(params.dims);
    let line = line_at(run.tile, local.xy, params.tiles, params.axis, dims);
    if any(line.xy >= line_extent(params.axis, dims)) {
        return;
    }
    let block = i32(params.block);
    let steps = line_steps(line.z, params.axis, dims, params.step);
    // Modulo the volume, for positions that wrap round.
    let advance = wrapped(params.step, dims);

    // The voxel whose ray's first window begins the run's first block, and its own segment.
    var i = i32(run.first) * block - 1;
    var trail = line_position(line, i, params.axis, dims, params.step);
    var p = trail;
    var q = clear_at(p);
    var e = entropy(q);
    var head = vec2(1.0, 0.0);
    var head_gap = false;
    // For each segment of a block: suffix pair, with the sign bit of t where a gap follows; head pair.
    var slots: array<vec4<f32>, MOST>;
    // Last slot of the block before that has a gap behind it.
    var closed = -1;
    let whole = params.far + (1.0 - params.start);

    for (var b = -1; b <= i32(run.count); b++) {
        var prefix = vec2(1.0, 0.0);
        var gap_in_prefix = false;
        var last_gap = -1;
        // Before the first block only the segment in front of it is wanted.
        for (var t = select(0, block - 1, b < 0); t < block; t++) {
            if b > 0 {
                let old = slots[t];
                // What lies behind the suffix: the prefix of this block, or free space behind a gap.
                let behind = select(prefix, vec2(1.0, f32(t)), t <= closed);
                let sum = select(old.y + abs(old.x) * behind.y, params.far, head_gap);
                let through = head.y + head.x * select(sum, 0.0, params.far == 0.0);
                if i >= 0 && i < steps {
                    subtract(trail, max(params.share * (whole - through), 0.0));
                }
                i++;
                trail += advance;
                trail -= select(vec3(0), dims, trail >= dims);
                head = old.zw;
                head_gap = (bitcast<u32>(old.x) >> 31u) == 1u;
            }
            let gap = outside(p + params.step);
            var next = p + advance;
            next -= select(vec3(0), dims, next >= dims);
            let q_next = 1.0 - textureLoad(opacity, next, 0).r;
            let e_next = entropy(q_next);
            let found = segment(p, q, e, select(q_next, 1.0, gap), select(e_next, 0.0, gap));
            slots[t] = vec4(select(found.whole.x, -found.whole.x, gap), found.whole.y, found.head);
            prefix = compose(prefix, select(found.whole, vec2(1.0, 1.0), gap_in_prefix));
            if gap {
                gap_in_prefix = true;
                last_gap = t;
            }
            p = next;
            q = q_next;
            e = e_next;
        }
        if b < 0 {
            let own = slots[block - 1];
            head = own.zw;
            head_gap = (bitcast<u32>(own.x) >> 31u) == 1u;
            continue;
        }
        closed = last_gap;
        var suffix = vec2(1.0, 0.0);
        for (var t = block - 1; t >= 0; t--) {
            let own = slots[t];
            let gap = (bitcast<u32>(own.x) >> 31u) == 1u;
            suffix = compose(vec2(abs(own.x), own.y), select(suffix, vec2(1.0, f32(block - 1 - t)), gap));
            slots[t] = vec4(select(suffix.x, -suffix.x, gap), suffix.y, own.zw);
        }
    }
}
