// Bit by bit comparison of two ambient volumes on every voxel that has a value: all but clipped voxels that touch no visible
// one, and, where only needed voxels are computed, voxels without opacity in their 3x3x3. The list holds the bricks of the
// full computation; no other brick has such voxels. Of rays by brick, which have no mask, bricks tell what was recomputed.

struct CompareParams {
    dims: vec3<u32>,
    only_needed: u32,
    bricks: vec3<u32>,
    // 1: recomputed are the voxels of the bricks of `todo`; no voxel is clipped beyond its opacity of 0, and the mask is not read
    by_brick: u32,
}

struct Difference {
    compared: atomic<u32>,
    different: atomic<u32>,
    // bits of the largest |difference|; order of bits is order of values for floats >= 0
    largest: atomic<u32>,
    // voxels of category b, or a touching a visible one, among the compared
    recomputed: atomic<u32>,
}

#include "shared/categories.wgsl"
#include "shared/todo.wgsl"

var<immediate> params: CompareParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
@group(0) @binding(1) var mask: texture_3d<u32>;
@group(0) @binding(2) var expected: texture_3d<f32>;
@group(0) @binding(3) var actual: texture_3d<f32>;
@group(0) @binding(4) var<storage, read> list: BrickList;
@group(0) @binding(5) var<storage, read_write> difference: Difference;
@group(0) @binding(6) var<storage, read> todo: Todo;

// As the mask has it.
fn category_of(voxel: vec3<u32>) -> u32 {
    if params.by_brick == 0u {
        return textureLoad(mask, voxel, 0).r;
    }
    let listed = todo.brick[brick_index(voxel / BRICK, params.bricks)];
    return select(UNTOUCHED, AFFECTED, (listed & TODO) != 0u);
}

fn compare(voxel: vec3<u32>) {
    let category = category_of(voxel);
    var touches_visible = category != CLIPPED;
    var touches_opacity = params.only_needed == 0u || textureLoad(opacity, voxel, 0).r > 0.0;
    let last = min(voxel + 1u, params.dims - 1u);
    let first = max(voxel, vec3(1u)) - 1u;
    for (var z = first.z; z <= last.z && !(touches_visible && touches_opacity); z++) {
        for (var y = first.y; y <= last.y; y++) {
            for (var x = first.x; x <= last.x; x++) {
                touches_visible = touches_visible || category_of(vec3(x, y, z)) != CLIPPED;
                touches_opacity = touches_opacity || textureLoad(opacity, vec3(x, y, z), 0).r > 0.0;
            }
        }
    }
    if !touches_visible || !touches_opacity {
        return;
    }
    atomicAdd(&difference.compared, 1u);
    if category != UNTOUCHED {
        atomicAdd(&difference.recomputed, 1u);
    }
    // Of one channel the others read as constants.
    let e = textureLoad(expected, voxel, 0);
    let a = textureLoad(actual, voxel, 0);
    // A value that is none (NaN fails every comparison) is wrong even where both volumes have it.
    if any(bitcast<vec4<u32>>(e) != bitcast<vec4<u32>>(a)) || !(all(e >= vec4(0.0)) && all(e <= vec4(1.0))) {
        let apart = abs(e - a);
        atomicAdd(&difference.different, 1u);
        atomicMax(&difference.largest, bitcast<u32>(max(max(apart.x, apart.y), max(apart.z, apart.w))));
    }
}

// One workgroup a brick; each invocation takes two slices.
@compute @workgroup_size(BRICK, BRICK, SLICES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let entry = item_of_group(group);
    if entry >= list.count {
        return;
    }
    let corner = brick_at(list.items[entry], params.bricks) * BRICK;
    for (var slice = 0u; slice < BRICK; slice += SLICES) {
        let voxel = corner + local + vec3(0u, 0u, slice);
        if all(voxel < params.dims) {
            compare(voxel);
        }
    }
}
