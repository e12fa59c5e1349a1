// Values from boxes of a summed-area table: `whole` takes the mean of one box, `mean`, `end` and `published` shells, each a box without
// the one before. One workgroup a brick of the list. Sums are exact whole numbers; a value depends on nothing but the opacities of its
// largest box, and on its own neighbours' for whether it is needed.

struct BoxesParams {
    dims: vec3<u32>,
    // boxes, the smallest first; 0: every value is 1
    shells: u32,
    bricks: vec3<u32>,
    // first entry of the list to work on
    base: u32,
    // parts of 1 that the table sums
    levels: f32,
    // 1: every voxel gets a value
    unneeded: u32,
    // reference lengths of a voxel's smallest spacing
    exponent: f32,
}

struct Shell {
    // voxels on each side of the centre
    half: vec3<u32>,
    // voxels that the box before has not, the centre never
    added: f32,
    // in smallest spacings
    thickness: f32,
    // of the sum over all shells that this one counts
    share: f32,
}

struct Shells {
    all: array<Shell>,
}

#include "shared/listed.wgsl"
#include "shared/segment.wgsl"

var<immediate> params: BoxesParams;
// V_o, per reference length.
@group(0) @binding(0) var opacity: texture_3d<f32>;
@group(0) @binding(1) var table: texture_3d<u32>;
@group(0) @binding(2) var<storage, read> shells: Shells;
@group(0) @binding(3) var<storage, read> list: BrickList;
@group(0) @binding(4) var ambient: texture_storage_3d<r16unorm, write>;

// Invocations of a workgroup.
const TEAM = 128u;

// Most shells.
const MOST_SHELLS = 64u;

const WHOLE = 0u;
const MEAN = 1u;
const END = 2u;
const PUBLISHED = 3u;

// Over the voxels of a box that lie in the volume; outside it everything is 0.
fn box_sum(voxel: vec3<u32>, half: vec3<u32>) -> u32 {
    let low = voxel - min(half, voxel);
    let high = min(voxel + half + 1u, params.dims);
    var sum = 0u;
    for (var corner = 0u; corner < 8u; corner++) {
        let far = vec3(corner & 1u, corner >> 1u & 1u, corner >> 2u);
        let term = textureLoad(table, select(low, high, far == vec3(1u)), 0).r;
        // Odd numbers of low sides are taken away.
        sum = select(sum - term, sum + term, ((far.x + far.y + far.z) & 1u) == 1u);
    }
    return sum;
}

// 1 - a; what all of is opaque is opaque, whatever a quotient rounds.
fn clear(a: f32) -> f32 {
    let q = 1.0 - a;
    return select(q, 0.0, q < OPAQUE);
}

// Of so many reference lengths where 1 lets q through.
fn through(q: f32, lengths: f32) -> f32 {
    if lengths == 1.0 || q == 0.0 {
        return q;
    }
    return pow(q, lengths);
}

fn value_of(voxel: vec3<u32>, rule: u32) -> f32 {
    var before = box_sum(voxel, vec3(0u));
    var light = 1.0;
    var sum = 0.0;
    for (var i = 0u; i < params.shells; i++) {
        let shell = shells.all[i];
        let inner = select(before, 0u, rule == WHOLE);
        let here = box_sum(voxel, shell.half);
        let a = f32(here - inner) / (shell.added * params.levels);
        before = here;
        if rule == PUBLISHED {
            sum += f32(here - inner) * shell.share;
            continue;
        }
        let q = clear(a);
        let b = through(q, shell.thickness * params.exponent);
        if rule == MEAN && q > 0.0 {
            let x = max(-log(q) * (shell.thickness * params.exponent), 1e-30);
            sum += light * shell.share * mean_transmittance(x, b);
        }
        light *= b;
    }
    if rule == MEAN {
        return sum;
    }
    return select(light, exp(-sum * params.exponent), rule == PUBLISHED);
}

// One brick.
fn work(group: vec3<u32>, lane: u32, rule: u32) {
    let brick = listed_brick(group, lane);
    let corner = brick.xyz;
    let listed = brick.w == 1u;
    for (var i = lane; i < VOXELS; i += TEAM) {
        let voxel = corner + inside(i);
        if listed && all(voxel < params.dims) {
            var value = 1.0;
            if params.shells > 0u && (params.unneeded == 1u || needed(inside(i))) {
                value = value_of(voxel, rule);
            }
            textureStore(ambient, voxel, vec4(value, 0.0, 0.0, 0.0));
        }
    }
}

@compute @workgroup_size(TEAM)
fn whole(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    work(group, lane, WHOLE);
}

@compute @workgroup_size(TEAM)
fn mean(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    work(group, lane, MEAN);
}

@compute @workgroup_size(TEAM)
fn end(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    work(group, lane, END);
}

@compute @workgroup_size(TEAM)
fn published(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    work(group, lane, PUBLISHED);
}
