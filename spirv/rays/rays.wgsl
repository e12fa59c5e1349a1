// Rays by brick (method.md section 4). One workgroup a brick of the list: its voxels that need a value are gathered in workgroup memory,
// then the group takes pairs (voxel, direction), voxels fastest, so that a subgroup shares its direction. What a ray contributes is whole
// numbers, so sums are exact in any order, and a value depends on nothing but the opacities that its rays meet.
//
// A rule says how many cells of a ray, near its voxel, have the filter's opacity in their middle, the first cell in each of its
// halves: none (`nearest`), NEAR (`hybrid`) or all (`linear`). The others have that of the voxel nearest to their middle, found in
// whole UNITths of a voxel.
//
// The entry points `..._coloured` are the same in coloured light: three sums a voxel.

struct RaysParams {
    dims: vec3<u32>,
    // 0 where rays have no cells: then every value is 1
    directions: u32,
    bricks: vec3<u32>,
    // of a ray, one step long each; the last counts half
    cells: u32,
    // farthest cell from its voxel along each axis
    reach: vec3<u32>,
    // first entry of the list to work on
    base: u32,
    // 1: every voxel gets a value
    unneeded: u32,
    // step / reference length of the opacity
    exponent: f32,
    // how much farther out than half a step rays begin, in steps
    shift: f32,
}

#include "shared/bricks.wgsl"
#include "shared/walk.wgsl"

var<immediate> params: RaysParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
// linear, transparent outside the volume
@group(0) @binding(1) var field: sampler;
@group(0) @binding(2) var<storage, read> directions: Directions;
@group(0) @binding(3) var<storage, read> cells: Cells;
@group(0) @binding(4) var<storage, read> list: BrickList;
@group(0) @binding(5) var ambient: texture_storage_3d<r16unorm, write>;

#include "shared/needed.wgsl"

// A workgroup's brick.
struct Taken {
    // lowest voxel
    corner: vec3<u32>,
    // whether there is one
    listed: bool,
    // no ray of it leaves the volume
    interior: bool,
}

// Makes ready to gather its voxels, behind a barrier, which sums that were cleared before share.
fn taken(group: vec3<u32>, lane: u32) -> Taken {
    let entry = params.base + item_of_group(group);
    let listed = entry < list.count;
    let corner = brick_at(list.items[select(0u, entry, listed)], params.bricks) * BRICK;
    clear_needed(lane);
    for (var i = lane; i < MEANS; i += TEAM) {
        cell_means[i] = cells.mean[i];
    }
    workgroupBarrier();
    mark_rows(corner, lane);
    workgroupBarrier();
    let interior = all(corner >= params.reach) && all(corner + BRICK + params.reach <= params.dims);
    return Taken(corner, listed, interior);
}

// What the cells along direction k stop for a voxel that needs a value, in WHOLEths of half a step.
fn lost_along(k: u32, brick: Taken, slot: u32, rule: u32) -> u32 {
    return WHOLE * (2u * params.cells - 1u) - traced(brick.corner + place_of(slot), brick.interior, k, rule).sum;
}

// What occlusion takes from the voxels that need a value, in FINEths of a WHOLEth.
var<workgroup> sums: array<atomic<u32>, VOXELS>;

// One brick.
fn work(group: vec3<u32>, lane: u32, rule: u32) {
    for (var i = lane; i < VOXELS; i += TEAM) {
        atomicStore(&sums[i], 0u);
    }
    let brick = taken(group, lane);
    gather(brick.corner, brick.listed, lane);
    workgroupBarrier();
    let count = atomicLoad(&found);
    for (var i = lane; i < count * params.directions; i += TEAM) {
        let slot = i % count;
        let k = i / count;
        let lost = lost_along(k, brick, slot, rule);
        if lost > 0u {
            atomicAdd(&sums[slot], u32(f32(lost) * directions.all[k].factor));
        }
    }
    workgroupBarrier();
    for (var i = lane; i < count; i += TEAM) {
        let value = WHOLE - ((atomicLoad(&sums[i]) + FINE / 2u) >> FINE_BITS);
        textureStore(ambient, brick.corner + place_of(i), vec4(f32(value) / PARTS, 0.0, 0.0, 0.0));
    }
}

@compute @workgroup_size(TEAM)
fn nearest(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    work(group, lane, NEAREST);
}

@compute @workgroup_size(TEAM)
fn hybrid(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    work(group, lane, HYBRID);
}

@compute @workgroup_size(TEAM)
fn linear(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    work(group, lane, LINEAR);
}

// In coloured light (method.md section 2.1): what is lost along a direction counts by its weights in red, green and blue. A ray is walked once.

struct Tints {
    // of each direction, what a lost half cell adds to the sums of red, green and blue; the last is 0
    all: array<vec4<f32>>,
}

@group(0) @binding(6) var<storage, read> tints: Tints;
// red, green, blue and 1
@group(0) @binding(7) var coloured: texture_storage_3d<rgba16unorm, write>;

// Of each voxel in red, green and blue; as `sums`.
var<workgroup> coloured_sums: array<atomic<u32>, 3 * VOXELS>;

// One brick, as `work`.
fn work_coloured(group: vec3<u32>, lane: u32, rule: u32) {
    for (var i = lane; i < 3u * VOXELS; i += TEAM) {
        atomicStore(&coloured_sums[i], 0u);
    }
    let brick = taken(group, lane);
    for (var i = lane; i < VOXELS; i += TEAM) {
        if brick.listed && spares(brick.corner, i) {
            textureStore(coloured, brick.corner + inside(i), vec4(1.0));
        }
    }
    workgroupBarrier();
    let count = atomicLoad(&found);
    for (var i = lane; i < count * params.directions; i += TEAM) {
        let slot = i % count;
        let k = i / count;
        let lost = lost_along(k, brick, slot, rule);
        if lost > 0u {
            let of_light = vec3<u32>(f32(lost) * tints.all[k].xyz);
            atomicAdd(&coloured_sums[slot], of_light.x);
            atomicAdd(&coloured_sums[VOXELS + slot], of_light.y);
            atomicAdd(&coloured_sums[2u * VOXELS + slot], of_light.z);
        }
    }
    workgroupBarrier();
    for (var i = lane; i < count; i += TEAM) {
        let sum = vec3(
            atomicLoad(&coloured_sums[i]),
            atomicLoad(&coloured_sums[VOXELS + i]),
            atomicLoad(&coloured_sums[2u * VOXELS + i]),
        );
        let value = WHOLE - ((sum + FINE / 2u) >> vec3(FINE_BITS));
        textureStore(coloured, brick.corner + place_of(i), vec4(vec3<f32>(value) / PARTS, 1.0));
    }
}

@compute @workgroup_size(TEAM)
fn nearest_coloured(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    work_coloured(group, lane, NEAREST);
}

@compute @workgroup_size(TEAM)
fn hybrid_coloured(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    work_coloured(group, lane, HYBRID);
}

@compute @workgroup_size(TEAM)
fn linear_coloured(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    work_coloured(group, lane, LINEAR);
}
