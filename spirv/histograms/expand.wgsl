// From clusters to values: `shade` makes one ambient factor a cluster, of the opacities that the transfer function gives to its values;
// `main` writes them to the voxels of a list of bricks. Expanded before anything filters them: numbers of clusters cannot be interpolated.
// `shade_coloured` and `main_coloured` are the same where matter lends its colour: a factor in red, green and blue.

struct ExpandParams {
    dims: vec3<u32>,
    // voxels along each axis that share a cluster
    block: u32,
    bricks: vec3<u32>,
    // first entry of the list to work on
    base: u32,
    clusters: u32,
    // 1: every voxel gets a value
    unneeded: u32,
    // reference lengths of a voxel's smallest spacing
    exponent: f32,
    // how much of the light that matter hides it gives back in its own colour
    bleeding: f32,
}

struct Range {
    // of values, ordered as whole numbers
    low: u32,
    high: u32,
}

struct Factors {
    all: array<f32>,
}

struct Tints {
    // red, green, blue and 1
    all: array<vec4<f32>>,
}

#include "shared/listed.wgsl"
#include "shared/nearest.wgsl"
#include "shared/transfer.wgsl"

var<immediate> params: ExpandParams;
// V_o, per reference length.
@group(0) @binding(0) var opacity: texture_3d<f32>;
@group(0) @binding(3) var<storage, read> range_of: Range;
@group(0) @binding(4) var<storage, read_write> factors: Factors;
@group(0) @binding(5) var<storage, read> list: BrickList;
@group(0) @binding(6) var index: texture_3d<u32>;
@group(0) @binding(7) var ambient: texture_storage_3d<r16unorm, write>;
@group(0) @binding(8) var<storage, read_write> tints: Tints;
// red, green, blue and 1
@group(0) @binding(9) var coloured: texture_storage_3d<rgba16unorm, write>;

// Invocations of a workgroup.
const TEAM = 128u;

// No cluster.
const NONE = 0xffffffffu;

// Opacity of each bin.
var<workgroup> alphas: array<f32, BINS>;

fn value_of(ordered: u32) -> f32 {
    return bitcast<f32>(select(~ordered, ordered & 0x7fffffffu, ordered >> 31u == 1u));
}

// A bin's own value; the ends exactly.
fn value_in(bin: u32) -> f32 {
    let low = value_of(range_of.low);
    let high = value_of(range_of.high);
    let t = f32(bin) / f32(BINS - 1u);
    return select(low * (1.0 - t) + high * t, high, bin == BINS - 1u);
}

// Of a smallest spacing of a value.
fn alpha_of(value: f32) -> f32 {
    let alpha = opacity_of(value);
    return select(1.0 - pow(max(1.0 - alpha, 0.0), params.exponent), alpha, params.exponent == 1.0);
}

// One invocation a cluster.
@compute @workgroup_size(EACH)
fn shade(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    alphas[lane] = alpha_of(value_in(lane));
    workgroupBarrier();
    if id.x < params.clusters {
        var hidden = 0.0;
        for (var w = 0u; w < WORDS; w++) {
            let word = centres.all[WORDS * id.x + w];
            hidden += f32(word & 0xffffu) * alphas[2u * w] + f32(word >> 16u) * alphas[2u * w + 1u];
        }
        factors.all[id.x] = clamp(1.0 - hidden / f32(WHOLE_SHARE), 0.0, 1.0);
    }
}

// What each bin hides of red, green and blue light, and does not give back.
var<workgroup> hidden_by: array<vec3<f32>, BINS>;

// One invocation a cluster.
@compute @workgroup_size(EACH)
fn shade_coloured(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let value = value_in(lane);
    hidden_by[lane] = alpha_of(value) * (1.0 - params.bleeding * colour_of(value));
    workgroupBarrier();
    if id.x < params.clusters {
        var hidden = vec3(0.0);
        for (var w = 0u; w < WORDS; w++) {
            let word = centres.all[WORDS * id.x + w];
            hidden += f32(word & 0xffffu) * hidden_by[2u * w] + f32(word >> 16u) * hidden_by[2u * w + 1u];
        }
        tints.all[id.x] = vec4(clamp(1.0 - hidden / f32(WHOLE_SHARE), vec3(0.0), vec3(1.0)), 1.0);
    }
}

// The voxel i of the listed brick of a group, and its cluster; NONE of one that needs no value, and `there` of one that there is.
struct Found {
    voxel: vec3<u32>,
    there: bool,
    cluster: u32,
}

fn found(brick: vec4<u32>, i: u32) -> Found {
    let voxel = brick.xyz + inside(i);
    let there = brick.w == 1u && all(voxel < params.dims);
    var cluster = NONE;
    if there && (params.unneeded == 1u || needed(inside(i))) {
        cluster = textureLoad(index, voxel / params.block, 0).r;
    }
    return Found(voxel, there, cluster);
}

@compute @workgroup_size(TEAM)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let brick = listed_brick(group, lane);
    for (var i = lane; i < VOXELS; i += TEAM) {
        let at = found(brick, i);
        var value = 1.0;
        if at.cluster != NONE {
            value = factors.all[at.cluster];
        }
        if at.there {
            textureStore(ambient, at.voxel, vec4(value, 0.0, 0.0, 0.0));
        }
    }
}

@compute @workgroup_size(TEAM)
fn main_coloured(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let brick = listed_brick(group, lane);
    for (var i = lane; i < VOXELS; i += TEAM) {
        let at = found(brick, i);
        var value = vec4(1.0);
        if at.cluster != NONE {
            value = tints.all[at.cluster];
        }
        if at.there {
            textureStore(coloured, at.voxel, value);
        }
    }
}
