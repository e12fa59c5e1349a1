// Stages 4a-4e of CAO section 3.5: opacity after clipping, anti-aliased (eq. (5)), and the category of every voxel:
// a clipped, b visible but its neighbourhood changed, c untouched.
//
// Conservative, unlike the paper's recipe: a voxel is untouched only if no point that any clip hides lies within `reach`
// of it, where `reach` covers the rays, the eight voxels that a sample interpolates and the cell of a clip sample
// (method.md section 5). An untouched voxel therefore takes no clip samples at all, nor does one that the bounds of its brick
// (`clip_bricks`) or its own show to be visible or hidden as a whole. LITERAL is the paper's recipe: nine samples tested
// against the dilation map.

struct ClassifyParams {
    dims: vec3<u32>,
    flags: u32,
    // mm
    spacing: vec3<f32>,
    reach: f32,
    sampling: Sampling,
}

struct Count {
    // voxels of each category
    category: array<atomic<u32>, CATEGORIES>,
}

// Flags: the paper's recipe.
const LITERAL = 1u;

#include "shared/bricks.wgsl"
#include "shared/categories.wgsl"

@group(0) @binding(0) var full_opacity: texture_3d<f32>;
@group(0) @binding(1) var<storage, read> clips: Clips;
@group(0) @binding(2) var<storage, read> layers: Layers;
@group(0) @binding(3) var<storage, read> dilation: Dilation;
@group(0) @binding(4) var<uniform> positions: Positions;
@group(0) @binding(5) var opacity: texture_storage_3d<r32float, write>;
@group(0) @binding(6) var mask: texture_storage_3d<r8uint, write>;
@group(0) @binding(7) var<storage, read_write> count: Count;
@group(0) @binding(8) var<storage, read> clip_bricks: ClipBricks;

@group(0) @binding(9) var<uniform> features: Features;
@group(0) @binding(10) var feature_index: texture_3d<u32>;

#include "shared/clip_opacity.wgsl"
#include "shared/reach.wgsl"
#include "shared/spared.wgsl"

var<immediate> params: ClassifyParams;

var<workgroup> in_group: array<atomic<u32>, CATEGORIES>;

// Whether the point lies in the dilated (kept shapes: outside the contracted) layers.
fn in_dilation(c: u32, rigid: vec3<f32>) -> bool {
    let keep = clips.clip[c].keep != 0u;
    let resolution = clips.clip[c].dilation_resolution;
    let map = map_of(c, rigid);
    let cells = clips.clip[c].cells;
    let place = (rigid.xy - cells.xy) * cells.z;
    if !(all(place >= vec2(0.0)) && all(place < vec2(f32(resolution)))) {
        return keep;
    }
    let cell = vec2<u32>(place);
    let size = resolution * resolution;
    var at = clips.clip[c].dilation_at + cell.y * resolution + cell.x;
    for (var pair = 0u; pair < clips.clip[c].pairs; pair++) {
        if dilation.depth[at] < map.z && map.z < dilation.depth[at + size] {
            return !keep;
        }
        at += 2u * size;
    }
    return keep;
}

// Whether some point that clip c hides may lie within reach of the voxel at this world position.
fn in_reach(c: u32, world: vec3<f32>) -> bool {
    let rigid = rigid_of(c, world);
    if clips.clip[c].kind == MESH {
        return in_dilation(c, rigid);
    }
    return distance_to_hidden(c, rigid) <= params.reach + clips.clip[c].cells.w;
}

// The same for any clip, in a brick with this word of ClipBricks.
fn any_in_reach(code: u32, world: vec3<f32>) -> bool {
    let known = reach_in(code);
    if known != SOME {
        return known == ALL;
    }
    for (var c = 0u; c < clips.count; c++) {
        if (code >> (REACHING_AT + c) & 1u) != 0u && in_reach(c, world) {
            return true;
        }
    }
    return false;
}

fn classify(voxel: vec3<u32>, code: u32) -> u32 {
    let centre = (vec3<f32>(voxel) - 0.5 * vec3<f32>(params.dims - 1u)) * params.spacing;
    let literal = (params.flags & LITERAL) != 0u;
    let full = textureLoad(full_opacity, voxel, 0).r;
    var dilated = any_in_reach(code, centre);
    if !dilated && !literal {
        textureStore(opacity, voxel, vec4(full, 0.0, 0.0, 0.0));
        return UNTOUCHED;
    }
    if literal {
        for (var i = 1u; i < FIRST_SAMPLES; i++) {
            dilated = dilated || any_in_reach(code, centre + first_nine(i) * (params.sampling.corner * params.spacing));
        }
    }
    var share = 1.0;
    if !is_spared(voxel) {
        share = visible_share(code, centre, params.spacing, params.sampling);
    }
    textureStore(opacity, voxel, vec4(share * full, 0.0, 0.0, 0.0));
    if !dilated {
        return UNTOUCHED;
    }
    return select(CLIPPED, AFFECTED, share > 0.0);
}

// Category of all voxels of a brick with this word, CATEGORIES where they may differ.
fn common_category(code: u32) -> u32 {
    let visibility = visibility_in(code);
    let reach = reach_in(code);
    if reach == NONE && visibility == VISIBLE {
        return UNTOUCHED;
    }
    if reach != ALL {
        return CATEGORIES;
    }
    // Of a hidden brick clips may leave some voxels whole.
    let hidden = visibility == HIDDEN && features.any_spared == 0u;
    return select(select(CATEGORIES, AFFECTED, visibility == VISIBLE), CLIPPED, hidden);
}

// Two workgroups a brick, so that all invocations of one go the same way wherever the brick's word decides.
@compute @workgroup_size(BRICK, BRICK, SLICES)
fn main(
    @builtin(global_invocation_id) voxel: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let brick = vec3(group.xy, group.z / (BRICK / SLICES));
    let code = clip_bricks.code[brick_index(brick, bricks_of(params.dims))];
    let shared_category = common_category(code);
    if lane < CATEGORIES {
        atomicStore(&in_group[lane], 0u);
    }
    workgroupBarrier();
    if all(voxel < params.dims) {
        if shared_category < CATEGORIES {
            let full = textureLoad(full_opacity, voxel, 0).r;
            textureStore(opacity, voxel, vec4(select(0.0, full, shared_category != CLIPPED), 0.0, 0.0, 0.0));
            textureStore(mask, voxel, vec4(shared_category, 0u, 0u, 0u));
        } else {
            let category = classify(voxel, code);
            textureStore(mask, voxel, vec4(category, 0u, 0u, 0u));
            atomicAdd(&in_group[category], 1u);
        }
    }
    workgroupBarrier();
    if lane < CATEGORIES {
        let size = vec3(BRICK, BRICK, SLICES);
        let here = min(params.dims - group * size, size);
        let n = select(atomicLoad(&in_group[lane]), here.x * here.y * here.z, lane == shared_category);
        if n > 0u {
            atomicAdd(&count.category[lane], n);
        }
    }
}
