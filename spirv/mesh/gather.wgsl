// Ambient occlusion volumes (AOV section 5) gathered instead of drawn: the tree of the volumes' boxes is walked, and each pixel sums what the
// triangles contribute in whose volume it lies. The same sum as drawing all volumes over each other with additive blending; in
// compute, where a data-centre GPU has thirty times the units that it has for fragments, and of integers, so that no order matters.
//
// `full` is for every pixel; `sparse` for one pixel of a block of step x step, the middle one (section 3.2); `failed` for those that
// `upsample` listed. A workgroup walks together: for the pixels of a tile, which then go over the same triangles, each for itself; or for one
// pixel alone, whose triangles are divided among all. Of each there is one for volumes whose corners are clamped.

#include "shared/geometry.wgsl"
#include "shared/occluder.wgsl"
#include "shared/accessibility.wgsl"
#include "shared/sparse.wgsl"

struct GatherParams {
    // pixels of a view, and blocks
    size: vec2<u32>,
    blocks: vec2<u32>,
    // pixels along a block's edge
    step: u32,
    // `full`: the first row of this part
    first_row: u32,
    rows: u32,
    // `failed`: workgroups
    groups: u32,
    // mm: how far occlusion reaches
    delta: f32,
}

var<immediate> params: GatherParams;
@group(0) @binding(0) var<uniform> eyes: Eyes;
// over the boxes of volumes
@group(0) @binding(1) var<storage, read> tree: Tree;
@group(0) @binding(2) var<storage, read> triangles: Triangles;
@group(0) @binding(3) var<storage, read> geometry: Geometry;
@group(0) @binding(4) var<storage, read_write> accessibility: Accessibility;
@group(0) @binding(5) var<storage, read_write> sparse_sums: Sparse;
@group(0) @binding(6) var<storage, read> shares: Shares;
@group(0) @binding(7) var<storage, read_write> failures: Failures;

// Units of an occlusion of 1: exact in an f32, and of all invocations together within a u32.
const WHOLE = 16777216u;

// What a pixel shows.
struct Place {
    point: vec3<f32>,
    normal: vec3<f32>,
    // see contribution
    nothing: f32,
    // false: nothing
    shown: bool,
}

fn place_at(view: u32, pixel: vec2<u32>) -> Place {
    let here = geometry.pixel[pixel_index(params.size, view, pixel)];
    let point = position_of(eyes.eye[view], params.size, pixel, here.w);
    return Place(point, here.xyz, uncertainty(point, here.w), here.w != 0.0);
}

// What the triangles of a leaf contribute there, in units.
fn of_leaf(leaf: TreeNode, place: Place, clamped: bool) -> u32 {
    let first = leaf_first(leaf);
    var sum = 0u;
    for (var k = first; k < first + leaf_count(leaf); k++) {
        let triangle = triangles.triangle[k];
        let share = shares.triangle[k];
        let part = contribution(triangle, share, place.point, place.normal, params.delta, place.nothing, clamped);
        sum += u32(min(part, 1.0) * f32(WHOLE) + 0.5);
    }
    return sum;
}

// Invocations of a group that walks together.
const LANES = 32u;
// Nodes that wait to be looked at, and leaves that wait for their triangles to be.
const NODES = 1024u;
const LEAVES = 64u;
// How deep a tree may be, as cao_model::bvh has it.
const DEEPEST = 64u;

var<workgroup> nodes: array<u32, NODES>;
var<workgroup> leaves: array<u32, LEAVES>;
// Which invocations have found an inner node and which a leaf, a bit each; this turn's and the next one's.
var<workgroup> inner: array<atomic<u32>, 2>;
var<workgroup> outer: array<atomic<u32>, 2>;

