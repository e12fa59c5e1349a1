// Convolutions of 3³ voxels, without bias, zeros outside (DVAO §3.2, Fig. 2b), with sums in f32:
//
// `first`   of the grid itself
// `plain`   of one tensor, or of two beside each other, normalised
// `doubled` the same on a grid twice as fine, where every voxel of what goes in is repeated 2³ times: of the 27 weights those that meet
//           the same voxel are summed beforehand, which leaves 8, others for each of the 8 voxels
// `last`    as `plain` to one output, whose sigmoid is the net's
//
// Of the others' sums Mish is stored, which is what everything after takes. A workgroup takes the outputs of a block for 8 x 8 x 8 voxels, an
// invocation eight of these voxels, on top of each other, so that what is read of weights and of tensors serves several sums.

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

struct Grid {
    all: array<f32>,
}

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
    a_low: vec4<f32>,
    a_high: vec4<f32>,
    b_low: vec4<f32>,
    b_high: vec4<f32>,
    c_low: vec4<f32>,
    c_high: vec4<f32>,
    d_low: vec4<f32>,
    d_high: vec4<f32>,
    e_low: vec4<f32>,
    e_high: vec4<f32>,
    f_low: vec4<f32>,
    f_high: vec4<f32>,
    g_low: vec4<f32>,
    g_high: vec4<f32>,
    h_low: vec4<f32>,
    h_high: vec4<f32>,
}

const NOTHING = Sums(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));

// An input of all voxels, by its weights.
fn with_input(sums: Sums, w: u32, x: vec4<f32>, y: vec4<f32>) -> Sums {
    let both = unpacked(weights.all[w]);
    let low = both.low;
    let high = both.high;
    return Sums(
        sums.a_low + x.x * low,
        sums.a_high + x.x * high,
        sums.b_low + x.y * low,
        sums.b_high + x.y * high,
        sums.c_low + x.z * low,
        sums.c_high + x.z * high,
        sums.d_low + x.w * low,
        sums.d_high + x.w * high,
        sums.e_low + y.x * low,
        sums.e_high + y.x * high,
        sums.f_low + y.y * low,
        sums.f_high + y.y * high,
        sums.g_low + y.z * low,
        sums.g_high + y.z * high,
        sums.h_low + y.w * low,
        sums.h_high + y.w * high,
    );
}

