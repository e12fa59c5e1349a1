// Vicinity shading: of the directions on the brighter side of a voxel's gradient, weighted by their cosine, the share along which no voxel
// within the radius is more opaque than the voxel itself. One workgroup a brick of the list. Voxels on a line are found in whole UNITths,
// opacities compared as the whole numbers that they are; a value depends on nothing but these and on the six neighbours' opacities.

struct VicinityParams {
    dims: vec3<u32>,
    directions: u32,
    bricks: vec3<u32>,
    // first entry of the list to work on
    base: u32,
    // smallest spacing / spacing, halved: differences to slopes
    slope: vec3<f32>,
    // 1: every voxel gets a value
    unneeded: u32,
    // reference lengths of a voxel's smallest spacing
    exponent: f32,
}

struct Direction {
    // from one voxel of the line to the next, in UNITths of a voxel: one voxel along its longest axis
    step: vec3<i32>,
    // of these, within the radius
    steps: u32,
    // unit vector in mm, times the direction's weight
    weighted: vec3<f32>,
}

struct Directions {
    all: array<Direction>,
}

#include "shared/listed.wgsl"
#include "shared/opaque.wgsl"
#include "shared/parts.wgsl"

var<immediate> params: VicinityParams;
// V_o, per reference length.
@group(0) @binding(0) var opacity: texture_3d<f32>;
@group(0) @binding(1) var<storage, read> directions: Directions;
@group(0) @binding(2) var<storage, read> list: BrickList;
@group(0) @binding(3) var ambient: texture_storage_3d<r16unorm, write>;

// Invocations of a workgroup.
const TEAM = 128u;

// Parts of a voxel.
const UNIT = 65536;
const UNIT_BITS = 16u;
// Of a smallest spacing: gradients below it are none.
const FLAT = 1e-3;
// How much more opaque of a smallest spacing is more opaque.
const MORE = 1.0 / 255.0;

// Opacity in PARTS, 0 outside the volume.
fn parts_at(voxel: vec3<i32>) -> f32 {
    if any(vec3<u32>(voxel) >= params.dims) {
        return 0.0;
    }
    return round(textureLoad(opacity, voxel, 0).r * PARTS);
}

// Per smallest spacing, towards less opacity.
fn normal_at(voxel: vec3<i32>) -> vec3<f32> {
    let x = parts_at(voxel - vec3(1, 0, 0)) - parts_at(voxel + vec3(1, 0, 0));
    let y = parts_at(voxel - vec3(0, 1, 0)) - parts_at(voxel + vec3(0, 1, 0));
    let z = parts_at(voxel - vec3(0, 0, 1)) - parts_at(voxel + vec3(0, 0, 1));
    return vec3(x, y, z) * params.slope / PARTS;
}

// In PARTS of a reference length: what is above it is more opaque than the voxel.
fn threshold(voxel: vec3<i32>) -> f32 {
    let own = parts_at(voxel);
    if params.exponent == 1.0 {
        // Half a part more: texels are whole numbers of parts but for rounding.
        return own + round(MORE * PARTS) + 0.5;
    }
    // 1 - a of a smallest spacing, and back.
    let clear = pow(max(1.0 - own / PARTS, OPAQUE), params.exponent) - MORE;
    return select(PARTS, PARTS * (1.0 - pow(clear, 1.0 / params.exponent)), clear > 0.0);
}

fn value_of(voxel: vec3<i32>) -> f32 {
    let normal = normal_at(voxel);
    if dot(normal, normal) < FLAT * FLAT {
        return 1.0;
    }
    let limit = threshold(voxel);
    var visible = 0.0;
    var all_of_it = 0.0;
    for (var k = 0u; k < params.directions; k++) {
        let direction = directions.all[k];
        let weight = dot(normal, direction.weighted);
        if weight <= 0.0 {
            continue;
        }
        all_of_it += weight;
        var at = voxel * UNIT + UNIT / 2;
        var seen = true;
        for (var m = 0u; m < direction.steps && seen; m++) {
            at += direction.step;
            let there = at >> vec3(UNIT_BITS);
            // Nothing beyond the border.
            if any(vec3<u32>(there) >= params.dims) {
                break;
            }
            seen = textureLoad(opacity, there, 0).r * PARTS <= limit;
        }
        visible += select(0.0, weight, seen);
    }
    return select(1.0, visible / all_of_it, all_of_it > 0.0);
}

@compute @workgroup_size(TEAM)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let brick = listed_brick(group, lane);
    let corner = brick.xyz;
    let listed = brick.w == 1u;
    for (var i = lane; i < VOXELS; i += TEAM) {
        let voxel = corner + inside(i);
        if listed && all(voxel < params.dims) {
            var value = 1.0;
            if params.unneeded == 1u || needed(inside(i)) {
                value = value_of(vec3<i32>(voxel));
            }
            textureStore(ambient, voxel, vec4(value, 0.0, 0.0, 0.0));
        }
    }
}
