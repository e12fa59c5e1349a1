// Feature-driven ambient occlusion (fdAO section 4, eq. (5), (6)) by rays by brick (rays.wgsl): of each feature k the rays of V_o,k, which is
// V_o in the voxels of k and 0 elsewhere, masked before it is interpolated; then the values A_k of a voxel become one by a rule.
//
// One workgroup a brick of the list, as in rays.wgsl. A ray is walked once for GROUP features: a far cell is one voxel, so it takes light
// from one feature and passes the others whole. A ray of a feature that nobody asks for begins dark, and one that is dark adds nothing,
// so that each feature's sum is to the bit what the ray of V_o,k alone would have.

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
    // OWN, NEIGHBOURS, MOST or CHANNELS
    combine: u32,
    // groups of GROUP features to follow
    groups: u32,
    // 1: near cells read no voxel farther than MARGIN from their brick
    close: u32,
}

// Rays of a group of features: T of each in WHOLEths, and its integral in WHOLEths of half a step.
struct Rays {
    through: vec4<u32>,
    sum: vec4<u32>,
}

#include "shared/bricks.wgsl"
#include "shared/features.wgsl"
#include "shared/whole_rays.wgsl"

var<immediate> params: FdaoParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
// linear, transparent outside the volume
@group(0) @binding(1) var field: sampler;
@group(0) @binding(2) var<storage, read> directions: Directions;
@group(0) @binding(3) var<storage, read> cells: Cells;
@group(0) @binding(4) var<storage, read> list: BrickList;
// feature of each voxel, 1 ... MOST_FEATURES, 0 where it has none
@group(0) @binding(5) var labels: texture_3d<u32>;
// of `CHANNELS` A_k in channel k - 1; of the other rules the voxel's value in all
@group(0) @binding(6) var ambient: texture_storage_3d<rgba16unorm, write>;

// Features that are walked together.
const GROUP = 4u;

// How values of features become a voxel's: that of its own feature; the mean of its neighbours' own, weighted by opacity, where features
// meet; the most occlusion, which is the least A; none, every feature that a sample can interpolate keeps its own.
const OWN = 0u;
const NEIGHBOURS = 1u;
const MOST = 2u;
const CHANNELS = 3u;

// Invocations of a workgroup.
const TEAM = 256u;
// Voxels of a brick, and of one with the voxels around it.
const VOXELS = BRICK * BRICK * BRICK;
const WIDE = BRICK + 2u;
const WIDE_VOXELS = WIDE * WIDE * WIDE;
// Voxels around a brick whose features are kept in workgroup memory, and the edge of all that.
const MARGIN = 4u;
const BOX = BRICK + 2u * MARGIN;
// Codes in a word.
const CODES = 8u;
// Code of opacity without a feature; 0 is that of none, and other codes are features.
const OTHER = MOST_FEATURES + 1u;

// Codes of the voxels around, a row in two words, y + BOX z.
var<workgroup> codes: array<u32, BOX * BOX * BOX / CODES>;
// Bit n: code n is among them.
var<workgroup> present: atomic<u32>;
var<workgroup> found: atomic<u32>;
// Voxels to work on, two a word: a place in the wide brick, and which features of the group from bit WANTED_AT on.
var<workgroup> members: array<atomic<u32>, VOXELS>;
// What occlusion takes from them, in FINEths of a WHOLEth: of `MOST` and `CHANNELS` GROUP in a row. Values of `NEIGHBOURS` follow by place.
var<workgroup> sums: array<atomic<u32>, VOXELS * GROUP>;
// Least value of each voxel so far.
var<workgroup> least: array<u32, VOXELS>;

const PLACE = 1023u;
const WANTED_AT = 10u;
const BY_PLACE = 1024u;

fn code_at(place: vec3<u32>) -> u32 {
    let at = (place.z * BOX + place.y) * BOX + place.x;
    return codes[at / CODES] >> (4u * (at % CODES)) & 15u;
}

