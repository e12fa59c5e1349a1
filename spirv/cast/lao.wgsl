// Local ambient occlusion, CAO eq. (2) and (3), over a list of bricks. The full computation and the contextual update
// (CAO section 3.5 step 5) run this same module on different lists: what a voxel's value is never depends on which
// others are computed, and one module has one rounding, so the two agree bit for bit.

struct LaoParams {
    dims: vec3<u32>,
    // M: samples of a ray
    samples: u32,
    // number of bricks along each axis
    bricks: vec3<u32>,
    rays: u32,
    // 1 / spacing in mm
    per_mm: vec3<f32>,
    // distance of the first sample and between samples, mm
    first: f32,
    step: f32,
    // step / reference length of the opacity
    exponent: f32,
    // LEFT, CELL, SEGMENT
    quadrature: u32,
    // BY_MASK, ONLY_NEEDED
    flags: u32,
    // first entry of the list to work on, for dispatches that take the list in parts
    base: u32,
}

struct Rays {
    // unit vector in mm space, weight; sum of weights 1
    ray: array<vec4<f32>, MOST_RAYS>,
}

#include "shared/bricks.wgsl"
#include "shared/categories.wgsl"
#include "shared/ray_set.wgsl"
#include "shared/segment.wgsl"

// Of the listed voxels, the mask decides which are computed.
const BY_MASK = 1u;
// Only voxels that a sample with opacity interpolates.
const ONLY_NEEDED = 2u;

// Rules along a ray.
const LEFT = 0u;
const CELL = 1u;
const SEGMENT = 2u;

var<immediate> params: LaoParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
// linear, transparent outside the volume
@group(0) @binding(1) var field: sampler;
@group(0) @binding(2) var<uniform> rays: Rays;
@group(0) @binding(3) var<storage, read> list: BrickList;
@group(0) @binding(4) var mask: texture_3d<u32>;
@group(0) @binding(5) var precomputed: texture_3d<f32>;
@group(0) @binding(6) var ambient: texture_storage_3d<r32float, write>;

fn opacity_at(position: vec3<f32>) -> f32 {
    return textureSampleLevel(opacity, field, position, 0.0).r;
}

// Transmittance of one step through opacity a, corrected for the step's length.
fn transmittance(a: f32) -> f32 {
    let q = 1.0 - a;
    if params.exponent == 1.0 {
        return q;
    }
    return select(pow(q, params.exponent), 0.0, q <= 0.0);
}

// CAO eq. (2): mean over the samples of the transmittance in front of each.
fn ray_left(start: vec3<f32>, direction: vec3<f32>) -> f32 {
    var before = 1.0;
    var sum = 0.0;
    for (var m = 0u; m < params.samples; m++) {
        sum += before;
        let distance = params.first + f32(m) * params.step;
        before *= transmittance(opacity_at(start + distance * direction));
        if before == 0.0 {
            break;
        }
    }
    return sum / f32(params.samples);
}

// method.md section 3, cell rule: cells centred on the samples, mean of entry and exit.
fn ray_cell(start: vec3<f32>, direction: vec3<f32>) -> f32 {
    var before = 1.0;
    var sum = 0.0;
    for (var m = 0u; m < params.samples; m++) {
        let distance = params.first + f32(m) * params.step;
        let b = transmittance(opacity_at(start + distance * direction));
        sum += before * (1.0 + b) * 0.5;
        before *= b;
        if before == 0.0 {
            break;
        }
    }
    return sum / f32(params.samples);
}

// method.md section 3, exact segment rule. The first segment begins half a step before the first sample, so that all
// directions begin at the same distance.
fn ray_segment(start: vec3<f32>, direction: vec3<f32>) -> f32 {
    var before = 1.0;
    var sum = 0.0;
    var q1 = 1.0 - opacity_at(start + params.first * direction);
    let q_behind = 1.0 - opacity_at(start + (params.first - params.step) * direction);
    var q0 = 0.5 * (q_behind + q1);
    var length = 0.5;
    for (var m = 1u; m <= params.samples; m++) {
        // Both ends opaque: nothing comes through.
        if max(q0, q1) < OPAQUE {
            break;
        }
        let near = max(q0, 0.0);
        let far = max(q1, 0.0);
        let depth = mean_extinction(near, logarithm(near), far, logarithm(far)) * length * params.exponent;
        let through = exp(-depth);
        sum += length * before * mean_transmittance(depth, through);
        before *= through;
        if m < params.samples {
            q0 = q1;
            q1 = 1.0 - opacity_at(start + (params.first + f32(m) * params.step) * direction);
            length = 1.0;
        }
    }
    return sum / (f32(params.samples) - 0.5);
}