// Walks the tree with all invocations of a group, of which each sums: in units, the triangles that contribute to its own place, or its part
// of those that contribute to the one place that all have. `low` and `high`: a box about all places.
fn walk(low: vec3<f32>, high: vec3<f32>, place: Place, for_one: bool, lane: u32, clamped: bool) -> u32 {
    if lane == 0u {
        nodes[0] = 0u;
        atomicStore(&inner[0], 0u);
        atomicStore(&outer[0], 0u);
    }
    workgroupBarrier();
    var sum = 0u;
    var waiting = 1u;
    var ready = 0u;
    var turn = 0u;
    while waiting > 0u {
        // Where memory runs low one after the other, which asks for no more than the tree is deep.
        let taken = min(waiting, select(1u, LANES, waiting + LANES + DEEPEST <= NODES));
        waiting -= taken;
        var index = 0u;
        if lane < taken {
            index = nodes[waiting + lane];
            let node = tree.node[index];
            if all(node.low <= high) && all(node.high >= low) {
                if leaf_count(node) == 0u {
                    atomicOr(&inner[turn], 1u << lane);
                } else {
                    atomicOr(&outer[turn], 1u << lane);
                }
            }
        }
        workgroupBarrier();
        let entered = atomicLoad(&inner[turn]);
        let found = atomicLoad(&outer[turn]);
        let before = (1u << lane) - 1u;
        if ((entered >> lane) & 1u) != 0u {
            let at = waiting + 2u * countOneBits(entered & before);
            nodes[at] = tree.node[index + 1u].skip;
            nodes[at + 1u] = index + 1u;
        }
        if ((found >> lane) & 1u) != 0u {
            leaves[ready + countOneBits(found & before)] = index;
        }
        waiting += 2u * countOneBits(entered);
        ready += countOneBits(found);
        turn = 1u - turn;
        if lane == 0u {
            atomicStore(&inner[turn], 0u);
            atomicStore(&outer[turn], 0u);
        }
        workgroupBarrier();
        while ready > 0u && (waiting == 0u || ready > LEAVES - LANES) {
            if for_one {
                let some = min(ready, LANES);
                ready -= some;
                if lane < some {
                    sum = min(sum + of_leaf(tree.node[leaves[ready + lane]], place, clamped), WHOLE);
                }
            } else {
                ready--;
                let leaf = tree.node[leaves[ready]];
                if place.shown && all(place.point >= leaf.low) && all(place.point <= leaf.high) {
                    sum = min(sum + of_leaf(leaf, place, clamped), WHOLE);
                }
            }
        }
    }
    return sum;
}

var<workgroup> total: atomic<u32>;

// Occlusion of one pixel, the same for all invocations, by all of them together.
fn occlusion_of(view: u32, pixel: vec2<u32>, lane: u32, clamped: bool) -> f32 {
    if lane == 0u {
        atomicStore(&total, 0u);
    }
    let place = place_at(view, pixel);
    // Of nothing a box that nothing meets.
    let far = select(3e38, 0.0, place.shown);
    let sum = walk(place.point + far, place.point + far, place, true, lane, clamped);
    atomicAdd(&total, sum);
    workgroupBarrier();
    let all = atomicLoad(&total);
    workgroupBarrier();
    return f32(min(all, WHOLE)) / f32(WHOLE);
}

var<workgroup> shown: array<vec4<f32>, LANES>;

fn write_full(id: vec3<u32>, lane: u32, clamped: bool) {
    let pixel = vec2(id.x, params.first_row + id.y);
    let there = id.y < params.rows && all(pixel < params.size);
    var place = place_at(id.z, min(pixel, params.size - 1u));
    place.shown = place.shown && there;
    shown[lane] = vec4(place.point, select(0.0, 1.0, place.shown));
    workgroupBarrier();
    var low = vec3(3e38);
    var high = vec3(-3e38);
    for (var k = 0u; k < LANES; k++) {
        if shown[k].w != 0.0 {
            low = min(low, shown[k].xyz);
            high = max(high, shown[k].xyz);
        }
    }
    let sum = walk(low, high, place, false, lane, clamped);
    if there {
        accessibility.pixel[pixel_index(params.size, id.z, pixel)] = 1.0 - f32(sum) / f32(WHOLE);
    }
}

// A workgroup a tile.
@compute @workgroup_size(8, 4)
fn full(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    write_full(id, lane, false);
}

@compute @workgroup_size(8, 4)
fn full_clamped(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    write_full(id, lane, true);
}

fn write_sparse(group: vec3<u32>, lane: u32, clamped: bool) {
    let pixel = min(group.xy * params.step + params.step / 2u, params.size - 1u);
    let occlusion = occlusion_of(group.z, pixel, lane, clamped);
    if lane == 0u {
        sparse_sums.block[pixel_index(params.blocks, group.z, group.xy)] = occlusion;
    }
}

// A workgroup a block.
@compute @workgroup_size(LANES)
fn sparse(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    write_sparse(group, lane, false);
}

@compute @workgroup_size(LANES)
fn sparse_clamped(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    write_sparse(group, lane, true);
}

fn write_failed(group: vec3<u32>, lane: u32, clamped: bool) {
    let pixels = params.size.x * params.size.y;
    let listed = atomicLoad(&failures.count);
    for (var i = group.x; i < listed; i += params.groups) {
        let index = failures.pixel[i];
        let in_view = index % pixels;
        let pixel = vec2(in_view % params.size.x, in_view / params.size.x);
        let occlusion = occlusion_of(index / pixels, pixel, lane, clamped);
        if lane == 0u {
            accessibility.pixel[index] = 1.0 - occlusion;
        }
    }
}

// A workgroup every `groups`-th pixel that `upsample` has listed.
@compute @workgroup_size(LANES)
fn failed(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    write_failed(group, lane, false);
}

@compute @workgroup_size(LANES)
fn failed_clamped(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    write_failed(group, lane, true);
}
