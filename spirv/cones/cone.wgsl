// Cone tracing over the volumes of means (after voxel cone tracing, Crassin and others 2011): every voxel of the listed bricks that needs a
// value, along every direction of a set, by steps as long as its cone is half wide, at least a voxel, each with the mean opacity of a cube
// as wide as the cone. `cao_twin::cones::cone` has the equations.
//
// In: `opacity` V_o, `level_1` ... its mip levels, the directions, the list. Out: `ambient` in the listed bricks, one write a voxel. What a cone
// contributes is a whole number, so that sums are the same in any order. Cost: two look-ups a step, some eight steps for a radius of 20 voxels.

struct ConeParams {
    dims: vec3<u32>,
    directions: u32,
    bricks: vec3<u32>,
    // first entry of the list to work on
    base: u32,
    // 1: every voxel gets a value
    unneeded: u32,
    // length of a voxel / reference length of the opacities
    exponent: f32,
    // where cones begin and end, in smallest spacings
    start: f32,
    end: f32,
    // the last level
    levels: f32,
}

struct Cone {
    // voxels along each axis on a way of a smallest spacing
    step: vec3<f32>,
    // its share of the sphere in FINEths
    share: f32,
    // half its width / distance
    tangent: f32,
}

struct Cones {
    all: array<Cone>,
}

#include "shared/bricks.wgsl"
#include "shared/opaque.wgsl"
#include "shared/of_voxel.wgsl"
#include "shared/parts.wgsl"

var<immediate> params: ConeParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
// linear, transparent outside
@group(0) @binding(1) var field: sampler;
@group(0) @binding(2) var<storage, read> table: Levels;
@group(0) @binding(3) var<storage, read> list: BrickList;
@group(0) @binding(4) var ambient: texture_storage_3d<r16unorm, write>;
@group(0) @binding(5) var<storage, read> cones: Cones;
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

// Parts of 1 that a voxel's sum is in.
const FINE = 1073741824.0;
// A cone with less than this is at its end.
const DARK = 0.001;

// What occlusion takes from the voxels that need a value, in FINEths.
var<workgroup> sums: array<atomic<u32>, VOXELS>;

// Mean opacity of a voxel's length in a cube so many voxels wide.
fn mean_in(place: vec3<f32>, width: f32) -> f32 {
    let lod = clamp(log2(width), 0.0, params.levels);
    let l = u32(lod);
    let share = lod - f32(l);
    let fine = mean_around(l, place);
    if share == 0.0 {
        return fine;
    }
    return mix(fine, mean_around(l + 1u, place), share);
}

// Share of a cone's light that is lost.
fn lost_in(voxel: vec3<u32>, k: u32) -> f32 {
    let cone = cones.all[k];
    let origin = vec3<f32>(voxel) + 0.5;
    var at = params.start;
    var through = 1.0;
    var sum = 0.0;
    while at < params.end && through >= DARK {
        let step = min(max(1.0, at * cone.tangent), params.end - at);
        let middle = at + 0.5 * step;
        let a = mean_in(origin + middle * cone.step, 2.0 * middle * cone.tangent);
        let q = 1.0 - a;
        // -ln of what the step lets through; opaque matter lets nothing.
        let x = -log(max(q, OPAQUE)) * step;
        let after = select(exp(-x), 0.0, q < OPAQUE);
        // Below 1/8 a series, whose next term is x^5 / 720, 4e-8.
        let series = 1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0))));
        var mean = select((1.0 - after) / x, series, x < 0.125);
        if q < OPAQUE {
            mean = 0.0;
        }
        sum += through * mean * step;
        through *= after;
        at += step;
    }
    return clamp(1.0 - sum / (params.end - params.start), 0.0, 1.0);
}

// One workgroup a brick.
@compute @workgroup_size(TEAM)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = params.base + item_of_group(group);
    let listed = entry < list.count;
    let corner = brick_at(list.items[select(0u, entry, listed)], params.bricks) * BRICK;
    clear_needed(lane);
    for (var i = lane; i < VOXELS; i += TEAM) {
        atomicStore(&sums[i], 0u);
    }
    workgroupBarrier();
    mark_rows(corner, lane);
    workgroupBarrier();
    gather(corner, listed, lane);
    workgroupBarrier();
    let count = atomicLoad(&found);
    // Voxels fastest, so that neighbours share their direction.
    for (var i = lane; i < count * params.directions; i += TEAM) {
        let slot = i % count;
        let k = i / count;
        let lost = u32(lost_in(corner + place_of(slot), k) * cones.all[k].share);
        if lost > 0u {
            atomicAdd(&sums[slot], lost);
        }
    }
    workgroupBarrier();
    for (var i = lane; i < count; i += TEAM) {
        let value = 1.0 - f32(atomicLoad(&sums[i])) / FINE;
        textureStore(ambient, corner + place_of(i), vec4(round(value * PARTS) / PARTS, 0.0, 0.0, 0.0));
    }
}
