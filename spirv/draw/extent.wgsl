// How far what is visible reaches: along each of six ways w the largest w·x over the voxels x that show more than a faint rest.
// First the largest opacity there is, `largest`, then the voxels that have more than a small share of it, `main`. Both keep maxima
// of whole numbers whose order is that of the floats, so that the order of the work does not matter.

struct ExtentParams {
    dims: vec3<u32>,
}

// Ways asked for at once: the four edges of a picture, front and back.
const MOST_WAYS = 6u;

// A vector a way, in units a voxel; its dot product with a voxel is in mm.
struct Ways {
    way: array<vec4<f32>, MOST_WAYS>,
}

struct Extent {
    // bits of the largest opacity
    largest: atomic<u32>,
    // ordered bits of the largest dot product; 0: there is none
    reached: array<atomic<u32>, MOST_WAYS>,
}

// Share of the largest opacity up to which a voxel does not count: 44 such voxels in a row behind each other let half of the light
// through where the largest is 1. Skin in the preset ct-soft, the faintest thing that somebody wants to see, has twice as much.
const FAINT = 1.0 / 64.0;

var<immediate> params: ExtentParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
@group(0) @binding(1) var<storage, read> occupancy: Occupancy;
@group(0) @binding(2) var<storage, read> clip_bricks: ClipBricks;
@group(0) @binding(3) var<uniform> ways: Ways;
@group(0) @binding(4) var<storage, read_write> extent: Extent;

#include "shared/clip_codes.wgsl"
#include "shared/words.wgsl"

// What the workgroup finds.
var<workgroup> found: array<atomic<u32>, MOST_WAYS>;

// Whole numbers in the order of these floats, none of them 0.
fn ordered(value: f32) -> u32 {
    let bits = bitcast<u32>(value);
    return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}

fn can_show(index: u32) -> bool {
    if index >= brick_count(bricks_of(params.dims)) {
        return false;
    }
    let shows = occupancy.visible[index];
    return shows != 0u && ((shows & SPARED) != 0u || visibility_in(clip_bricks.code[index]) != HIDDEN);
}

// A voxel of a brick: an invocation takes one of each slice.
fn voxel_of(corner: vec3<u32>, lane: u32, slice: u32) -> vec3<u32> {
    return corner + vec3(lane % BRICK, lane / BRICK, slice);
}

// Of a place in voxels, from the volume's centre.
fn along(way: u32, place: vec3<f32>) -> f32 {
    return dot(ways.way[way].xyz, place - 0.5 * vec3<f32>(params.dims - 1u));
}

// Whether voxels of this brick may reach further than what is found so far. Half a voxel more than its voxels reach is far more than
// rounding moves one.
fn may_reach_further(corner: vec3<u32>) -> bool {
    let half = 0.5 * f32(BRICK);
    let middle = vec3<f32>(corner) + half - 0.5;
    for (var i = 0u; i < MOST_WAYS; i++) {
        let reach = along(i, middle) + half * dot(abs(ways.way[i].xyz), vec3(1.0));
        if ordered(reach) > atomicLoad(&extent.reached[i]) {
            return true;
        }
    }
    return false;
}

// One workgroup a brick, here and below.
@compute @workgroup_size(LANES)
fn largest(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = item_of_group(group);
    // No opacity is larger than 1.
    if !can_show(index) || atomicLoad(&extent.largest) >= bitcast<u32>(1.0f) {
        return;
    }
    let corner = brick_at(index, bricks_of(params.dims)) * BRICK;
    var most = 0.0;
    for (var slice = 0u; slice < BRICK; slice++) {
        let voxel = voxel_of(corner, lane, slice);
        if all(voxel < params.dims) {
            most = max(most, textureLoad(opacity, voxel, 0).r);
        }
    }
    if bitcast<u32>(most) > atomicLoad(&extent.largest) {
        atomicMax(&extent.largest, bitcast<u32>(most));
    }
}

@compute @workgroup_size(LANES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if lane < MOST_WAYS {
        atomicStore(&found[lane], 0u);
    }
    workgroupBarrier();
    let index = item_of_group(group);
    let corner = brick_at(index, bricks_of(params.dims)) * BRICK;
    if can_show(index) && may_reach_further(corner) {
        let faint = FAINT * bitcast<f32>(atomicLoad(&extent.largest));
        for (var slice = 0u; slice < BRICK; slice++) {
            let voxel = voxel_of(corner, lane, slice);
            if all(voxel < params.dims) && textureLoad(opacity, voxel, 0).r > faint {
                for (var i = 0u; i < MOST_WAYS; i++) {
                    atomicMax(&found[i], ordered(along(i, vec3<f32>(voxel))));
                }
            }
        }
    }
    workgroupBarrier();
    if lane < MOST_WAYS && atomicLoad(&found[lane]) > 0u {
        atomicMax(&extent.reached[lane], atomicLoad(&found[lane]));
    }
}
