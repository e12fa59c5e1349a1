// Share of a voxel that no clip hides, anti-aliased (CAO eq. (5)): what opacity is multiplied with. Needs the bindings
// `clips`, `layers` and `positions`.

#include "shared/clips.wgsl"
#include "shared/clip_bounds.wgsl"

// Samples that every voxel has: its centre and its corners.
const FIRST_SAMPLES = 9u;
// Further samples where these disagree: sets of 32 and of 8.
const MOST_SAMPLES = 32u;
const FEW_SAMPLES = 8u;
const PLACES = MOST_SAMPLES + FEW_SAMPLES;

// How voxels are sampled.
struct Sampling {
    // additional samples where the first nine disagree: N of CAO eq. (5)
    more: u32,
    // the first of their places
    first: u32,
    // 1: these alone make the share; 0: all N + 9, as the paper has it
    interior: u32,
    // how far from the centre they lie at most along each axis, and how far the corners, in voxels
    support: f32,
    corner: f32,
}

struct Positions {
    // in [-1, 1]^3, whose unit is the support
    sample: array<vec4<f32>, PLACES>,
}

// Centre, then the eight corners.
fn first_nine(i: u32) -> vec3<f32> {
    if i == 0u {
        return vec3(0.0);
    }
    let corner = i - 1u;
    return vec3<f32>(vec3(corner & 1u, corner >> 1u & 1u, corner >> 2u)) * 2.0 - 1.0;
}

// What the bounds of these clips say of one voxel; of meshes, whose layers only samples decide, nothing.
fn voxel_visibility(among: u32, centre: vec3<f32>, half_edges: vec3<f32>) -> u32 {
    var all = VISIBLE;
    for (var c = 0u; c < clips.count && all != HIDDEN; c++) {
        if (among >> c & 1u) == 0u {
            continue;
        }
        if clips.clip[c].kind == MESH {
            all = joined_visibility(all, SAMPLED);
        } else {
            all = joined_visibility(all, shape_visibility(c, rigid_of(c, centre), half_edges));
        }
    }
    return all;
}

// The share of the voxel with this centre in mm, in a brick with this word of ClipBricks. Samples are taken only where neither
// the brick's bounds nor the voxel's own decide, which changes no bit of the answer.
fn visible_share(code: u32, centre: vec3<f32>, spacing: vec3<f32>, how: Sampling) -> f32 {
    let cutting = cutting_in(code);
    let corner = how.corner * spacing;
    var known = visibility_in(code);
    if known == CUT {
        known = voxel_visibility(cutting, centre, corner);
    }
    if known == VISIBLE {
        return 1.0;
    }
    if known == HIDDEN {
        return 0.0;
    }
    var seen = 0u;
    for (var i = 0u; i < FIRST_SAMPLES; i++) {
        seen += u32(visible_to(cutting, centre + first_nine(i) * corner));
    }
    if seen == 0u || seen == FIRST_SAMPLES {
        return f32(seen / FIRST_SAMPLES);
    }
    var asked = FIRST_SAMPLES;
    if how.interior != 0u && how.more > 0u {
        seen = 0u;
        asked = 0u;
    }
    for (var i = 0u; i < how.more; i++) {
        seen += u32(visible_to(cutting, centre + positions.sample[how.first + i].xyz * (how.support * spacing)));
    }
    return f32(seen) / f32(asked + how.more);
}
