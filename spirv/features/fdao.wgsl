// Feature-driven ambient occlusion (fdAO section 4, eq. (5), (6)) by rays by brick (walk.wgsl): of one feature k the rays of V_o,k (mask.wgsl),
// and what a rule makes of them and of what the passes for the features before k left in V_AO. A pass for each feature, in order.
//
// One workgroup a brick of the list, as in rays.wgsl. Where no matter of k is within reach its values are 1, and no ray is walked. Without
// features all matter is one: then V_o,k is V_o, and there is one pass.

struct FdaoParams {
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
    // ALL, OWN, NEIGHBOURS, MOST or CHANNELS
    combine: u32,
    // k, from 1 on
    feature: u32,
    // how many there are
    features: u32,
}

#include "shared/bricks.wgsl"
#include "shared/held.wgsl"
#include "shared/walk.wgsl"

var<immediate> params: FdaoParams;
// V_o,k
@group(0) @binding(0) var opacity: texture_3d<f32>;
// linear, transparent outside the volume
@group(0) @binding(1) var field: sampler;
@group(0) @binding(2) var<storage, read> directions: Directions;
@group(0) @binding(3) var<storage, read> cells: Cells;
@group(0) @binding(4) var<storage, read> list: BrickList;
// feature of each voxel, from 1 on, 0 where it has none
@group(0) @binding(5) var labels: texture_3d<u32>;
// of `CHANNELS` A_k in channel k - 1; of the other rules the voxel's value in all. Until the last pass notes: of
// `OWN` whose voxel it is, of `NEIGHBOURS` sums
@group(0) @binding(6) var ambient: texture_storage_3d<rgba16unorm, read_write>;
// V_o
@group(0) @binding(7) var matter: texture_3d<f32>;
@group(0) @binding(8) var<storage, read> held: Held;

// Features whose values fit side by side.
const CHANNELS_OF_TEXEL = 4u;

// How values of features become a voxel's: all matter is one; that of its own feature; the mean of its neighbours' own, weighted by opacity, where
// features meet; the most occlusion, which is the least A; none, every feature that a sample can interpolate keeps its own.
const ALL = 0u;
const OWN = 1u;
const NEIGHBOURS = 2u;
const MOST = 3u;
const CHANNELS = 4u;

// Invocations of a workgroup.
const TEAM = 256u;

#include "shared/solid.wgsl"

// Voxels of a brick with those around it.
const WIDE_VOXELS = AROUND * AROUND * AROUND;
// Voxels beyond a ray's reach whose matter it may interpolate, and one for the sampler's rounding.
const BESIDE = 2u;

// Whether matter of the feature is within reach.
var<workgroup> near: atomic<u32>;
var<workgroup> found: atomic<u32>;
// Voxels to walk from, two a word: their places in the brick with those around it.
var<workgroup> members: array<atomic<u32>, WIDE_VOXELS / 2u>;
// What occlusion takes from each voxel by place, in FINEths of a WHOLEth.
var<workgroup> sums: array<atomic<u32>, WIDE_VOXELS>;

// A voxel's place in the brick with those around it; of the voxel itself, by its place in the brick, plus one.
fn place_of(local: vec3<u32>) -> u32 {
    return (local.z * AROUND + local.y) * AROUND + local.x;
}

// The other way.
fn around(place: u32) -> vec3<u32> {
    return vec3(place, place / AROUND, place / (AROUND * AROUND)) % AROUND;
}

fn feature_of(voxel: vec3<u32>) -> u32 {
    return textureLoad(labels, voxel, 0).r;
}

fn matter_at(voxel: vec3<u32>) -> f32 {
    return textureLoad(matter, voxel, 0).r;
}

// Looks for matter of the feature in the bricks within reach.
fn look_around(corner: vec3<u32>, lane: u32) {
    let far = params.reach + BESIDE;
    let low = (max(corner, far) - far) / BRICK;
    let size = min((corner + BRICK + far) / BRICK, params.bricks - 1u) - low + 1u;
    let first = (params.feature - 1u) * brick_count(params.bricks);
    for (var i = lane; i < size.x * size.y * size.z && atomicLoad(&near) == 0u; i += TEAM) {
        if held.bricks[first + brick_index(low + brick_at(i, size), params.bricks)] != 0u {
            atomicStore(&near, 1u);
        }
    }
}

