// What the clips do to each brick (method.md section 6): whether they hide all of it or nothing, and whether
// all or none of its voxels have a hidden point within `reach`. Analytic shapes by the distance at the brick's centre and the
// brick's extent; meshes by the bounds of their depth layers over blocks of pixels, and of their dilation maps, under the
// brick's footprint. The box of a brick holds every clip sample of its voxels.

struct ClipBricksParams {
    dims: vec3<u32>,
    // mm
    reach: f32,
    spacing: vec3<f32>,
    // how far beyond a voxel its clip samples lie, in voxels
    beyond: f32,
}

@group(0) @binding(0) var<storage, read> clips: Clips;
@group(0) @binding(1) var<storage, read> layers: Layers;
@group(0) @binding(2) var<storage, read> dilation: Dilation;
@group(0) @binding(3) var<storage, read_write> clip_bricks: ClipBricks;

#include "shared/bricks.wgsl"
#include "shared/clips.wgsl"
#include "shared/clip_bounds.wgsl"
#include "shared/reach.wgsl"

var<immediate> params: ClipBricksParams;

// Most cells along the edge of a footprint that are looked at; a larger one has some of everything, as likely as not.
const MOST_CELLS = 64;

// A box in a mesh's maps: cells or pixels (inclusive), depths. Wider than the box by the bound of rounding, a thousandth of
// a pixel and a millionth of the depth, which also rounds.
struct Footprint {
    low: vec2<i32>,
    high: vec2<i32>,
    near: f32,
    far: f32,
}

fn footprint(c: u32, rigid: vec3<f32>, extent: vec3<f32>, corner: vec2<f32>, per_mm: f32) -> Footprint {
    let slack = ROUNDINGS * clips.clip[c].cells.w;
    let middle = (rigid.xy - corner) * per_mm;
    let around = (extent.xy + slack) * per_mm + 1e-3 + 1e-6 * abs(middle);
    let per_depth = clips.clip[c].per_depth;
    let depth = (rigid.z - clips.clip[c].corner.z) * per_depth;
    let height = (extent.z + slack) * per_depth + 1e-6 * (1.0 + abs(depth));
    // Far outside every map, not beyond what an i32 holds.
    let low = clamp(floor(middle - around), vec2(-1e6), vec2(1e6));
    let high = clamp(floor(middle + around), vec2(-1e6), vec2(1e6));
    return Footprint(vec2<i32>(low), vec2<i32>(high), depth - height, depth + height);
}

// What a mesh hides of a box: from the blocks' nearest front, farthest back, farthest front and nearest back of each pair.
fn mesh_visibility(c: u32, rigid: vec3<f32>, extent: vec3<f32>) -> u32 {
    let corner = clips.clip[c].corner;
    let place = footprint(c, rigid, extent, corner.xy, corner.w);
    let resolution = i32(clips.clip[c].resolution);
    let edge = (clips.clip[c].resolution + BLOCK - 1u) / BLOCK;
    let size = edge * edge;
    var all_in = all(place.low >= vec2(0)) && all(place.high < vec2(resolution));
    var all_out = true;
    let first = vec2<u32>(max(place.low, vec2(0))) / BLOCK;
    let last = vec2<u32>(clamp(place.high, vec2(-1), vec2(resolution - 1)) + i32(BLOCK)) / BLOCK;
    for (var y = first.y; y < last.y && (all_in || all_out); y++) {
        for (var x = first.x; x < last.x; x++) {
            var block_in = false;
            var at = clips.clip[c].blocks_at + y * edge + x;
            for (var pair = 0u; pair < clips.clip[c].pairs; pair++) {
                all_out = all_out && (place.far <= layers.depth[at] || layers.depth[at + size] <= place.near);
                block_in = block_in || (layers.depth[at + 2u * size] < place.near && place.far < layers.depth[at + 3u * size]);
                at += BLOCK_BOUNDS * size;
            }
            all_in = all_in && block_in;
        }
    }
    if !all_in && !all_out {
        return SAMPLED;
    }
    return select(HIDDEN, VISIBLE, all_out == (clips.clip[c].keep == 0u));
}