// CAO eq. (3) with weights that sum to 1.
fn occlusion_at(voxel: vec3<u32>) -> f32 {
    if params.samples == 0u {
        return 1.0;
    }
    let per_edge = 1.0 / vec3<f32>(params.dims);
    let start = (vec3<f32>(voxel) + 0.5) * per_edge;
    let scale = params.per_mm * per_edge;
    // What is missing from 1, so that rounded weights neither dim nor overfill a voxel that nothing occludes.
    var occluded = 0.0;
    if params.quadrature == LEFT {
        for (var k = 0u; k < params.rays; k++) {
            occluded += rays.ray[k].w * (1.0 - ray_left(start, rays.ray[k].xyz * scale));
        }
    } else if params.quadrature == CELL {
        for (var k = 0u; k < params.rays; k++) {
            occluded += rays.ray[k].w * (1.0 - ray_cell(start, rays.ray[k].xyz * scale));
        }
    } else {
        for (var k = 0u; k < params.rays; k++) {
            occluded += rays.ray[k].w * (1.0 - ray_segment(start, rays.ray[k].xyz * scale));
        }
    }
    return clamp(1.0 - occluded, 0.0, 1.0);
}

fn has_opacity_around(voxel: vec3<u32>) -> bool {
    let last = min(voxel + 1u, params.dims - 1u);
    let first = max(voxel, vec3(1u)) - 1u;
    for (var z = first.z; z <= last.z; z++) {
        for (var y = first.y; y <= last.y; y++) {
            for (var x = first.x; x <= last.x; x++) {
                if textureLoad(opacity, vec3(x, y, z), 0).r > 0.0 {
                    return true;
                }
            }
        }
    }
    return false;
}

fn touches_visible(voxel: vec3<u32>) -> bool {
    let last = min(voxel + 1u, params.dims - 1u);
    let first = max(voxel, vec3(1u)) - 1u;
    for (var z = first.z; z <= last.z; z++) {
        for (var y = first.y; y <= last.y; y++) {
            for (var x = first.x; x <= last.x; x++) {
                if textureLoad(mask, vec3(x, y, z), 0).r != CLIPPED {
                    return true;
                }
            }
        }
    }
    return false;
}

// CAO section 3.5 step 5, with one change: a clipped voxel that touches a visible one is computed, because samples at
// the cut interpolate it; the paper's 1 there lets light leak in along every cut.
fn value_at(voxel: vec3<u32>) -> f32 {
    if (params.flags & BY_MASK) != 0u {
        let category = textureLoad(mask, voxel, 0).r;
        if category > AFFECTED {
            return textureLoad(precomputed, voxel, 0).r;
        }
        if category == CLIPPED && !touches_visible(voxel) {
            return 1.0;
        }
    }
    if (params.flags & ONLY_NEEDED) != 0u && !has_opacity_around(voxel) {
        return 1.0;
    }
    return occlusion_at(voxel);
}

// One workgroup a brick; each invocation takes two slices.
@compute @workgroup_size(BRICK, BRICK, SLICES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let entry = params.base + item_of_group(group);
    if entry >= list.count {
        return;
    }
    let corner = brick_at(list.items[entry], params.bricks) * BRICK;
    for (var slice = 0u; slice < BRICK; slice += SLICES) {
        let voxel = corner + local + vec3(0u, 0u, slice);
        if all(voxel < params.dims) {
            textureStore(ambient, voxel, vec4(value_at(voxel), 0.0, 0.0, 0.0));
        }
    }
}