// Rows of what voxels need a value for: the matter of the feature, or all of it.
fn mark_what_counts(corner: vec3<u32>, lane: u32) {
    if params.combine == ALL || params.combine == CHANNELS {
        mark_rows(corner, lane);
        return;
    }
    for (var i = lane; i < WIDE_VOXELS; i += TEAM) {
        let voxel = corner + around(i) - 1u;
        if all(voxel < params.dims) && matter_at(voxel) > 0.0 {
            atomicOr(&rows[i / AROUND], 1u << (i % AROUND));
        }
    }
}

// Whether a voxel of the brick needs a value.
fn wants(local: vec3<u32>) -> bool {
    return params.unneeded == 1u || needed(local);
}

// The feature whose value a voxel takes: its own; without one that of its most opaque neighbour, of equal ones the lowest. 0: none.
fn own_of(voxel: vec3<u32>) -> u32 {
    let own = feature_of(voxel);
    if own != 0u {
        return own;
    }
    var best = 0u;
    var most = 0.0;
    for (var n = 0u; n < 27u; n++) {
        let there = voxel + vec3(n % 3u, n / 3u % 3u, n / 9u) - 1u;
        if all(there < params.dims) {
            let feature = feature_of(there);
            let a = matter_at(there);
            if feature != 0u && (a > most || (a > 0.0 && a == most && feature < best)) {
                most = a;
                best = feature;
            }
        }
    }
    return best;
}

// The same of a voxel of the brick by the first pass, which notes in V_AO whose pass will have the value. 0: nobody's, or it is there.
fn owner(voxel: vec3<u32>, local: vec3<u32>) -> u32 {
    if params.feature == 1u {
        var own = 0u;
        if wants(local) {
            own = own_of(voxel);
        }
        if own != 1u {
            textureStore(ambient, voxel, select(vec4(f32(own) / PARTS, 1.0, 1.0, 1.0), vec4(1.0), own == 0u));
        }
        return own;
    }
    let texel = textureLoad(ambient, voxel);
    // A value is the same in all channels.
    return select(0u, u32(round(texel.x * PARTS)), texel.x < texel.y);
}

// Whether the rule asks for the feature's value in a voxel, in the brick or beside it.
fn asked(voxel: vec3<u32>, local: vec3<u32>) -> bool {
    if params.combine == NEIGHBOURS {
        let inside = all(local < vec3(BRICK));
        return feature_of(voxel) == params.feature && (matter_at(voxel) > 0.0 || (inside && wants(local)));
    }
    return wants(local);
}

fn put(voxel: vec3<u32>, value: u32) {
    textureStore(ambient, voxel, vec4(f32(value) / PARTS));
}

// Those of the passes before; ones before the first.
fn before(voxel: vec3<u32>) -> vec4<f32> {
    if params.feature == 1u {
        return vec4(1.0);
    }
    return textureLoad(ambient, voxel);
}

fn join(place: u32) {
    let slot = atomicAdd(&found, 1u);
    atomicOr(&members[slot >> 1u], place << ((slot & 1u) * 16u));
}

// Puts the voxels that are asked for on the list of the group; others hold 1 if no later pass says more.
fn gather(corner: vec3<u32>, listed: bool, lane: u32) {
    let wide = params.combine == NEIGHBOURS;
    let near_it = atomicLoad(&near) != 0u;
    for (var i = lane; i < select(VOXELS, WIDE_VOXELS, wide); i += TEAM) {
        // Before the brick a place is a large number.
        let local = select(inside(i), around(i) - 1u, vec3(wide));
        let voxel = corner + local;
        if !(listed && all(voxel < params.dims)) {
            continue;
        }
        if params.combine == OWN {
            if owner(voxel, local) == params.feature {
                if near_it {
                    join(place_of(local + 1u));
                } else {
                    put(voxel, WHOLE);
                }
            }
        } else if near_it && asked(voxel, local) {
            join(place_of(local + 1u));
        } else if !wide && params.feature == 1u {
            put(voxel, WHOLE);
        }
    }
}

fn member(slot: u32) -> u32 {
    return atomicLoad(&members[slot >> 1u]) >> ((slot & 1u) * 16u) & 0xffffu;
}

// The feature's value at a place.
fn value_at(place: u32) -> u32 {
    return WHOLE - ((atomicLoad(&sums[place]) + FINE / 2u) >> FINE_BITS);
}

