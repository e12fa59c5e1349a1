// Line sweep: local ambient occlusion along one lattice direction and its reverse for every voxel, at a cost that hardly
// depends on the radius (method.md section 4). All voxels of a lattice line share its segments; a voxel's ray is a segment
// that begins at the start offset and a window of whole segments behind it, each an affine pair (t, s): T' = t T, S' = S + s T.
//
// Windows by scans of blocks (van Herk 1992, Gil and Werman 1993), on two levels so that all but a few numbers stay in
// registers: a line is cut into chunks of a few segments. The windows that begin in one chunk are a suffix of it, then a middle
// that they share, then a prefix of the chunk that lies one window further on. An invocation walks both chunks at once, `trail`
// and `lead`; the middle is composed from whole chunks that `lead` has passed. Backwards the same three parts serve
// the rays that end in `trail` and begin in `lead`. No subtraction, and no value depends on samples outside its own window or
// on which other voxels are computed, for chunks are fixed in the line.
//
// Lines are walked along one axis, one voxel a step in every line, and wrap round along the other two: so lanes stay side by
// side, all lines are equally long and together they meet each voxel once. Where a line leaves the volume (a gap) the window
// goes on through free space, and the next line begins.
//
// What a ray contributes is a whole number, so that it can be taken back. To amend values only the chunks are walked whose rays meet
// a change, through the former opacities and then through the new ones. There both rays over the same segments are told
// apart, the one forwards from the voxel of `trail` and the one backwards from the voxel that `lead` reaches, for the other
// rays of these voxels need not have changed. Chunks of either that meet no brick with opacity are not read.

struct SweepParams {
    dims: vec3<u32>,
    // axis along which lines are walked
    axis: u32,
    // the lattice direction
    step: vec3<i32>,
    // segments behind the first, at least 1
    window: u32,
    bricks: vec3<u32>,
    // FIRST, AMEND, ADD
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
    // segments behind the first: `window`, or 0
    far: f32,
    // weight of a direction in parts / length of the ray in segments
    share: f32,
    // the lattice direction without whole sizes of the volume
    advance: vec3<i32>,
    // so many segments pass one border of bricks on each axis at most
    part: i32,
}

#include "shared/parts.wgsl"
#include "shared/segment.wgsl"
#include "shared/sweep.wgsl"
#include "shared/todo.wgsl"

// The first direction, which begins the sum.
const FIRST = 1u;
// Only the rays that meet a changed brick, of bricks that have a value; those of bricks to compute anew otherwise.
const AMEND = 2u;
// Contributions are taken back, not made.
const ADD = 4u;
// Longest window.
const MOST = 128u;
// Chunks of `lead` that are remembered: those of the longest window.
const RING = MOST / u32(CHUNK);

var<immediate> params: SweepParams;
// Read as a storage image: for one texel on a processor at half the cost of a sampled one.
@group(0) @binding(0) var opacity: texture_storage_3d<r16unorm, read>;
@group(0) @binding(1) var<storage, read> list: SweepList;
@group(0) @binding(2) var<storage, read> todo: Todo;
@group(0) @binding(3) var ambient: texture_storage_3d<r16unorm, read_write>;
@group(0) @binding(4) var<storage, read> solid: Solid;

// Transmittance q and ln q.
const FREE = vec2(1.0, 0.0);

fn clear(q: f32) -> vec2<f32> {
    return vec2(q, logarithm(q));
}

