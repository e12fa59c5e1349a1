// Ambient occlusion volumes (AOV section 5) gathered instead of drawn: each pixel walks the tree of the volumes' boxes and sums what the
// triangles contribute in whose volume it lies. The same sum as drawing all volumes over each other with additive blending; in
// compute, where a data-centre GPU has thirty times the units that it has for fragments, and in the same order each time.
//
// `full` is for every pixel; `sparse` for one pixel of a block of step x step, the middle one (section 3.2); `failed` for those that
// `upsample` marked.

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
    // mm: how far occlusion reaches
    delta: f32,
    // whether volumes end where their corners are clamped
    clamped: u32,
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

fn occlusion_at(view: u32, pixel: vec2<u32>) -> f32 {
    let here = geometry.pixel[pixel_index(params.size, view, pixel)];
    if here.w == 0.0 {
        return 0.0;
    }
    let point = position_of(eyes.eye[view], params.size, pixel, here.w);
    let nothing = uncertainty(point, here.w);
    let nodes = tree.node[0].skip;
    var sum = 0.0;
    var i = 0u;
    while i < nodes {
        let node = tree.node[i];
        if any(point < node.low) || any(point > node.high) {
            i = node.skip;
            continue;
        }
        let first = leaf_first(node);
        for (var k = 0u; k < leaf_count(node); k++) {
            let triangle = triangles.triangle[first + k];
            let share = shares.triangle[first + k];
            sum += contribution(triangle, share, point, here.xyz, params.delta, nothing, params.clamped != 0u);
        }
        i++;
    }
    return sum;
}

@compute @workgroup_size(8, 8)
fn full(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = vec2(id.x, params.first_row + id.y);
    if id.y < params.rows && all(pixel < params.size) {
        accessibility.pixel[pixel_index(params.size, id.z, pixel)] = 1.0 - min(occlusion_at(id.z, pixel), 1.0);
    }
}

@compute @workgroup_size(8, 8)
fn sparse(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id.xy < params.blocks) {
        let pixel = min(id.xy * params.step + params.step / 2u, params.size - 1u);
        sparse_sums.block[pixel_index(params.blocks, id.z, id.xy)] = occlusion_at(id.z, pixel);
    }
}

// The failed pixels of a tile, brought together, so that no invocation waits for those that have nothing to do.
// Pixels along its edge.
const TILE = 16u;
var<workgroup> found: array<u32, TILE * TILE>;
var<workgroup> count: atomic<u32>;

@compute @workgroup_size(64)
fn failed(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&count, 0u);
    }
    workgroupBarrier();
    for (var k = local; k < TILE * TILE; k += 64u) {
        let pixel = group.xy * TILE + vec2(k % TILE, k / TILE);
        if all(pixel < params.size) {
            let index = pixel_index(params.size, group.z, pixel);
            if accessibility.pixel[index] == FAILED {
                found[atomicAdd(&count, 1u)] = k;
            }
        }
    }
    workgroupBarrier();
    let there = atomicLoad(&count);
    for (var i = local; i < there; i += 64u) {
        let k = found[i];
        let pixel = group.xy * TILE + vec2(k % TILE, k / TILE);
        let index = pixel_index(params.size, group.z, pixel);
        accessibility.pixel[index] = 1.0 - min(occlusion_at(group.z, pixel), 1.0);
    }
}