// What a voxel that was asked for makes of it.
fn take_in(voxel: vec3<u32>, value: u32) {
    switch params.combine {
        case MOST: {
            textureStore(ambient, voxel, min(before(voxel), vec4(f32(value) / PARTS)));
        }
        case CHANNELS: {
            let own = vec4(params.feature) == vec4(1u, 2u, 3u, 4u);
            textureStore(ambient, voxel, select(before(voxel), vec4(f32(value) / PARTS), own));
        }
        default: {
            put(voxel, value);
        }
    }
}

// Two numbers of 32 bits as four channels.
fn packed(pair: vec2<u32>) -> vec4<f32> {
    return vec4<f32>(vec4(pair & vec2(0xffffu), pair >> vec2(16u))) / PARTS;
}

// Adds to a voxel's mean what neighbours of the feature give, in whole numbers, and takes the mean behind the last. Where features do not meet its own value
// counts alone.
fn blend(voxel: vec3<u32>, local: vec3<u32>) {
    let own = feature_of(voxel);
    var meet = false;
    var total = 0u;
    // sums of opacity times the value's upper and lower byte
    var sum = vec2(0u);
    for (var n = 0u; n < 27u; n++) {
        let offset = vec3(n % 3u, n / 3u % 3u, n / 9u);
        let there = voxel + offset - 1u;
        if all(there < params.dims) {
            let feature = feature_of(there);
            meet = meet || feature != own;
            if feature != 0u {
                let a = u32(round(matter_at(there) * PARTS));
                total += a;
                if feature == params.feature && a > 0u {
                    let value = value_at(place_of(local + offset));
                    sum += a * vec2(value >> 8u, value & 255u);
                }
            }
        }
    }
    if !meet {
        if own == params.feature {
            put(voxel, value_at(place_of(local + 1u)));
        } else if own == 0u && params.feature == 1u {
            put(voxel, WHOLE);
        }
        return;
    }
    if params.feature > 1u {
        let parts = vec4<u32>(round(textureLoad(ambient, voxel) * PARTS));
        sum += parts.xy | parts.zw << vec2(16u);
    }
    if params.feature < params.features {
        textureStore(ambient, voxel, packed(sum));
    } else {
        let mean = (256.0 * f32(sum.x) + f32(sum.y)) / f32(max(total, 1u));
        put(voxel, select(WHOLE, u32(round(mean)), total > 0u));
    }
}

// One brick.
fn work(group: vec3<u32>, lane: u32, rule: u32) {
    let entry = params.base + item_of_group(group);
    let listed = entry < list.count;
    let corner = brick_at(list.items[select(0u, entry, listed)], params.bricks) * BRICK;
    for (var i = lane; i < MEANS; i += TEAM) {
        cell_means[i] = cells.mean[i];
    }
    for (var i = lane; i < WIDE_VOXELS; i += TEAM) {
        atomicStore(&sums[i], 0u);
        if i < WIDE_VOXELS / 2u {
            atomicStore(&members[i], 0u);
        }
    }
    clear_rows(lane);
    let all_matter = params.combine == ALL;
    if lane == 0u {
        atomicStore(&near, u32(all_matter));
        atomicStore(&found, 0u);
    }
    workgroupBarrier();
    if listed && !all_matter {
        look_around(corner, lane);
    }
    workgroupBarrier();
    // Who owns which voxel the first pass has noted.
    if params.combine != OWN || params.feature == 1u {
        mark_what_counts(corner, lane);
    }
    workgroupBarrier();
    gather(corner, listed, lane);
    workgroupBarrier();
    let count = atomicLoad(&found);
    let beside = params.reach + select(0u, 1u, params.combine == NEIGHBOURS);
    let interior = all(corner >= beside) && all(corner + BRICK + beside <= params.dims);
    let whole = WHOLE * (2u * params.cells - 1u);
    for (var i = lane; i < count * params.directions; i += TEAM) {
        let place = member(i % count);
        let k = i / count;
        let lost = whole - traced(corner + around(place) - 1u, interior, k, rule).sum;
        if lost > 0u {
            atomicAdd(&sums[place], u32(f32(lost) * directions.all[k].factor));
        }
    }
    workgroupBarrier();
    if params.combine != NEIGHBOURS {
        for (var i = lane; i < count; i += TEAM) {
            let place = member(i);
            take_in(corner + around(place) - 1u, value_at(place));
        }
        return;
    }
    for (var i = lane; i < VOXELS; i += TEAM) {
        let local = inside(i);
        if listed && all(corner + local < params.dims) {
            if wants(local) {
                blend(corner + local, local);
            } else if params.feature == 1u {
                put(corner + local, WHOLE);
            }
        }
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
