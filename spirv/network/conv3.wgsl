// Convolutions of 3³ voxels, without bias, zeros outside (DVAO §3.2, Fig. 2b), with sums in f32:
//
// `first`   of the grid itself
// `plain`   of one tensor, or of two beside each other, normalised
// `doubled` the same on a grid twice as fine, where every voxel of what goes in is repeated 2³ times: of the 27 weights those that meet
//           the same voxel are summed beforehand, which leaves 8, others for each of the 8 voxels
// `last`    as `plain` to one output, whose sigmoid is the net's
//
// Of the others' sums Mish is stored, which is what everything after takes. A workgroup takes the outputs of a block for 8 x 8 x 8 voxels, an
// invocation eight of these voxels, on top of each other, so that a weight that is read serves eight sums, and seven of the eight voxels that are read
// of a tile serve the next voxel of the kernel above as well.

struct Conv3Params {
    // grid of what goes in
    dims: vec3<u32>,
    // blocks that go in
    blocks: u32,
    // of them those of the first tensor; the others are of the second
    first_blocks: u32,
    // entries of the first block of each in the norms
    norm: u32,
    norm_beside: u32,
    // blocks that come out
    out_blocks: u32,
    // first item to work on
    base: u32,
    // of `last`: voxels that are given, from `low` up to `high`
    low: vec3<u32>,
    high: vec3<u32>,
    // of `last`: the grid that they are given to, and where in it the first voxel would be
    given: vec3<u32>,
    at: vec3<i32>,
}

struct Weights {
    // of an output block, an input block, a voxel of the kernel and an input: 8 outputs, in two entries. Of `last`, of an input block and a voxel:
    // 8 inputs
    all: array<vec4<u32>>,
}

#include "shared/grid.wgsl"
#include "shared/tile.wgsl"
#include "shared/mish.wgsl"

var<immediate> params: Conv3Params;
@group(0) @binding(0) var<storage, read> source: Tensor;
@group(0) @binding(1) var<storage, read> beside: Tensor;
@group(0) @binding(2) var<storage, read> norms: Norms;
@group(0) @binding(3) var<storage, read> weights: Weights;
@group(0) @binding(4) var<storage, read_write> out: Tensor;
@group(0) @binding(5) var<storage, read> grid: Grid;
@group(0) @binding(6) var<storage, read_write> values: Grid;

// Entries of the weights of one voxel of a kernel.
const ENTRIES = CHANNELS;

// Of an invocation's voxels, 8 outputs each.
struct Sums {
    a: Eight,
    b: Eight,
    c: Eight,
    d: Eight,
    e: Eight,
    f: Eight,
    g: Eight,
    h: Eight,
}

const ZERO = Eight(vec4(0.0), vec4(0.0));
const NOTHING = Sums(ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO);

// Of a tile, the eight voxels that an invocation's meet at one voxel of the kernel, as they are stored.
struct Column {
    a: vec4<u32>,
    b: vec4<u32>,
    c: vec4<u32>,
    d: vec4<u32>,
    e: vec4<u32>,
    f: vec4<u32>,
    g: vec4<u32>,
    h: vec4<u32>,
}

fn column(at: u32) -> Column {
    return Column(
        tile[at + 0u * PLANE],
        tile[at + 1u * PLANE],
        tile[at + 2u * PLANE],
        tile[at + 3u * PLANE],
        tile[at + 4u * PLANE],
        tile[at + 5u * PLANE],
        tile[at + 6u * PLANE],
        tile[at + 7u * PLANE],
    );
}

// The one above, of which only the topmost voxel, in the tile at `top`, is not in a column.
fn above(lower: Column, top: u32) -> Column {
    return Column(lower.b, lower.c, lower.d, lower.e, lower.f, lower.g, lower.h, tile[top]);
}

// One input of a voxel.
fn with_one(sum: Eight, x: f32, w: Eight) -> Eight {
    return Eight(sum.low + x * w.low, sum.high + x * w.high);
}

// One input of all voxels, by its weights.
fn with_input(sums: Sums, w: u32, x: vec4<f32>, y: vec4<f32>) -> Sums {
    let all = unpacked(weights.all[w]);
    return Sums(
        with_one(sums.a, x.x, all),
        with_one(sums.b, x.y, all),
        with_one(sums.c, x.z, all),
        with_one(sums.d, x.w, all),
        with_one(sums.e, y.x, all),
        with_one(sums.f, y.y, all),
        with_one(sums.g, y.z, all),
        with_one(sums.h, y.w, all),
    );
}

// Two inputs of a voxel: a sum that is taken serves both.
fn with_two(sum: Eight, x: vec2<f32>, p: Eight, q: Eight) -> Eight {
    return with_one(with_one(sum, x.x, p), x.y, q);
}