fn feature_of(voxel: vec3<u32>) -> u32 {
    return textureLoad(labels, voxel, 0).r;
}

fn opacity_at(voxel: vec3<u32>) -> f32 {
    return textureLoad(opacity, voxel, 0).r;
}

fn code_of(voxel: vec3<u32>) -> u32 {
    if any(voxel >= params.dims) || opacity_at(voxel) == 0.0 {
        return 0u;
    }
    let feature = feature_of(voxel);
    return select(feature, OTHER, feature == 0u);
}

// Bit n: code n is among the 27 voxels around a voxel of the brick, 0 left out.
fn touched(local: vec3<u32>) -> u32 {
    var bits = 0u;
    for (var n = 0u; n < 27u; n++) {
        let code = code_at(local + vec3(n % 3u, n / 3u % 3u, n / 9u) + (MARGIN - 1u));
        bits |= select(0u, 1u << code, code != 0u);
    }
    return bits;
}

// The feature whose value a voxel takes: its own; without one that of its most opaque neighbour, of equal ones the lowest. 0: none.
fn own_of(voxel: vec3<u32>, local: vec3<u32>) -> u32 {
    let own = feature_of(voxel);
    if own != 0u {
        return own;
    }
    var found = 0u;
    var most = 0.0;
    for (var n = 0u; n < 27u; n++) {
        let offset = vec3(n % 3u, n / 3u % 3u, n / 9u);
        let code = code_at(local + offset + (MARGIN - 1u));
        if code != 0u && code != OTHER {
            let a = opacity_at(voxel + offset - 1u);
            if a > most || (a == most && code < found) {
                most = a;
                found = code;
            }
        }
    }
    return found;
}

// Which channel of a group that begins behind `base` a feature is, as a mask.
fn channel(feature: u32, base: u32) -> vec4<bool> {
    return vec4(feature - base) == vec4(1u, 2u, 3u, 4u);
}

// One cell of every feature's opacity; `halves` is what it counts.
fn pass_cells(rays: Rays, a: vec4<u32>, halves: u32) -> Rays {
    // WHOLEths to WHOLE + 1ths, so that 0 leaves all and WHOLE nothing.
    let after = (rays.through * (65536u - a - (a >> vec4(15u))) + 32768u) >> vec4(16u);
    let at = (a + 128u) >> vec4(8u);
    let means = vec4(cell_means[at.x], cell_means[at.y], cell_means[at.z], cell_means[at.w]);
    return Rays(after, rays.sum + halves * ((rays.through * means + 32768u) >> vec4(16u)));
}

// One cell of one feature.
fn pass_one(rays: Rays, a: u32, feature: vec4<bool>, halves: u32) -> Rays {
    let own = select(vec4(0u), rays.through, feature);
    let through = own.x + own.y + own.z + own.w;
    let after = (through * (65536u - a - (a >> 15u)) + 32768u) >> 16u;
    let mean = (through * cell_means[(a + 128u) >> 8u] + 32768u) >> 16u;
    return Rays(
        select(rays.through, vec4(after), feature),
        rays.sum + halves * select(rays.through, vec4(mean), feature),
    );
}

// Rays at their ends add nothing more.
fn ended(rays: Rays) -> Rays {
    return Rays(select(rays.through, vec4(0u), rays.through < vec4(DARK)), rays.sum);
}

fn all_dark(rays: Rays) -> bool {
    return all(rays.through == vec4(0u));
}

// Opacity of the voxel at a place.
fn met(at: vec3<i32>, interior: bool) -> f32 {
    let voxel = at >> vec3(UNIT_BITS);
    if interior || all(vec3<u32>(voxel) < params.dims) {
        return textureLoad(opacity, voxel, 0).r;
    }
    return 0.0;
}

