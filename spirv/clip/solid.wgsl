// What fills a volume's opacity beside what is in it: the share of each voxel that is inside some solid, anti-aliased as clips are
// (CAO eq. (5)). Solids are shapes at their poses, as clips are; their sides do not matter, for all of them remove.

struct SolidParams {
    dims: vec3<u32>,
    spacing: vec3<f32>,
    sampling: Sampling,
}

// Whether each brick has some of it.
struct SolidBricks {
    any: array<u32>,
}

#include "shared/bricks.wgsl"
#include "shared/clip_opacity.wgsl"

var<immediate> params: SolidParams;
// the solids
@group(0) @binding(0) var<storage, read> clips: Clips;
@group(0) @binding(1) var<storage, read> layers: Layers;
@group(0) @binding(2) var<uniform> positions: Positions;
@group(0) @binding(3) var<storage, read_write> solid_bricks: SolidBricks;
@group(0) @binding(4) var solid: texture_storage_3d<r16unorm, write>;

var<workgroup> found: atomic<u32>;

// One workgroup a brick; each invocation takes two slices.
@compute @workgroup_size(BRICK, BRICK, SLICES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = item_of_group(group);
    let bricks = bricks_of(params.dims);
    let listed = index < brick_count(bricks);
    if lane == 0u {
        atomicStore(&found, 0u);
    }
    workgroupBarrier();
    for (var slice = 0u; slice < BRICK; slice += SLICES) {
        let voxel = brick_at(index, bricks) * BRICK + local + vec3(0u, 0u, slice);
        if listed && all(voxel < params.dims) {
            let centre = (vec3<f32>(voxel) - 0.5 * vec3<f32>(params.dims - 1u)) * params.spacing;
            let share = 1.0 - visible_share(UNKNOWN, centre, params.spacing, params.sampling);
            textureStore(solid, voxel, vec4(share, 0.0, 0.0, 0.0));
            if share > 0.0 {
                atomicStore(&found, 1u);
            }
        }
    }
    workgroupBarrier();
    if lane == 0u && listed {
        solid_bricks.any[index] = atomicLoad(&found);
    }
}
