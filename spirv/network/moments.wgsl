// Mean and deviation of every channel of a tensor (DVAO eq. (2)): `partial` of 4,096 voxels each, `merge` of all (Chan et al. 1979): sums of f16
// would overflow, and those of squares cancel. In f32, in an order that is always the same.

struct MomentsParams {
    // of a block
    voxels: u32,
    // parts of a block
    parts: u32,
    // entry of the first block in the norms
    norm: u32,
    // first part to work on
    base: u32,
}

#include "shared/tensors.wgsl"
#include "shared/norms.wgsl"

struct Moments {
    mean_low: vec4<f32>,
    mean_high: vec4<f32>,
    // sums of squared differences from the mean
    squares_low: vec4<f32>,
    squares_high: vec4<f32>,
}

struct Partial {
    all: array<Moments>,
}

var<immediate> params: MomentsParams;
@group(0) @binding(0) var<storage, read> source: Tensor;
// Of a block, all parts.
@group(0) @binding(1) var<storage, read_write> partials: Partial;
@group(0) @binding(2) var<storage, read_write> norms: Norms;

// Invocations of a workgroup.
const TEAM = 64u;
// Voxels of a part.
const PART = 4096u;
// What is added to a variance.
const EPSILON = 1e-5;

var<workgroup> moments: array<Moments, TEAM>;
var<workgroup> counts: array<f32, TEAM>;

// Those of two sets of so many voxels.
fn merged(a: Moments, n: f32, b: Moments, m: f32) -> Moments {
    let all = n + m;
    if all == 0.0 {
        return a;
    }
    let low = b.mean_low - a.mean_low;
    let high = b.mean_high - a.mean_high;
    let share = m / all;
    return Moments(
        a.mean_low + low * share,
        a.mean_high + high * share,
        a.squares_low + b.squares_low + low * low * (n * share),
        a.squares_high + b.squares_high + high * high * (n * share),
    );
}

// Those of the whole workgroup, in the first invocation's.
fn merge_all(lane: u32) {
    for (var half = TEAM / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            moments[lane] = merged(moments[lane], counts[lane], moments[lane + half], counts[lane + half]);
            counts[lane] += counts[lane + half];
        }
    }
}

@compute @workgroup_size(TEAM)
fn partial(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let item = params.base + group.x;
    let begin = item / params.parts * params.voxels;
    let first = item % params.parts * PART;
    let end = min(first + PART, params.voxels);
    var sums = Eight(vec4(0.0), vec4(0.0));
    var n = 0.0;
    for (var i = first + lane; i < end; i += TEAM) {
        let x = unpacked(source.all[begin + i]);
        sums = Eight(sums.low + x.low, sums.high + x.high);
        n += 1.0;
    }
    let by = 1.0 / max(n, 1.0);
    let mean = Eight(sums.low * by, sums.high * by);
    var squares = Eight(vec4(0.0), vec4(0.0));
    for (var i = first + lane; i < end; i += TEAM) {
        let x = unpacked(source.all[begin + i]);
        let low = x.low - mean.low;
        let high = x.high - mean.high;
        squares = Eight(squares.low + low * low, squares.high + high * high);
    }
    moments[lane] = Moments(mean.low, mean.high, squares.low, squares.high);
    counts[lane] = n;
    merge_all(lane);
    if lane == 0u {
        partials.all[item] = moments[0];
    }
}

// One workgroup a block.
@compute @workgroup_size(TEAM)
fn merge(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    var mine = Moments(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
    var n = 0.0;
    for (var i = lane; i < params.parts; i += TEAM) {
        let m = f32(min(PART, params.voxels - i * PART));
        mine = merged(mine, n, partials.all[group.x * params.parts + i], m);
        n += m;
    }
    moments[lane] = mine;
    counts[lane] = n;
    merge_all(lane);
    if lane == 0u {
        let all = f32(params.voxels);
        norms.all[params.norm + group.x] = Norm(
            moments[0].mean_low,
            moments[0].mean_high,
            inverseSqrt(moments[0].squares_low / all + EPSILON),
            inverseSqrt(moments[0].squares_high / all + EPSILON),
        );
    }
}