// One far cell of this opacity in steps.
fn pass_met(rays: Rays, at: vec3<i32>, a: u32, base: u32, halves: u32) -> Rays {
    if a == 0u {
        return Rays(rays.through, rays.sum + halves * rays.through);
    }
    return pass_one(rays, a, channel(feature_of(vec3<u32>(at >> vec3(UNIT_BITS))), base), halves);
}

// Cells behind `near` ones, as in rays.wgsl.
fn far_cells(start: Rays, voxel: vec3<u32>, interior: bool, k: u32, base: u32, near: u32, many: bool) -> Rays {
    var rays = ended(start);
    if all_dark(rays) {
        return rays;
    }
    let group = select(FEW, MANY, many);
    let step = directions.all[k].step;
    let first = vec3<i32>(round(params.shift * vec3<f32>(step)));
    var at = vec3<i32>(voxel) * UNIT + UNIT / 2 + first + step * i32(near);
    var m = near;
    while m + group < params.cells {
        var a = vec4(met(at + step, interior), met(at + 2 * step, interior), 0.0, 0.0);
        if many {
            a.z = met(at + 3 * step, interior);
            a.w = met(at + 4 * step, interior);
        }
        if a.x + a.y + a.z + a.w == 0.0 {
            rays.sum += 2u * group * rays.through;
        } else {
            let of_step = in_steps(a);
            rays = pass_met(rays, at + step, of_step.x, base, 2u);
            rays = pass_met(rays, at + 2 * step, of_step.y, base, 2u);
            if many {
                rays = pass_met(rays, at + 3 * step, of_step.z, base, 2u);
                rays = pass_met(rays, at + 4 * step, of_step.w, base, 2u);
            }
            rays = ended(rays);
            if all_dark(rays) {
                return rays;
            }
        }
        at += step * i32(group);
        m += group;
        if !interior && any(vec3<u32>(at >> vec3(UNIT_BITS)) >= params.dims) {
            // Nothing beyond the border.
            rays.sum += rays.through * (2u * (params.cells - m) - 1u);
            return rays;
        }
    }
    for (; m < params.cells; m++) {
        at += step;
        let halves = select(2u, 1u, m + 1u == params.cells);
        rays = pass_met(rays, at, in_step(met(at, interior)), base, halves);
    }
    return rays;
}

// Codes of the eight voxels around a place, x fastest, four bits each.
fn eight_codes(first: vec3<u32>, corner: vec3<u32>) -> u32 {
    var eight = 0u;
    if params.close == 1u {
        let place = first + MARGIN - corner;
        // Two neighbours of a row are in one word or in two.
        let word = (place.z * BOX + place.y) * (BOX / CODES) + place.x / CODES;
        let at = 4u * (place.x % CODES);
        for (var n = 0u; n < 4u; n++) {
            let row = word + ((n >> 1u) * BOX + (n & 1u)) * (BOX / CODES);
            let next = codes[min(row + 1u, BOX * BOX * BOX / CODES - 1u)];
            let pair = codes[row] >> at | select(next << (32u - at), 0u, at == 0u);
            eight |= (pair & 255u) << (8u * n);
        }
        return eight;
    }
    for (var n = 0u; n < 8u; n++) {
        eight |= code_of(first + vec3(n & 1u, n >> 1u & 1u, n >> 2u)) << (4u * n);
    }
    return eight;
}

