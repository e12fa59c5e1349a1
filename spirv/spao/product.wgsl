// Smooth probabilistic ambient occlusion (SPAO section 1.2.1, 1.2.2, 1.3): the product over shells of cubes of what each lets through,
//
//     A(x) = prod over l = 1 ... L of 1 - clamp((S_l A_l - S_l-1 A_l-1) / (S_l - S_l-1), 0, 1)
//
// with A_l the mean opacity of the cube of level l, S_l its voxels, its middle moved out along the normal. Level 0 is no shell.
//
// In: `opacity` V_o, `level_1` ... the volumes of means, the list of bricks. Out: `ambient` in the listed bricks, one write a voxel: 1
// where no value is needed. Cost: L look-ups a voxel and one of V_o, six reads more for a normal.

struct ProductParams {
    dims: vec3<u32>,
    // L
    levels: u32,
    bricks: vec3<u32>,
    // first entry of the list to work on
    base: u32,
    // smallest spacing / spacing: what a difference of opacities is of a normal
    slope: vec3<f32>,
    // length of a voxel / reference length of the opacities
    exponent: f32,
    // 1: every voxel gets a value
    unneeded: u32,
    // 1: cubes are moved out along normals
    lifted: u32,
}

#include "shared/bricks.wgsl"
#include "shared/opaque.wgsl"
#include "shared/of_voxel.wgsl"
#include "shared/parts.wgsl"

var<immediate> params: ProductParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
// linear, transparent outside
@group(0) @binding(1) var field: sampler;
@group(0) @binding(2) var<storage, read> table: Levels;
@group(0) @binding(3) var<storage, read> list: BrickList;
@group(0) @binding(4) var ambient: texture_storage_3d<r16unorm, write>;
@group(0) @binding(11) var level_1: texture_3d<f32>;
@group(0) @binding(12) var level_2: texture_3d<f32>;
@group(0) @binding(13) var level_3: texture_3d<f32>;
@group(0) @binding(14) var level_4: texture_3d<f32>;
@group(0) @binding(15) var level_5: texture_3d<f32>;
@group(0) @binding(16) var level_6: texture_3d<f32>;
@group(0) @binding(17) var level_7: texture_3d<f32>;
@group(0) @binding(18) var level_8: texture_3d<f32>;
@group(0) @binding(19) var level_9: texture_3d<f32>;

#include "shared/levels.wgsl"
#include "shared/needed.wgsl"

fn solid(voxel: vec3<i32>) -> f32 {
    if all(voxel >= vec3(0)) && all(voxel < vec3<i32>(params.dims)) {
        return of_voxel(textureLoad(opacity, voxel, 0).r, params.exponent);
    }
    return 0.0;
}

// Towards where there is less opacity; as long as the step is clear, at most 1 (SPAO section 1.3).
fn normal(voxel: vec3<i32>) -> vec3<f32> {
    let x = vec3(1, 0, 0);
    let y = vec3(0, 1, 0);
    let z = vec3(0, 0, 1);
    let step = vec3(
        solid(voxel - x) - solid(voxel + x),
        solid(voxel - y) - solid(voxel + y),
        solid(voxel - z) - solid(voxel + z),
    ) * params.slope;
    return step / max(length(step), 1.0);
}

fn value_of(voxel: vec3<u32>) -> f32 {
    let place = vec3<f32>(voxel) + 0.5;
    var out = vec3(0.0);
    if params.lifted == 1u {
        out = normal(vec3<i32>(voxel));
    }
    var inside = mean_around(0u, place + out * table.level[0].lift);
    var through = 1.0;
    for (var l = 1u; l <= params.levels; l++) {
        let mean = mean_around(l, place + out * table.level[l].lift);
        let shell = table.level[l].outer * mean - table.level[l].inner * inside;
        through *= 1.0 - clamp(shell, 0.0, 1.0);
        inside = mean;
    }
    return through;
}

// One workgroup a brick.
@compute @workgroup_size(TEAM)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = params.base + item_of_group(group);
    let listed = entry < list.count;
    let corner = brick_at(list.items[select(0u, entry, listed)], params.bricks) * BRICK;
    clear_needed(lane);
    workgroupBarrier();
    mark_rows(corner, lane);
    workgroupBarrier();
    gather(corner, listed, lane);
    workgroupBarrier();
    let count = atomicLoad(&found);
    for (var i = lane; i < count; i += TEAM) {
        let voxel = corner + place_of(i);
        textureStore(ambient, voxel, vec4(round(value_of(voxel) * PARTS) / PARTS, 0.0, 0.0, 0.0));
    }
}
