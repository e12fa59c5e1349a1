// Stages 4a-4e of CAO section 3.5: opacity after clipping, anti-aliased (eq. (5)), and the category of every voxel:
// a (0) clipped, b (1) visible but its neighbourhood changed, c (2) untouched.
//
// Conservative, unlike the paper's recipe: a voxel is untouched only if no point that any clip hides lies within `reach`
// of it, where `reach` covers the rays, the eight voxels that a sample interpolates and the cell of a clip sample
// (method.md section 5). An untouched voxel therefore takes no clip samples at all. LITERAL is the paper's recipe: nine
// samples tested against the dilation map.

struct ClassifyParams {
    dims: vec3<u32>,
    // additional samples where the first nine disagree: N of eq. (5)
    extra_samples: u32,
    // mm
    spacing: vec3<f32>,
    reach: f32,
    flags: u32,
}

struct Positions {
    // in the voxel's [-1, 1]^3
    sample: array<vec4<f32>, 32>,
}

struct Dilation {
    // for each pair: front map, back map, as in Layers
    depth: array<f32>,
}

struct Count {
    // voxels of category a, b, c
    category: array<atomic<u32>, 3>,
}

const LITERAL = 1u;

@group(0) @binding(0) var full_opacity: texture_3d<f32>;
@group(0) @binding(1) var<storage, read> clips: Clips;
@group(0) @binding(2) var<storage, read> layers: Layers;
@group(0) @binding(3) var<storage, read> dilation: Dilation;
@group(0) @binding(4) var<uniform> positions: Positions;
@group(0) @binding(5) var opacity: texture_storage_3d<r32float, write>;
@group(0) @binding(6) var mask: texture_storage_3d<r8uint, write>;
@group(0) @binding(7) var<storage, read_write> count: Count;

#include "shared/clips.wgsl"

var<immediate> params: ClassifyParams;

var<workgroup> in_group: array<atomic<u32>, 3>;

// Whether the point lies in the dilated (kept shapes: outside the contracted) layers.
fn in_dilation(c: u32, rigid: vec3<f32>) -> bool {
    let keep = clips.clip[c].keep != 0u;
    let resolution = clips.clip[c].dilation_resolution;
    let map = map_of(c, rigid);
    let cells = clips.clip[c].cells;
    let cell = vec2<i32>(floor((rigid.xy - cells.xy) * cells.z));
    if any(cell < vec2(0)) || any(cell >= vec2(i32(resolution))) {
        return keep;
    }
    let size = resolution * resolution;
    var at = clips.clip[c].dilation_at + u32(cell.y) * resolution + u32(cell.x);
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
    let kind = clips.clip[c].kind;
    var distance = 0.0;
    switch kind {
        case MESH: {
            return in_dilation(c, rigid);
        }
        case PLANE: {
            distance = -rigid.z;
        }
        case BOX: {
            distance = box_distance(rigid, clips.clip[c].scale.xyz);
        }
        default: {
            distance = local_distance(kind, rigid / clips.clip[c].scale.xyz) * clips.clip[c].scale.w;
        }
    }
    return select(distance, -distance, clips.clip[c].keep != 0u) <= params.reach + clips.clip[c].cells.w;
}

fn any_in_reach(world: vec3<f32>) -> bool {
    for (var c = 0u; c < clips.count; c++) {
        if in_reach(c, world) {
            return true;
        }
    }
    return false;
}

// Centre, then the eight corners.
fn first_nine(i: u32) -> vec3<f32> {
    if i == 0u {
        return vec3(0.0);
    }
    let corner = i - 1u;
    return vec3<f32>(vec3(corner & 1u, corner >> 1u & 1u, corner >> 2u)) * 2.0 - 1.0;
}

fn classify(voxel: vec3<u32>) -> u32 {
    let centre = (vec3<f32>(voxel) - 0.5 * vec3<f32>(params.dims - 1u)) * params.spacing;
    let half_edges = 0.5 * params.spacing;
    let literal = (params.flags & LITERAL) != 0u;
    let full = textureLoad(full_opacity, voxel, 0).r;
    var dilated = any_in_reach(centre);
    if !dilated && !literal {
        textureStore(opacity, voxel, vec4(full, 0.0, 0.0, 0.0));
        return 2u;
    }
    var seen = 0u;
    for (var i = 0u; i < 9u; i++) {
        let sample = centre + first_nine(i) * half_edges;
        seen += u32(visible(sample));
        if literal && any_in_reach(sample) {
            dilated = true;
        }
    }
    var value = full;
    if seen == 0u {
        value = 0.0;
    } else if seen < 9u {
        for (var i = 0u; i < params.extra_samples; i++) {
            seen += u32(visible(centre + positions.sample[i].xyz * half_edges));
        }
        value = f32(seen) / f32(9u + params.extra_samples) * full;
    }
    textureStore(opacity, voxel, vec4(value, 0.0, 0.0, 0.0));
    if !dilated {
        return 2u;
    }
    return u32(seen > 0u);
}

@compute @workgroup_size(8, 8, 4)
fn main(@builtin(global_invocation_id) voxel: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if lane < 3u {
        atomicStore(&in_group[lane], 0u);
    }
    workgroupBarrier();
    if all(voxel < params.dims) {
        let category = classify(voxel);
        textureStore(mask, voxel, vec4(category, 0u, 0u, 0u));
        atomicAdd(&in_group[category], 1u);
    }
    workgroupBarrier();
    if lane < 3u {
        let n = atomicLoad(&in_group[lane]);
        if n > 0u {
            atomicAdd(&count.category[lane], n);
        }
    }
}