// Each wanted feature's opacity at so many half steps on a ray that begins half a step out: the filter's, where it reads one feature only, else
// by hand.
fn filtered(voxel: vec3<u32>, corner: vec3<u32>, k: u32, base: u32, wanted: vec4<bool>, half_steps: f32) -> vec4<f32> {
    let at = vec3<f32>(voxel) + 0.5 + (half_steps + 2.0 * params.shift) * directions.all[k].half_step;
    let here = atomicLoad(&present);
    var eight = 0u;
    var one = firstTrailingBit(here);
    let low = floor(at - 0.5);
    let first = vec3<u32>(vec3<i32>(low));
    if params.close == 0u || countOneBits(here) != 1u {
        eight = eight_codes(first, corner);
        // The lowest bit of each code that is not 0, and the first such code in all of these.
        let some = (eight | eight >> 1u | eight >> 2u | eight >> 3u) & 0x11111111u;
        if some == 0u {
            return vec4(0.0);
        }
        one = eight >> firstTrailingBit(some) & 15u;
        if ((eight ^ (one * 0x11111111u)) & (some * 15u)) != 0u {
            one = 0u;
        }
    }
    if one != 0u {
        let own = wanted & channel(one, base);
        if !any(own) {
            return vec4(0.0);
        }
        let a = textureSampleLevel(opacity, field, at * (1.0 / vec3<f32>(params.dims)), 0.0).r;
        return select(vec4(0.0), vec4(a), own);
    }
    let w = at - 0.5 - low;
    var sum = vec4(0.0);
    for (var n = 0u; n < 8u; n++) {
        let own = wanted & channel(eight >> (4u * n) & 15u, base);
        if any(own) {
            let side = vec3(n & 1u, n >> 1u & 1u, n >> 2u);
            let weights = select(1.0 - w, w, side == vec3(1u));
            let share = weights.x * weights.y * weights.z * opacity_at(first + side);
            sum += select(vec4(0.0), vec4(share), own);
        }
    }
    return sum;
}

fn traced(voxel: vec3<u32>, corner: vec3<u32>, interior: bool, k: u32, base: u32, wanted: vec4<bool>, rule: u32) -> vec4<u32> {
    var rays = Rays(select(vec4(0u), vec4(WHOLE), wanted), vec4(0u));
    if rule == NEAREST {
        return far_cells(rays, voxel, interior, k, base, 0u, true).sum;
    }
    let first = 1.0 - sqrt(clear(filtered(voxel, corner, k, base, wanted, 1.5)));
    rays = pass_cells(rays, in_steps(first), 1u);
    if rule == HYBRID || params.cells > 1u {
        let second = 1.0 - sqrt(clear(filtered(voxel, corner, k, base, wanted, 2.5)));
        rays = pass_cells(rays, in_steps(second), 1u);
    }
    if rule == HYBRID {
        rays = pass_cells(rays, in_steps(filtered(voxel, corner, k, base, wanted, 4.0)), 2u);
        rays = pass_cells(rays, in_steps(filtered(voxel, corner, k, base, wanted, 6.0)), 2u);
        return far_cells(rays, voxel, interior, k, base, NEAR, false).sum;
    }
    rays = ended(rays);
    for (var m = 2u; m <= params.cells && !all_dark(rays); m++) {
        let of_step = in_steps(filtered(voxel, corner, k, base, wanted, f32(2u * m)));
        rays = ended(pass_cells(rays, of_step, select(2u, 1u, m == params.cells)));
    }
    return rays.sum;
}

// A voxel of a brick, x fastest.
fn inside(i: u32) -> vec3<u32> {
    return vec3(i, i / BRICK, i / (BRICK * BRICK)) % BRICK;
}

// The same in the wide brick; less one it is a place in the brick.
fn in_wide(i: u32) -> vec3<u32> {
    return vec3(i, i / WIDE, i / (WIDE * WIDE)) % WIDE;
}

fn wide_of(local: vec3<u32>) -> u32 {
    return ((local.z + 1u) * WIDE + local.y + 1u) * WIDE + local.x + 1u;
}

fn member(slot: u32) -> u32 {
    return atomicLoad(&members[slot >> 1u]) >> ((slot & 1u) * 16u) & 0xffffu;
}

// Takes in a voxel with the features of the group that it wants, if any.
fn join(place: u32, wanted: u32) {
    if wanted != 0u {
        let slot = atomicAdd(&found, 1u);
        atomicOr(&members[slot >> 1u], (place | wanted << WANTED_AT) << ((slot & 1u) * 16u));
        if params.combine == OWN || params.combine == NEIGHBOURS {
            atomicStore(&sums[slot], 0u);
        } else {
            for (var c = 0u; c < GROUP; c++) {
                atomicStore(&sums[slot * GROUP + c], 0u);
            }
        }
    }
}