// Two inputs of all voxels, by their weights.
fn with_pair(sums: Sums, w: u32, a: vec2<f32>, b: vec2<f32>, c: vec2<f32>, d: vec2<f32>, e: vec2<f32>, f: vec2<f32>, g: vec2<f32>, h: vec2<f32>) -> Sums {
    let p = unpacked(weights.all[w]);
    let q = unpacked(weights.all[w + 1u]);
    return Sums(
        with_two(sums.a, a, p, q),
        with_two(sums.b, b, p, q),
        with_two(sums.c, c, p, q),
        with_two(sums.d, d, p, q),
        with_two(sums.e, e, p, q),
        with_two(sums.f, f, p, q),
        with_two(sums.g, g, p, q),
        with_two(sums.h, h, p, q),
    );
}

// All inputs of a block of all voxels, by the weights of one voxel of the kernel.
fn with_voxel(start: Sums, w: u32, x: Column) -> Sums {
    let a = unpacked(x.a);
    let b = unpacked(x.b);
    let c = unpacked(x.c);
    let d = unpacked(x.d);
    let e = unpacked(x.e);
    let f = unpacked(x.f);
    let g = unpacked(x.g);
    let h = unpacked(x.h);
    var sums = start;
    sums = with_pair(sums, w, a.low.xy, b.low.xy, c.low.xy, d.low.xy, e.low.xy, f.low.xy, g.low.xy, h.low.xy);
    sums = with_pair(sums, w + 2u, a.low.zw, b.low.zw, c.low.zw, d.low.zw, e.low.zw, f.low.zw, g.low.zw, h.low.zw);
    sums = with_pair(sums, w + 4u, a.high.xy, b.high.xy, c.high.xy, d.high.xy, e.high.xy, f.high.xy, g.high.xy, h.high.xy);
    sums = with_pair(sums, w + 6u, a.high.zw, b.high.zw, c.high.zw, d.high.zw, e.high.zw, f.high.zw, g.high.zw, h.high.zw);
    return sums;
}

// Where an input block is, and its mean and deviation.
struct Source {
    first: bool,
    begin: u32,
    norm: Norm,
}

fn source_of(block: u32) -> Source {
    let first = block < params.first_blocks;
    let of_tensor = select(block - params.first_blocks, block, first);
    let norm = norms.all[select(params.norm_beside, params.norm, first) + of_tensor];
    return Source(first, of_tensor * params.dims.x * params.dims.y * params.dims.z, norm);
}

// A voxel of it, normalised; 0 outside the grid. Below the border it is a large number.
fn voxel_of(block: Source, place: vec3<u32>) -> vec4<u32> {
    if any(place >= params.dims) {
        return vec4(0u);
    }
    let at = block.begin + voxel_at(place, params.dims);
    if block.first {
        return normalised(source.all[at], block.norm);
    }
    return normalised(beside.all[at], block.norm);
}

// Takes an input block into workgroup memory, behind a barrier.
fn load_block(number: u32, corner: vec3<u32>, lane: u32) {
    let block = source_of(number);
    for (var i = lane; i < HELD; i += TEAM) {
        tile[i] = voxel_of(block, corner + held(i) - 1u);
    }
}

// The part of it that one of the 2³ voxels needs.
fn load_part(number: u32, corner: vec3<u32>, which: vec3<u32>, lane: u32) {
    let block = source_of(number);
    for (var i = lane; i < PART; i += TEAM) {
        let at = which + vec3(i % PART_X, i / PART_X % PART_Y, i / (PART_X * PART_Y));
        tile[at.z * PLANE + at.y * ROW + at.x] = voxel_of(block, corner + at - 1u);
    }
}

fn store(place: vec3<u32>, dims: vec3<u32>, block: u32, sums: Eight) {
    if all(place < dims) {
        out.all[block * dims.x * dims.y * dims.z + voxel_at(place, dims)] = packed(Eight(mish(sums.low), mish(sums.high)));
    }
}

// Those of all voxels, so many apart.
fn store_all(place: vec3<u32>, apart: u32, dims: vec3<u32>, block: u32, sums: Sums) {
    store(place, dims, block, sums.a);
    store(place + vec3(0u, 0u, 1u * apart), dims, block, sums.b);
    store(place + vec3(0u, 0u, 2u * apart), dims, block, sums.c);
    store(place + vec3(0u, 0u, 3u * apart), dims, block, sums.d);
    store(place + vec3(0u, 0u, 4u * apart), dims, block, sums.e);
    store(place + vec3(0u, 0u, 5u * apart), dims, block, sums.f);
    store(place + vec3(0u, 0u, 6u * apart), dims, block, sums.g);
    store(place + vec3(0u, 0u, 7u * apart), dims, block, sums.h);
}

@compute @workgroup_size(TEAM)
fn plain(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = params.base + group.x;
    let out_block = item % params.out_blocks;
    let corner = corner_of(item / params.out_blocks);
    let here = place_of(lane);
    var sums = NOTHING;
    for (var block = 0u; block < params.blocks; block++) {
        workgroupBarrier();
        load_block(block, corner, lane);
        workgroupBarrier();
        let w = (out_block * params.blocks + block) * 27u * ENTRIES;
        for (var k = 0u; k < 9u; k++) {
            let at = (here.y + k / 3u) * ROW + here.x + k % 3u;
            var x = column(at);
            for (var z = 0u; z < 3u; z++) {
                if z > 0u {
                    x = above(x, at + (z + 7u) * PLANE);
                }
                sums = with_voxel(sums, w + (9u * z + k) * ENTRIES, x);
            }
        }
    }
    store_all(corner + here, 1u, params.dims, out_block, sums);
}