// Transmittance of a lattice point; 1 outside the volume.
fn clear_at(p: vec3<i32>) -> f32 {
    let dims = vec3<i32>(params.dims);
    let held = clamp(p, vec3(0), dims - 1);
    return 1.0 - select(0.0, textureLoad(opacity, held).r, all(held == p));
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
fn pair_of(a: vec2<f32>, b: vec2<f32>, length: f32, depth: f32) -> vec2<f32> {
    let x = mean_extinction(a.x, a.y, b.x, b.y) * depth;
    let t = exp(-x);
    return select(vec2(t, length * mean_transmittance(x, t)), vec2(0.0), max(a.x, b.x) < OPAQUE);
}

fn compose(near: vec2<f32>, behind: vec2<f32>) -> vec2<f32> {
    return vec2(near.x * behind.x, near.y + near.x * behind.y);
}

// The pair of what is left of a piece behind a share of it.
fn pair_behind(share: f32, a: vec2<f32>, b: vec2<f32>, length: f32, depth: f32) -> vec2<f32> {
    return pair_of(clear(mix(a.x, b.x, share)), b, (1.0 - share) * length, (1.0 - share) * depth);
}

// Pairs of one segment: whole, with its sum `back` from b to a, and from a ray's start at either end.
struct Pairs {
    whole: vec2<f32>,
    back: f32,
    head: vec2<f32>,
    head_back: vec2<f32>,
}

// From the lattice point p to p + step.
fn pairs_of(fine: bool, p: vec3<i32>, step: vec3<i32>, a: vec2<f32>, b: vec2<f32>) -> Pairs {
    if !fine {
        let whole = pair_of(a, b, 1.0, params.depth);
        return Pairs(whole, whole.y, pair_behind(params.start, a, b, 1.0, params.depth),
            pair_behind(params.start, b, a, 1.0, params.depth));
    }
    var found = Pairs(vec2(1.0, 0.0), 0.0, vec2(1.0, 0.0), vec2(1.0, 0.0));
    let pieces = f32(params.pieces);
    let length = 1.0 / pieces;
    var near = a;
    for (var piece = 1u; piece <= params.pieces; piece++) {
        var end = b;
        if piece < params.pieces {
            end = clear(clear_between(p, vec3<f32>(step) * (f32(piece) * length)));
        }
        let pair = pair_of(near, end, length, params.depth);
        found.whole = compose(found.whole, pair);
        found.back = pair.y + pair.x * found.back;
        // The share of this piece that lies before the ray's start, seen from either end.
        let before = params.start * pieces - f32(piece - 1u);
        if before <= 0.0 {
            found.head = compose(found.head, pair);
        } else if before < 1.0 {
            found.head = pair_behind(before, near, end, length, params.depth);
        }
        let behind = params.start * pieces - f32(params.pieces - piece);
        if behind <= 0.0 {
            found.head_back = compose(pair, found.head_back);
        } else if behind < 1.0 {
            found.head_back = compose(pair_behind(behind, end, near, length, params.depth), found.head_back);
        }
        near = end;
    }
    return found;
}

// Consecutive segments, walked forwards and backwards: transmittance t up to the other end, which a gap makes 0, and a ray's
// sum, s + n free where a gap lets it go on for n segments of free space; backwards the same.
struct Link {
    t: f32,
    s: f32,
    free: f32,
    s_back: f32,
    free_back: f32,
}

// `a` of length `a_length`, then `b`.
fn join(a: Link, a_length: f32, b: Link, b_length: f32) -> Link {
    return Link(
        a.t * b.t,
        a.s + a.t * b.s + a.free * b_length,
        a.free + a.t * b.free,
        b.s_back + b.t * a.s_back + b.free_back * a_length,
        b.free_back + b.t * a.free_back,
    );
}

const FREE_LINK = Link(1.0, 1.0, 0.0, 1.0, 0.0);
const NOTHING = Link(1.0, 0.0, 0.0, 0.0, 0.0);

struct Point {
    p: vec3<i32>,
    clear: vec2<f32>,
}

// From one voxel of a line to the next.
struct Segment {
    link: Link,
    // t, s, free from the ray's start: forwards, backwards
    head: vec3<f32>,
    head_back: vec3<f32>,
}

fn segment(fine: bool, a: Point, b: Point, gap: bool) -> Segment {
    let there = pairs_of(fine, a.p, params.step, a.clear, select(b.clear, FREE, gap));
    if gap {
        let back = pairs_of(fine, b.p, -params.step, b.clear, FREE);
        return Segment(
            Link(0.0, there.whole.y, there.whole.x, back.whole.y, back.whole.x),
            vec3(0.0, there.head.yx),
            vec3(0.0, back.head.yx),
        );
    }
    return Segment(
        Link(there.whole.x, there.whole.y, 0.0, there.back, 0.0),
        vec3(there.head, 0.0),
        vec3(there.head_back, 0.0),
    );
}

fn point(p: vec3<i32>) -> Point {
    return Point(p, clear(1.0 - textureLoad(opacity, p).r));
}

struct Step {
    p: vec3<i32>,
    // whether the line left the volume on the way
    gap: bool,
}

fn step_from(p: vec3<i32>, advance: vec3<i32>) -> Step {
    let dims = vec3<i32>(params.dims);
    let next = p + advance;
    let left = vec3<u32>(next) >= params.dims;
    let gap = any(left) || any(advance != params.step);
    return Step(next - select(vec3(0), select(dims, -dims, params.step < vec3(0)), left), gap);
}

// A ray's contribution in parts, whole so that the sum is exact in any order and can be taken back.
fn occluded(unobstructed: f32, sum: f32) -> f32 {
    return round(params.share * max(unobstructed - sum, 0.0));
}

fn subtract(p: vec3<i32>, parts: f32) {
    if parts == 0.0 && (params.flags & FIRST) == 0u {
        return;
    }
    let word = todo.brick[brick_index(vec3<u32>(p) / BRICK, params.bricks)];
    if (word & (TODO | ANEW)) != select(TODO | ANEW, TODO, (params.flags & AMEND) != 0u) {
        return;
    }
    var before = PARTS;
    if (params.flags & FIRST) == 0u {
        before = round(PARTS * textureLoad(ambient, p).r);
    }
    textureStore(ambient, p, vec4((before - parts) / PARTS, 0.0, 0.0, 0.0));
}

// Whether the next `size` segments from p stay inside the volume and meet no brick with opacity, samples between lattice points
// included: what these interpolate lies in the box of their segment. By V_o alone, so that a value is what it is.
fn free_from(p: vec3<i32>, size: i32) -> bool {
    var solid_bits = 0u;
    for (var i = 0; i < size; i += params.part) {
        let a = p + i * params.step;
        let b = p + min(i + params.part, size) * params.step;
        let low = min(a, b);
        let high = max(a, b);
        if any(low < vec3(0)) || any(high >= vec3<i32>(params.dims)) {
            return false;
        }
        let brick = vec3<u32>(low) / BRICK;
        let passed = vec3<u32>(high) / BRICK - brick;
        let bits = solid.bits[brick_index(brick, params.bricks)];
        solid_bits |= bits >> (passed.x + 2u * passed.y + 4u * passed.z);
    }
    return (solid_bits & 1u) == 0u;
}

// One workgroup a run of chunks of a tile of lines. `long`: windows fill a chunk, so that no place of it is asked for.
fn walk(fine: bool, long: bool, group: vec3<u32>, local: vec3<u32>) {
    let entry = item_of_group(group);
    if entry >= list.head[params.list].count {
        return;
    }
    let run = list.runs[list.head[params.list].at + entry];
    let dims = vec3<i32>(params.dims);
    let line = line_at(run.tile, local.xy, params.tiles, params.axis, dims);
    if any(line.xy >= line_extent(params.axis, dims)) {
        return;
    }
    let steps = line_steps(line.z, params.axis, dims, params.step);
    let advance = params.advance;
    let window = i32(params.window);
    let size = select(chunk_size(window), CHUNK, long);
    // The middle: so many segments that are the last of their chunk, then so many whole chunks.
    let whole = chunks_in(window) - 1;
    let odd = window - size - whole * size;
    let middle_length = f32(window - size);
    // 0 where a ray is its head only.
    let goes_on = min(params.far, 1.0);
    let unobstructed = params.far + 1.0 - params.start;
    let amends = (params.flags & AMEND) != 0u;
    let sign = select(1.0, -1.0, (params.flags & ADD) != 0u);

    let first = i32(run.first) - chunk_lag(window);
    let end = first + i32(run.count);
    // What the first middle is composed of; before a line's first chunk there is a gap.
    let begin = select(first - whole - 1, first, run.first == 0u);

    // Of the last chunks of `lead`: all, and the `odd` last segments.
    var chunks: array<Link, RING>;
    var odds: array<Link, RING>;
    // Contributions of rays backwards, until their voxels have those forwards.
    var backwards: array<f32, MOST + 1>;
    var place = 0;

    var lead = point(line_position(line, begin * size + window, params.axis, dims, params.step));
    var trail = point(line_position(line, first * size, params.axis, dims, params.step));
    var voxel = trail.p;
    for (var c = begin; c < end; c++) {
        // Of each place in `trail`: the ray's t, s, free from its start to the chunk's end; the sum back from there.
        var suffixes: array<vec3<f32>, CHUNK>;
        var suffixes_back: array<f32, CHUNK>;
        var middle = odds[u32(c - whole - 1) % RING];
        if c >= first {
            var links: array<Link, CHUNK>;
            if free_from(trail.p, size) {
                for (var i = 0; i < CHUNK; i++) {
                    links[i] = FREE_LINK;
                    suffixes[i] = vec3(goes_on, 1.0 - params.start, 0.0);
                }
                trail = Point(trail.p + size * params.step, FREE);
            } else {
                for (var i = 0; i < CHUNK; i++) {
                    if long || i < size {
                        let next = step_from(trail.p, advance);
                        let to = point(next.p);
                        let found = segment(fine, trail, to, next.gap);
                        links[i] = found.link;
                        suffixes[i] = found.head * vec3(goes_on, 1.0, goes_on);
                        trail = to;
                    }
                }
            }
            var suffix = NOTHING;
            for (var k = 0; k < CHUNK; k++) {
                let i = CHUNK - 1 - k;
                if long || i < size {
                    let length = f32(size - 1 - i);
                    let head = suffixes[i];
                    suffixes[i] = vec3(
                        head.x * suffix.t,
                        head.y + head.x * suffix.s + head.z * length,
                        head.z + head.x * suffix.free,
                    );
                    suffix = join(links[i], 1.0, suffix, length);
                    suffixes_back[i] = suffix.s_back;
                }
            }
            var length = f32(odd);
            for (var k = c - whole; k < c; k++) {
                middle = join(middle, length, chunks[u32(k) % RING], f32(size));
                length += f32(size);
            }
        }
        var chunk = NOTHING;
        var last = NOTHING;
        var ahead = lead.p;
        var lead_links: array<Link, CHUNK>;
        var lead_heads: array<vec3<f32>, CHUNK>;
        if free_from(lead.p, size) {
            for (var i = 0; i < CHUNK; i++) {
                lead_links[i] = FREE_LINK;
                lead_heads[i] = vec3(1.0, 1.0 - params.start, 0.0);
            }
            lead = Point(lead.p + size * params.step, FREE);
        } else {
            for (var i = 0; i < CHUNK; i++) {
                if long || i < size {
                    let next = step_from(lead.p, advance);
                    let to = point(next.p);
                    let found = segment(fine, lead, to, next.gap);
                    lead_links[i] = found.link;
                    lead_heads[i] = found.head_back;
                    lead = to;
                }
            }
        }
        for (var i = 0; i < CHUNK; i++) {
            if long || i < size {
                let head = lead_heads[i];
                let link = lead_links[i];
                let rest = middle.s_back + middle.t * suffixes_back[i] + middle.free_back * f32(size - i);
                let back = head.y + head.x * goes_on * rest + head.z * params.far;
                middle = join(middle, middle_length + f32(i), link, 1.0);
                chunk = join(chunk, f32(i), link, 1.0);
                if i >= size - odd {
                    last = join(last, f32(i - (size - odd)), link, 1.0);
                }
                if c >= first {
                    let suffix = suffixes[i];
                    let sum = suffix.y + suffix.x * middle.s + suffix.z * (middle_length + f32(i + 1));
                    let at = c * size + i;
                    var parts = sign * occluded(unobstructed, sum);
                    let parts_back = sign * occluded(unobstructed, back);
                    if amends {
                        ahead = step_from(ahead, advance).p;
                        let at_back = at + window + 1;
                        if at_back >= 0 && at_back < steps {
                            subtract(ahead, parts_back);
                        }
                    } else {
                        parts += backwards[place];
                        backwards[place] = parts_back;
                        place = select(place + 1, 0, place == window);
                    }
                    if at >= 0 && at < steps {
                        subtract(voxel, parts);
                    }
                    voxel = step_from(voxel, advance).p;
                }
            }
        }
        chunks[u32(c) % RING] = chunk;
        odds[u32(c) % RING] = last;
    }
}

@compute @workgroup_size(TILE.x, TILE.y, 1)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    walk(false, true, group, local);
}

// Windows shorter than a chunk.
@compute @workgroup_size(TILE.x, TILE.y, 1)
fn short(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    walk(false, false, group, local);
}

// Segments of more than one piece.
@compute @workgroup_size(TILE.x, TILE.y, 1)
fn pieces(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    walk(true, false, group, local);
}
