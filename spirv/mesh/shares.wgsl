// What clips leave of each triangle: the share of a grid of points over it that none hides, times what its mask leaves.

#include "shared/world.wgsl"
#include "shared/clips.wgsl"
#include "shared/bricks.wgsl"

struct SharesParams {
    triangles: u32,
}

var<immediate> params: SharesParams;
@group(0) @binding(0) var<storage, read> triangles: Triangles;
@group(0) @binding(1) var<storage, read> clips: Clips;
@group(0) @binding(2) var<storage, read> layers: Layers;
@group(0) @binding(3) var<storage, read_write> shares: Shares;

// Points along an edge of the grid.
const EDGE = 16u;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let index = (group.y * GROUPS_PER_ROW + group.x) * 64u + local;
    if index >= params.triangles {
        return;
    }
    let triangle = triangles.triangle[index];
    if (u32(triangle.c.w) & SPARED) != 0u {
        shares.triangle[index] = triangle.a.w;
        return;
    }
    var left = 0u;
    for (var i = 0u; i < EDGE; i++) {
        for (var j = 0u; j < EDGE - i; j++) {
            let at = (vec2(f32(i), f32(j)) + 1.0 / 3.0) / f32(EDGE);
            let place = triangle.a.xyz * (1.0 - at.x - at.y) + triangle.b.xyz * at.x + triangle.c.xyz * at.y;
            left += u32(visible(place));
        }
    }
    shares.triangle[index] = triangle.a.w * f32(left) / f32(EDGE * (EDGE + 1u) / 2u);
}