// All inputs of a block of all voxels, by the weights of one voxel of the kernel.
fn with_voxel(start: Sums, w: u32, a: Eight, b: Eight, c: Eight, d: Eight, e: Eight, f: Eight, g: Eight, h: Eight) -> Sums {
    var sums = with_input(start, w, vec4(a.low.x, b.low.x, c.low.x, d.low.x), vec4(e.low.x, f.low.x, g.low.x, h.low.x));
    sums = with_input(sums, w + 1u, vec4(a.low.y, b.low.y, c.low.y, d.low.y), vec4(e.low.y, f.low.y, g.low.y, h.low.y));
    sums = with_input(sums, w + 2u, vec4(a.low.z, b.low.z, c.low.z, d.low.z), vec4(e.low.z, f.low.z, g.low.z, h.low.z));
    sums = with_input(sums, w + 3u, vec4(a.low.w, b.low.w, c.low.w, d.low.w), vec4(e.low.w, f.low.w, g.low.w, h.low.w));
    sums = with_input(sums, w + 4u, vec4(a.high.x, b.high.x, c.high.x, d.high.x), vec4(e.high.x, f.high.x, g.high.x, h.high.x));
    sums = with_input(sums, w + 5u, vec4(a.high.y, b.high.y, c.high.y, d.high.y), vec4(e.high.y, f.high.y, g.high.y, h.high.y));
    sums = with_input(sums, w + 6u, vec4(a.high.z, b.high.z, c.high.z, d.high.z), vec4(e.high.z, f.high.z, g.high.z, h.high.z));
    return with_input(sums, w + 7u, vec4(a.high.w, b.high.w, c.high.w, d.high.w), vec4(e.high.w, f.high.w, g.high.w, h.high.w));
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

fn store(place: vec3<u32>, dims: vec3<u32>, block: u32, low: vec4<f32>, high: vec4<f32>) {
    if all(place < dims) {
        out.all[block * dims.x * dims.y * dims.z + voxel_at(place, dims)] = packed(Eight(mish(low), mish(high)));
    }
}

// Those of all voxels, so many apart.
fn store_all(place: vec3<u32>, apart: u32, dims: vec3<u32>, block: u32, sums: Sums) {
    store(place, dims, block, sums.a_low, sums.a_high);
    store(place + vec3(0u, 0u, 1u * apart), dims, block, sums.b_low, sums.b_high);
    store(place + vec3(0u, 0u, 2u * apart), dims, block, sums.c_low, sums.c_high);
    store(place + vec3(0u, 0u, 3u * apart), dims, block, sums.d_low, sums.d_high);
    store(place + vec3(0u, 0u, 4u * apart), dims, block, sums.e_low, sums.e_high);
    store(place + vec3(0u, 0u, 5u * apart), dims, block, sums.f_low, sums.f_high);
    store(place + vec3(0u, 0u, 6u * apart), dims, block, sums.g_low, sums.g_high);
    store(place + vec3(0u, 0u, 7u * apart), dims, block, sums.h_low, sums.h_high);
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
        for (var k = 0u; k < 27u; k++) {
            let at = (here.z + k / 9u) * PLANE + (here.y + k / 3u % 3u) * ROW + here.x + k % 3u;
            let x0 = unpacked(tile[at + 0u * PLANE]);
            let x1 = unpacked(tile[at + 1u * PLANE]);
            let x2 = unpacked(tile[at + 2u * PLANE]);
            let x3 = unpacked(tile[at + 3u * PLANE]);
            let x4 = unpacked(tile[at + 4u * PLANE]);
            let x5 = unpacked(tile[at + 5u * PLANE]);
            let x6 = unpacked(tile[at + 6u * PLANE]);
            let x7 = unpacked(tile[at + 7u * PLANE]);
            sums = with_voxel(sums, w + k * ENTRIES, x0, x1, x2, x3, x4, x5, x6, x7);
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
        for (var k = 0u; k < 8u; k++) {
            let at = (first.z + k / 4u) * PLANE + (first.y + k / 2u % 2u) * ROW + first.x + k % 2u;
            let x0 = unpacked(tile[at + 0u * PLANE]);
            let x1 = unpacked(tile[at + 1u * PLANE]);
            let x2 = unpacked(tile[at + 2u * PLANE]);
            let x3 = unpacked(tile[at + 3u * PLANE]);
            let x4 = unpacked(tile[at + 4u * PLANE]);
            let x5 = unpacked(tile[at + 5u * PLANE]);
            let x6 = unpacked(tile[at + 6u * PLANE]);
            let x7 = unpacked(tile[at + 7u * PLANE]);
            sums = with_voxel(sums, w + k * ENTRIES, x0, x1, x2, x3, x4, x5, x6, x7);
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

// One output of an invocation's voxels.
fn with_eight(sums: vec4<f32>, w: u32, a: Eight, b: Eight, c: Eight, d: Eight) -> vec4<f32> {
    let both = unpacked(weights.all[w]);
    let low = both.low;
    let high = both.high;
    return sums + vec4(dot(a.low, low), dot(b.low, low), dot(c.low, low), dot(d.low, low))
        + vec4(dot(a.high, high), dot(b.high, high), dot(c.high, high), dot(d.high, high));
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
    var above = vec4(0.0);
    for (var block = 0u; block < params.blocks; block++) {
        workgroupBarrier();
        load_block(block, corner, lane);
        workgroupBarrier();
        let w = block * 27u;
        for (var k = 0u; k < 27u; k++) {
            let at = (here.z + k / 9u) * PLANE + (here.y + k / 3u % 3u) * ROW + here.x + k % 3u;
            let x0 = unpacked(tile[at + 0u * PLANE]);
            let x1 = unpacked(tile[at + 1u * PLANE]);
            let x2 = unpacked(tile[at + 2u * PLANE]);
            let x3 = unpacked(tile[at + 3u * PLANE]);
            let x4 = unpacked(tile[at + 4u * PLANE]);
            let x5 = unpacked(tile[at + 5u * PLANE]);
            let x6 = unpacked(tile[at + 6u * PLANE]);
            let x7 = unpacked(tile[at + 7u * PLANE]);
            sums = with_eight(sums, w + k, x0, x1, x2, x3);
            above = with_eight(above, w + k, x4, x5, x6, x7);
        }
    }
    give(corner + here, sums.x);
    give(corner + here + vec3(0u, 0u, 1u), sums.y);
    give(corner + here + vec3(0u, 0u, 2u), sums.z);
    give(corner + here + vec3(0u, 0u, 3u), sums.w);
    give(corner + here + vec3(0u, 0u, 4u), above.x);
    give(corner + here + vec3(0u, 0u, 5u), above.y);
    give(corner + here + vec3(0u, 0u, 6u), above.z);
    give(corner + here + vec3(0u, 0u, 7u), above.w);
}