@compute @workgroup_size(TEAM)
fn doubled(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = params.base + group.x;
    // Which of the 2³ voxels, and so which weights.
    let child = item % 8u;
    let out_block = item / 8u % params.out_blocks;
    let corner = corner_of(item / (8u * params.out_blocks));
    let which = vec3(child & 1u, child >> 1u & 1u, child >> 2u);
    let here = place_of(lane);
    let first = here + which;
    var sums = NOTHING;
    for (var block = 0u; block < params.blocks; block++) {
        workgroupBarrier();
        load_part(block, corner, which, lane);
        workgroupBarrier();
        let w = ((out_block * params.blocks + block) * 8u + child) * 8u * ENTRIES;
        for (var k = 0u; k < 4u; k++) {
            let at = first.z * PLANE + (first.y + k / 2u) * ROW + first.x + k % 2u;
            var x = column(at);
            for (var z = 0u; z < 2u; z++) {
                if z > 0u {
                    x = above(x, at + (z + 7u) * PLANE);
                }
                sums = with_voxel(sums, w + (4u * z + k) * ENTRIES, x);
            }
        }
    }
    let fine = 2u * (corner + here) + which;
    store_all(fine, 2u, 2u * params.dims, out_block, sums);
}

// Opacity of a voxel of the grid.
fn met(place: vec3<u32>) -> f32 {
    if all(place < params.dims) {
        return grid.all[voxel_at(place, params.dims)];
    }
    return 0.0;
}

// Weights as those of `plain` with one input.
@compute @workgroup_size(TEAM)
fn first(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = params.base + group.x;
    let out_block = item % params.out_blocks;
    let here = corner_of(item / params.out_blocks) + place_of(lane);
    var sums = NOTHING;
    let w = out_block * 27u;
    for (var k = 0u; k < 27u; k++) {
        let at = here + vec3(k % 3u, k / 3u % 3u, k / 9u) - 1u;
        let up = vec3(0u, 0u, 1u);
        let x = vec4(met(at), met(at + up), met(at + 2u * up), met(at + 3u * up));
        let y = vec4(met(at + 4u * up), met(at + 5u * up), met(at + 6u * up), met(at + 7u * up));
        sums = with_input(sums, w + k, x, y);
    }
    store_all(here, 1u, params.dims, out_block, sums);
}

// What a block's inputs of a voxel add to the one output.
fn of_one(w: Eight, words: vec4<u32>) -> f32 {
    let x = unpacked(words);
    return dot(x.low, w.low) + dot(x.high, w.high);
}

fn of_four(w: Eight, a: vec4<u32>, b: vec4<u32>, c: vec4<u32>, d: vec4<u32>) -> vec4<f32> {
    return vec4(of_one(w, a), of_one(w, b), of_one(w, c), of_one(w, d));
}

fn give(place: vec3<u32>, sum: f32) {
    if all(place >= params.low) && all(place < params.high) {
        let there = vec3<u32>(vec3<i32>(place) + params.at);
        values.all[voxel_at(there, params.given)] = 1.0 / (1.0 + exp(-sum));
    }
}

@compute @workgroup_size(TEAM)
fn last(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let corner = corner_of(params.base + group.x);
    let here = place_of(lane);
    var sums = vec4(0.0);
    var upper = vec4(0.0);
    for (var block = 0u; block < params.blocks; block++) {
        workgroupBarrier();
        load_block(block, corner, lane);
        workgroupBarrier();
        let w = block * 27u;
        for (var k = 0u; k < 9u; k++) {
            let at = (here.y + k / 3u) * ROW + here.x + k % 3u;
            var x = column(at);
            for (var z = 0u; z < 3u; z++) {
                if z > 0u {
                    x = above(x, at + (z + 7u) * PLANE);
                }
                let both = unpacked(weights.all[w + 9u * z + k]);
                sums += of_four(both, x.a, x.b, x.c, x.d);
                upper += of_four(both, x.e, x.f, x.g, x.h);
            }
        }
    }
    give(corner + here, sums.x);
    give(corner + here + vec3(0u, 0u, 1u), sums.y);
    give(corner + here + vec3(0u, 0u, 2u), sums.z);
    give(corner + here + vec3(0u, 0u, 3u), sums.w);
    give(corner + here + vec3(0u, 0u, 4u), upper.x);
    give(corner + here + vec3(0u, 0u, 5u), upper.y);
    give(corner + here + vec3(0u, 0u, 6u), upper.z);
    give(corner + here + vec3(0u, 0u, 7u), upper.w);
}
