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

// T in WHOLEths, and its integral in WHOLEths of half a step.
struct Ray {
    through: u32,
    sum: u32,
}

#include "shared/bricks.wgsl"
#include "shared/whole_rays.wgsl"

var<immediate> params: RaysParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
// linear, transparent outside the volume
@group(0) @binding(1) var field: sampler;
@group(0) @binding(2) var<storage, read> directions: Directions;
@group(0) @binding(3) var<storage, read> cells: Cells;
@group(0) @binding(4) var<storage, read> list: BrickList;
@group(0) @binding(5) var ambient: texture_storage_3d<r16unorm, write>;

#include "shared/needed.wgsl"

// What occlusion takes from the voxels that need a value, in FINEths of a WHOLEth.
var<workgroup> sums: array<atomic<u32>, VOXELS>;

// One cell of opacity `a`; `halves` is what it counts.
fn pass_cell(ray: Ray, a: u32, halves: u32) -> Ray {
    // WHOLEths to WHOLE + 1ths, so that 0 leaves all and WHOLE nothing.
    let after = (ray.through * (65536u - a - (a >> 15u)) + 32768u) >> 16u;
    let mean = (ray.through * cell_means[(a + 128u) >> 8u] + 32768u) >> 16u;
    return Ray(after, ray.sum + halves * mean);
}

// Opacity of the voxel at a place.
fn met(at: vec3<i32>, interior: bool) -> f32 {
    let voxel = at >> vec3(UNIT_BITS);
    if interior || all(vec3<u32>(voxel) < params.dims) {
        return textureLoad(opacity, voxel, 0).r;
    }
    return 0.0;
}

// Cells behind `near` ones, by nearest voxels, in groups of MANY if `many`, of FEW else: loads come before the steps that use them.
fn far_cells(start: Ray, voxel: vec3<u32>, interior: bool, k: u32, near: u32, many: bool) -> Ray {
    var ray = start;
    if ray.through < DARK {
        return ray;
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
        at += step * i32(group);
        m += group;
        if a.x + a.y + a.z + a.w == 0.0 {
            ray.sum += 2u * group * ray.through;
        } else {
            let of_step = in_steps(a);
            ray = pass_cell(ray, of_step.x, 2u);
            ray = pass_cell(ray, of_step.y, 2u);
            if many {
                ray = pass_cell(ray, of_step.z, 2u);
                ray = pass_cell(ray, of_step.w, 2u);
            }
            if ray.through < DARK {
                return ray;
            }
        }
        if !interior && any(vec3<u32>(at >> vec3(UNIT_BITS)) >= params.dims) {
            // Nothing beyond the border.
            ray.sum += ray.through * (2u * (params.cells - m) - 1u);
            return ray;
        }
    }
    for (; m < params.cells; m++) {
        at += step;
        ray = pass_cell(ray, in_step(met(at, interior)), select(2u, 1u, m + 1u == params.cells));
    }
    return ray;
}

// The filter's opacity at so many half steps on a ray that begins half a step out.
fn filtered(voxel: vec3<u32>, k: u32, half_steps: f32) -> f32 {
    let at = vec3<f32>(voxel) + 0.5 + (half_steps + 2.0 * params.shift) * directions.all[k].half_step;
    return textureSampleLevel(opacity, field, at * (1.0 / vec3<f32>(params.dims)), 0.0).r;
}

fn traced(voxel: vec3<u32>, interior: bool, k: u32, rule: u32) -> Ray {
    var ray = Ray(WHOLE, 0u);
    if rule == NEAREST {
        return far_cells(ray, voxel, interior, k, 0u, true);
    }
    var a = vec4(filtered(voxel, k, 1.5), filtered(voxel, k, 2.5), 0.0, 0.0);
    if rule == HYBRID {
        a.z = filtered(voxel, k, 4.0);
        a.w = filtered(voxel, k, 6.0);
    }
    let halves = 1.0 - sqrt(clear(a));
    let near = in_steps(vec4(halves.xy, a.zw));
    ray = pass_cell(ray, near.x, 1u);
    if rule == HYBRID {
        ray = pass_cell(ray, near.y, 1u);
        ray = pass_cell(pass_cell(ray, near.z, 2u), near.w, 2u);
        return far_cells(ray, voxel, interior, k, NEAR, false);
    }
    if params.cells > 1u {
        ray = pass_cell(ray, near.y, 1u);
    }
    for (var m = 2u; m <= params.cells && ray.through >= DARK; m++) {
        let of_step = in_step(filtered(voxel, k, f32(2u * m)));
        ray = pass_cell(ray, of_step, select(2u, 1u, m == params.cells));
    }
    return ray;
}

// One brick.
fn work(group: vec3<u32>, lane: u32, rule: u32) {
    let entry = params.base + item_of_group(group);
    let listed = entry < list.count;
    let corner = brick_at(list.items[select(0u, entry, listed)], params.bricks) * BRICK;
    clear_needed(lane);
    for (var i = lane; i < MEANS; i += TEAM) {
        cell_means[i] = cells.mean[i];
    }
    for (var i = lane; i < VOXELS; i += TEAM) {
        atomicStore(&sums[i], 0u);
    }
    workgroupBarrier();
    mark_rows(corner, lane);
    workgroupBarrier();
    gather(corner, listed, lane);
    workgroupBarrier();
    let count = atomicLoad(&found);
    let interior = all(corner >= params.reach) && all(corner + BRICK + params.reach <= params.dims);
    let whole = WHOLE * (2u * params.cells - 1u);
    for (var i = lane; i < count * params.directions; i += TEAM) {
        let slot = i % count;
        let k = i / count;
        let lost = whole - traced(corner + place_of(slot), interior, k, rule).sum;
        if lost > 0u {
            atomicAdd(&sums[slot], u32(f32(lost) * directions.all[k].factor));
        }
    }
    workgroupBarrier();
    for (var i = lane; i < count; i += TEAM) {
        let value = WHOLE - ((atomicLoad(&sums[i]) + FINE / 2u) >> FINE_BITS);
        textureStore(ambient, corner + place_of(i), vec4(f32(value) / PARTS, 0.0, 0.0, 0.0));
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
    let entry = params.base + item_of_group(group);
    let listed = entry < list.count;
    let corner = brick_at(list.items[select(0u, entry, listed)], params.bricks) * BRICK;
    clear_needed(lane);
    for (var i = lane; i < MEANS; i += TEAM) {
        cell_means[i] = cells.mean[i];
    }
    for (var i = lane; i < 3u * VOXELS; i += TEAM) {
        atomicStore(&coloured_sums[i], 0u);
    }
    workgroupBarrier();
    mark_rows(corner, lane);
    workgroupBarrier();
    for (var i = lane; i < VOXELS; i += TEAM) {
        if listed && spares(corner, i) {
            textureStore(coloured, corner + inside(i), vec4(1.0));
        }
    }
    workgroupBarrier();
    let count = atomicLoad(&found);
    let interior = all(corner >= params.reach) && all(corner + BRICK + params.reach <= params.dims);
    let whole = WHOLE * (2u * params.cells - 1u);
    for (var i = lane; i < count * params.directions; i += TEAM) {
        let slot = i % count;
        let k = i / count;
        let lost = whole - traced(corner + place_of(slot), interior, k, rule).sum;
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
        textureStore(coloured, corner + place_of(i), vec4(vec3<f32>(value) / PARTS, 1.0));
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