fn mesh_reach(c: u32, rigid: vec3<f32>, extent: vec3<f32>) -> u32 {
    let keep = clips.clip[c].keep != 0u;
    let cells = clips.clip[c].cells;
    let place = footprint(c, rigid, extent, cells.xy, cells.z);
    let resolution = i32(clips.clip[c].dilation_resolution);
    if all(place.low < vec2(resolution)) && all(place.high >= vec2(0)) && any(place.high - place.low >= vec2(MOST_CELLS)) {
        return SOME;
    }
    let size = u32(resolution * resolution);
    var all_in = all(place.low >= vec2(0)) && all(place.high < vec2(resolution));
    var all_out = true;
    for (var y = max(place.low.y, 0); y <= min(place.high.y, resolution - 1) && (all_in || all_out); y++) {
        for (var x = max(place.low.x, 0); x <= min(place.high.x, resolution - 1); x++) {
            var cell_in = false;
            var at = clips.clip[c].dilation_at + u32(y * resolution + x);
            for (var pair = 0u; pair < clips.clip[c].pairs; pair++) {
                let front = dilation.depth[at];
                let back = dilation.depth[at + size];
                all_out = all_out && (place.far <= front || back <= place.near);
                cell_in = cell_in || (front < place.near && place.far < back);
                at += 2u * size;
            }
            all_in = all_in && cell_in;
        }
    }
    if !all_in && !all_out {
        return SOME;
    }
    // Inside the maps of a kept mesh nothing that it hides is within reach.
    return select(NONE, ALL, all_in != keep);
}

// As `distance_to_hidden` measures: planes and boxes in mm, all others in local units, times the smallest scale.
fn shape_reach(c: u32, rigid: vec3<f32>, half_edges: vec3<f32>) -> u32 {
    let kind = clips.clip[c].kind;
    let scale = clips.clip[c].scale;
    let keep = clips.clip[c].keep != 0u;
    let rounding = clips.clip[c].cells.w;
    var distance = local_between(c, rigid, half_edges) * scale.w;
    if kind == PLANE || kind == BOX {
        let extent = rigid_extent(c, half_edges);
        let middle = distance_to_hidden(c, rigid);
        distance = between(kind, select(middle, -middle, keep), rigid, scale.xyz, extent, length(half_edges));
        distance += vec2(-ROUNDINGS, ROUNDINGS) * rounding;
    }
    // To what a kept shape hides it is the way out.
    distance = select(distance, -distance.yx, keep);
    if distance.y <= params.reach + rounding {
        return ALL;
    }
    return select(SOME, NONE, distance.x > params.reach + rounding);
}

// One invocation a brick.
@compute @workgroup_size(LANES)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let bricks = bricks_of(params.dims);
    let index = item_of(id, groups);
    if index >= brick_count(bricks) {
        return;
    }
    let first = BRICK * brick_at(index, bricks);
    let last = min(first + (BRICK - 1u), params.dims - 1u);
    let centre = 0.5 * vec3<f32>(vec3<i32>(first + last) - vec3<i32>(params.dims - 1u)) * params.spacing;
    let half_edges = (0.5 * vec3<f32>(last + 1u - first) + params.beyond) * params.spacing;
    var visibility = VISIBLE;
    var reach = NONE;
    var cutting = 0u;
    var reaching = 0u;
    for (var c = 0u; c < clips.count; c++) {
        let rigid = rigid_of(c, centre);
        let extent = rigid_extent(c, half_edges);
        var sees = 0u;
        var near = 0u;
        if clips.clip[c].kind == MESH {
            sees = mesh_visibility(c, rigid, extent);
            near = mesh_reach(c, rigid, extent);
        } else {
            sees = shape_visibility(c, rigid, half_edges);
            near = shape_reach(c, rigid, half_edges);
        }
        visibility = joined_visibility(visibility, sees);
        reach = max(reach, near);
        cutting |= select(0u, 1u << c, sees == CUT || sees == SAMPLED);
        reaching |= select(0u, 1u << c, near == SOME);
    }
    clip_bricks.code[index] = code_of(visibility, reach, cutting, reaching);
}