// Features of a group among these bits of codes.
fn of_group(bits: u32, base: u32) -> u32 {
    return bits >> (base + 1u) & 15u;
}

fn value_of(sum: u32) -> u32 {
    return WHOLE - ((sum + FINE / 2u) >> FINE_BITS);
}

fn put(voxel: vec3<u32>, value: vec4<f32>) {
    textureStore(ambient, voxel, value);
}

fn put_one(voxel: vec3<u32>, value: u32) {
    put(voxel, vec4(f32(value) / PARTS));
}

// Which features of all a voxel of the brick wants to know.
fn wanted_by(voxel: vec3<u32>, local: vec3<u32>, near: u32) -> u32 {
    if params.combine == OWN {
        let own = own_of(voxel, local);
        return select(0u, 1u << own, own != 0u);
    }
    let all_of_them = (1u << (params.groups * GROUP + 1u)) - 2u;
    return select(near, all_of_them, params.combine == MOST || params.unneeded == 1u) & all_of_them;
}

// The mean of the own values around a voxel, weighted by opacity; its own where all of them are one feature's.
fn blended(voxel: vec3<u32>, local: vec3<u32>) -> u32 {
    let own = feature_of(voxel);
    var meet = false;
    var total = 0.0;
    var weighted = 0.0;
    for (var n = 0u; n < 27u; n++) {
        let offset = vec3(n % 3u, n / 3u % 3u, n / 9u) - 1u;
        let there = voxel + offset;
        if all(there < params.dims) {
            let feature = feature_of(there);
            meet = meet || feature != own;
            let a = opacity_at(there);
            if feature != 0u && a > 0.0 {
                total += a;
                weighted += a * f32(atomicLoad(&sums[BY_PLACE + wide_of(local + offset)]));
            }
        }
    }
    if meet {
        return select(WHOLE, u32(round(weighted / total)), total > 0.0);
    }
    if own == 0u {
        return WHOLE;
    }
    return atomicLoad(&sums[BY_PLACE + wide_of(local)]);
}

