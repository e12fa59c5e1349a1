// How many occlusion volumes each pixel lies in (AOV figure 5): what drawing them costs, and gathering too. Counted is where a triangle's g is
// above 0.

#include "shared/geometry.wgsl"
#include "shared/occluder.wgsl"

struct OverdrawParams {
    size: vec2<u32>,
    // mm: how far occlusion reaches
    delta: f32,
    // whether volumes end where their corners are clamped
    clamped: u32,
}

struct Counts {
    // one a pixel, in the order of the geometry
    pixel: array<u32>,
}

// Of a pixel that shows no surface.
const NO_SURFACE = 0xffffffffu;

var<immediate> params: OverdrawParams;
@group(0) @binding(0) var<uniform> eyes: Eyes;
// over the boxes of volumes
@group(0) @binding(1) var<storage, read> tree: Tree;
@group(0) @binding(2) var<storage, read> triangles: Triangles;
@group(0) @binding(3) var<storage, read> geometry: Geometry;
@group(0) @binding(4) var<storage, read> shares: Shares;
@group(0) @binding(5) var<storage, read_write> counts: Counts;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let index = pixel_index(params.size, id.z, id.xy);
    let depth = geometry.pixel[index].w;
    var count = NO_SURFACE;
    if depth > 0.0 {
        count = 0u;
        let point = position_of(eyes.eye[id.z], params.size, id.xy, depth);
        let nothing = uncertainty(point, depth);
        let nodes = tree.node[0].skip;
        var i = 0u;
        while i < nodes {
            let node = tree.node[i];
            if any(point < node.low) || any(point > node.high) {
                i = node.skip;
                continue;
            }
            let first = leaf_first(node);
            for (var k = first; k < first + leaf_count(node); k++) {
                let clamped = params.clamped != 0u;
                let triangle = triangles.triangle[k];
                let falloff = falloff_of(triangle, shares.triangle[k], point, params.delta, nothing, clamped);
                count += u32(falloff > 0.0);
            }
            i++;
        }
    }
    counts.pixel[index] = count;
}
