// Opacity after transfer function and clips, in place: V_o is compared with what it was, so that whatever the edit, only
// bricks whose opacity really changed count as changed (method.md section 5, contextual update from change).
//
// Solids fill what is in none of the volume's own matter: V_o is the larger of both. They are not drawn.
//
// `list_bricks` finds the bricks that an edit can have changed: those with opacity then or now that a clip's surface crosses, or that a
// clip hid and no longer hides, or all if the values or the transfer function changed. `main` computes them.

struct CarveParams {
    dims: vec3<u32>,
    // 1: values or transfer function changed too
    all: u32,
    // mm
    spacing: vec3<f32>,
    // value = stored * slope + bias; stored integers of a UNORM texel, 1: the texel is the stored value
    levels: f32,
    slope: f32,
    bias: f32,
    // 1: there are solids; 1: clips leave them whole
    solids: u32,
    solids_spared: u32,
    sampling: Sampling,
}

// Whether each brick has some of a solid.
struct SolidBricks {
    any: array<u32>,
}

#include "shared/change.wgsl"
#include "shared/features.wgsl"
#include "shared/growing.wgsl"
#include "shared/parts.wgsl"
#include "shared/transfer.wgsl"
#include "shared/words.wgsl"

var<immediate> params: CarveParams;
@group(0) @binding(0) var volume: texture_3d<f32>;
@group(0) @binding(2) var<storage, read> clips: Clips;
@group(0) @binding(3) var<storage, read> layers: Layers;
@group(0) @binding(4) var<uniform> positions: Positions;
@group(0) @binding(5) var<storage, read> clip_bricks: ClipBricks;
@group(0) @binding(6) var<storage, read_write> clip_bricks_before: ClipBricks;
@group(0) @binding(7) var<storage, read> occupancy: Occupancy;
@group(0) @binding(8) var<storage, read_write> contact: Contact;
@group(0) @binding(9) var<storage, read_write> change: Change;
@group(0) @binding(10) var<storage, read_write> growing: GrowingList;
@group(0) @binding(11) var<storage, read> list: BrickList;
@group(0) @binding(13) var<uniform> features: Features;
@group(0) @binding(14) var feature_index: texture_3d<u32>;
@group(0) @binding(15) var solid: texture_3d<f32>;
@group(0) @binding(16) var<storage, read> solid_bricks: SolidBricks;
@group(0) @binding(12) var opacity: texture_storage_3d<r16unorm, read_write>;

#include "shared/clip_opacity.wgsl"
#include "shared/spared.wgsl"

const CUTTING = ALL_CLIPS << CUTTING_AT;
const OF_INTEREST = VISIBILITY_MASK | CUTTING;

// Whether the edit can have changed a brick; notes what the clips do to it.
fn concerned(index: u32) -> bool {
    // Visibility and the clips that leave it open; how far away they reach is of no interest here.
    let now = clip_bricks.code[index] & OF_INTEREST;
    let before = clip_bricks_before.code[index];
    clip_bricks_before.code[index] = now;
    let cut = ((now | before) & CUTTING) != 0u;
    let edited = params.all == 1u || cut || now != before;
    let fills = params.solids == 1u && solid_bricks.any[index] != 0u;
    return edited && (fills || occupancy.visible[index] != 0u || contact.bits[index] != 0u);
}

// One invocation a brick.
@compute @workgroup_size(LANES)
fn list_bricks(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = item_of(id, groups);
    let wanted = index < brick_count(bricks_of(params.dims)) && concerned(index);
    put_in(index, wanted, lane);
}

fn value_of(voxel: vec3<u32>) -> f32 {
    // As in opacity.wgsl: a UNORM texel is rounded back to the integer that the file holds.
    let texel = textureLoad(volume, voxel, 0).r;
    return select(texel, round(texel * params.levels), params.levels > 1.0) * params.slope + params.bias;
}

fn contact_of(local: vec3<u32>) -> u32 {
    let touches = vec3(2u) | select(vec3(0u), vec3(1u), local == vec3(0u)) | select(vec3(0u), vec3(4u), local == vec3(BRICK - 1u));
    var plane = 0u;
    var cube = 0u;
    for (var i = 0u; i < 3u; i++) {
        plane |= select(0u, touches.x << (3u * i), (touches.y >> i & 1u) == 1u);
    }
    for (var i = 0u; i < 3u; i++) {
        cube |= select(0u, plane << (9u * i), (touches.z >> i & 1u) == 1u);
    }
    return cube;
}

var<workgroup> found: atomic<u32>;
var<workgroup> different: atomic<u32>;

// One workgroup a brick; each invocation takes two slices.
@compute @workgroup_size(BRICK, BRICK, SLICES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let entry = item_of_group(group);
    let listed = entry < list.count;
    let bricks = bricks_of(params.dims);
    let index = list.items[select(0u, entry, listed)];
    let code = clip_bricks.code[index];
    if lane == 0u {
        atomicStore(&found, 0u);
        atomicStore(&different, 0u);
    }
    workgroupBarrier();
    for (var slice = 0u; slice < BRICK; slice += SLICES) {
        let inside = local + vec3(0u, 0u, slice);
        let voxel = brick_at(index, bricks) * BRICK + inside;
        if listed && all(voxel < params.dims) {
            let centre = (vec3<f32>(voxel) - 0.5 * vec3<f32>(params.dims - 1u)) * params.spacing;
            var value = opacity_of(value_of(voxel));
            var filled = 0.0;
            if params.solids == 1u {
                filled = textureLoad(solid, voxel, 0).r;
            }
            let spared = is_spared(voxel);
            let cut_solid = filled > 0.0 && params.solids_spared == 0u;
            if (value > 0.0 && !spared) || cut_solid {
                let left = visible_share(code, centre, params.spacing, params.sampling);
                value *= select(left, 1.0, spared);
                filled *= select(1.0, left, cut_solid);
            }
            value = max(value, filled);
            let now = u32(round(value * PARTS));
            let stored = u32(round(textureLoad(opacity, voxel).r * PARTS));
            if now != stored {
                textureStore(opacity, voxel, vec4(f32(now) / PARTS, 0.0, 0.0, 0.0));
                atomicStore(&different, 1u);
            }
            if now > 0u {
                let touched = contact_of(inside);
                // Most have nothing to add, and additions to one word queue.
                if (touched & ~atomicLoad(&found)) != 0u {
                    atomicOr(&found, touched);
                }
            }
        }
    }
    workgroupBarrier();
    if lane == 0u && listed {
        contact.bits[index] = atomicLoad(&found);
        if atomicLoad(&different) != 0u {
            change.distance[index] = 0.0;
        }
    }
}