// One brick.
fn work(group: vec3<u32>, lane: u32, rule: u32) {
    let entry = params.base + item_of_group(group);
    let listed = entry < list.count;
    let corner = brick_at(list.items[select(0u, entry, listed)], params.bricks) * BRICK;
    for (var i = lane; i < MEANS; i += TEAM) {
        cell_means[i] = cells.mean[i];
    }
    if lane == 0u {
        atomicStore(&present, 0u);
    }
    workgroupBarrier();
    var bits = 0u;
    for (var i = lane; i < BOX * BOX * BOX / CODES; i += TEAM) {
        var word = 0u;
        for (var n = 0u; n < CODES; n++) {
            let at = i * CODES + n;
            // Beyond the low border it is a large number.
            let code = code_of(corner + vec3(at % BOX, at / BOX % BOX, at / (BOX * BOX)) - MARGIN);
            word |= code << (4u * n);
            bits |= select(0u, 1u << code, code != 0u);
        }
        codes[i] = word;
    }
    atomicOr(&present, bits);
    workgroupBarrier();
    let wide = params.combine == NEIGHBOURS;
    let beside = select(0u, 1u, wide);
    let interior = all(corner >= params.reach + beside) && all(corner + BRICK + params.reach + beside <= params.dims);
    let whole = WHOLE * (2u * params.cells - 1u);
    for (var g = 0u; g < params.groups; g++) {
        let base = g * GROUP;
        for (var i = lane; i < VOXELS; i += TEAM) {
            atomicStore(&members[i], 0u);
        }
        if lane == 0u {
            atomicStore(&found, 0u);
        }
        workgroupBarrier();
        for (var i = lane; i < select(VOXELS, WIDE_VOXELS, wide); i += TEAM) {
            // In the wide brick a place before the brick is a large number.
            let local = select(inside(i), in_wide(i) - 1u, vec3(wide));
            let voxel = corner + local;
            if listed && all(voxel < params.dims) {
                let own = all(local < vec3(BRICK));
                var near = 0u;
                if own {
                    near = touched(local);
                }
                let needed = own && (params.unneeded == 1u || near != 0u);
                if wide {
                    let feature = feature_of(voxel);
                    if feature != 0u && (needed || opacity_at(voxel) > 0.0) {
                        join(i, of_group(1u << feature, base));
                    }
                } else if needed {
                    let wanted = wanted_by(voxel, local, near);
                    join(wide_of(local), of_group(wanted, base));
                    if g == 0u && wanted == 0u {
                        put_one(voxel, WHOLE);
                    }
                } else if g == 0u {
                    put_one(voxel, WHOLE);
                }
            }
        }
        workgroupBarrier();
        let count = atomicLoad(&found);
        for (var i = lane; i < count * params.directions; i += TEAM) {
            let slot = i % count;
            let k = i / count;
            let one = member(slot);
            let wanted = vec4(one) >> vec4(WANTED_AT, WANTED_AT + 1u, WANTED_AT + 2u, WANTED_AT + 3u);
            let asked = (wanted & vec4(1u)) == vec4(1u);
            let voxel = corner + in_wide(one & PLACE) - 1u;
            let lost = select(vec4(0u), whole - traced(voxel, corner, interior, k, base, asked, rule), asked);
            let taken = vec4<u32>(vec4<f32>(lost) * directions.all[k].factor);
            if params.combine == OWN || wide {
                atomicAdd(&sums[slot], taken.x + taken.y + taken.z + taken.w);
            } else if any(taken > vec4(0u)) {
                atomicAdd(&sums[slot * GROUP], taken.x);
                atomicAdd(&sums[slot * GROUP + 1u], taken.y);
                atomicAdd(&sums[slot * GROUP + 2u], taken.z);
                atomicAdd(&sums[slot * GROUP + 3u], taken.w);
            }
        }
        workgroupBarrier();
        for (var i = lane; i < count; i += TEAM) {
            let one = member(i);
            let place = in_wide(one & PLACE) - 1u;
            let voxel = corner + place;
            switch params.combine {
                case OWN: {
                    put_one(voxel, value_of(atomicLoad(&sums[i])));
                }
                case NEIGHBOURS: {
                    atomicStore(&sums[BY_PLACE + (one & PLACE)], value_of(atomicLoad(&sums[i])));
                }
                case MOST: {
                    let at = (place.z * BRICK + place.y) * BRICK + place.x;
                    let most = max(
                        max(atomicLoad(&sums[i * GROUP]), atomicLoad(&sums[i * GROUP + 1u])),
                        max(atomicLoad(&sums[i * GROUP + 2u]), atomicLoad(&sums[i * GROUP + 3u])),
                    );
                    let before = select(least[at], WHOLE, g == 0u);
                    least[at] = min(before, value_of(most));
                    if g + 1u == params.groups {
                        put_one(voxel, least[at]);
                    }
                }
                default: {
                    let values = vec4(
                        value_of(atomicLoad(&sums[i * GROUP])),
                        value_of(atomicLoad(&sums[i * GROUP + 1u])),
                        value_of(atomicLoad(&sums[i * GROUP + 2u])),
                        value_of(atomicLoad(&sums[i * GROUP + 3u])),
                    );
                    put(voxel, vec4<f32>(values) / PARTS);
                }
            }
        }
        workgroupBarrier();
    }
    for (var i = lane; wide && i < VOXELS; i += TEAM) {
        let local = inside(i);
        let voxel = corner + local;
        if listed && all(voxel < params.dims) {
            if params.unneeded == 1u || touched(local) != 0u {
                put_one(voxel, blended(voxel, local));
            } else {
                put_one(voxel, WHOLE);
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
