// Dilation maps of one mesh clip (CAO section 3.4 step 3, eq. (4)): the Minkowski sum of the depth layers and a sphere.
//
// Conservative: the maps stand for cells, not for points. `reduce` takes the hull of all pixels that a cell touches; `main` adds
// the sphere over the distance between cells, max(|dx| - 1, 0), so that every point within `radius` of any point of the
// layers lies inside. For a kept shape the layers are contracted instead: what remains is inside with its whole
// neighbourhood. LITERAL is eq. (4) as printed, with distances between pixel centres, at the layers' resolution.

struct DilateParams {
    // pixels along the edge of the layers, cells along the edge of the dilation maps
    resolution: u32,
    cells: u32,
    layers_at: u32,
    dilation_at: u32,
    // mm
    radius: f32,
    cell_mm: f32,
    depth_mm: f32,
    flags: u32,
    // a cell's edge in pixels of the layers; both maps have the same middle
    per_cell: f32,
}

// Hulls of the cells, as in Dilation.
struct Blocks {
    depth: array<f32>,
}

#include "shared/layers.wgsl"

// Flags: the outside is hidden; eq. (4) as printed.
const KEEP = 1u;
const LITERAL = 2u;

var<immediate> params: DilateParams;
@group(0) @binding(0) var<storage, read> layers: Layers;
@group(0) @binding(1) var<storage, read_write> blocks: Blocks;
@group(0) @binding(2) var<storage, read_write> dilation: Dilation;

// The pixel at a place of the layers; -1 or `resolution` beyond them, where a whole number may not hold it.
fn pixel_of(place: vec2<f32>) -> vec2<i32> {
    return vec2<i32>(clamp(floor(place), vec2(-1.0), vec2(f32(params.resolution))));
}

// Hull of the intervals in the pixels under a cell (kept shapes: what all of them share, and nothing where the cell reaches
// beyond the layers). z is the layer pair.
@compute @workgroup_size(8, 8, 1)
fn reduce(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2(params.cells)) {
        return;
    }
    let keep = (params.flags & KEEP) != 0u;
    let size = params.resolution * params.resolution;
    // From the middle, where the layers are: there a thousandth of a pixel is more than rounding moves the cell's edges.
    let corner = 0.5 * f32(params.resolution) + (vec2<f32>(id.xy) - 0.5 * f32(params.cells)) * params.per_cell;
    let literal = (params.flags & LITERAL) != 0u;
    let last = i32(params.resolution) - 1;
    let low = select(pixel_of(corner - 1e-3), vec2<i32>(id.xy), literal);
    let high = select(pixel_of(corner + params.per_cell + 1e-3), vec2<i32>(id.xy), literal);
    let beyond = any(low < vec2(0)) || any(high > vec2(last));
    var front = select(1.0, 0.0, keep && !beyond);
    var back = select(0.0, 1.0, keep && !beyond);
    for (var y = max(low.y, 0); y <= min(high.y, last); y++) {
        for (var x = max(low.x, 0); x <= min(high.x, last); x++) {
            let at = params.layers_at + id.z * 2u * size + u32(y) * params.resolution + u32(x);
            let f = layers.depth[at];
            let b = layers.depth[at + size];
            if keep {
                front = max(front, f);
                back = min(back, select(b, 0.0, f >= EMPTY));
            } else if f < EMPTY {
                front = min(front, f);
                back = max(back, b);
            }
        }
    }
    let cells = params.cells * params.cells;
    let out = id.z * 2u * cells + id.y * params.cells + id.x;
    blocks.depth[out] = front;
    blocks.depth[out + cells] = back;
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2(params.cells)) {
        return;
    }
    let keep = (params.flags & KEEP) != 0u;
    let literal = (params.flags & LITERAL) != 0u;
    let cells = params.cells * params.cells;
    let in_blocks = id.z * 2u * cells;
    // The gap between cells n apart is n - 1 cells, so cells up to radius / cell + 1 apart count.
    let window = i32(ceil(params.radius / params.cell_mm)) + 1;
    let here = vec2<i32>(id.xy);
    // Where no pixel of the layers lies there is nothing to add; for a kept shape that is what counts.
    var nearest = vec2(0);
    var farthest = vec2(i32(params.cells) - 1);
    if !keep && !literal {
        let middle = 0.5 * f32(params.cells);
        let half_edge = 0.5 * f32(params.resolution) / params.per_cell;
        nearest = max(nearest, vec2(i32(floor(middle - half_edge))));
        farthest = min(farthest, vec2(i32(floor(middle + half_edge))));
    }
    // A kept shape ends at the map's edge at the latest: everything beyond is outside it.
    var front = select(NO_FRONT, 0.0, keep);
    var back = select(NO_BACK, 1.0, keep);
    for (var y = max(here.y - window, nearest.y); y <= min(here.y + window, farthest.y); y++) {
        for (var x = max(here.x - window, nearest.x); x <= min(here.x + window, farthest.x); x++) {
            let apart = abs(vec2(x, y) - here);
            let gap = vec2<f32>(select(max(apart - 1, vec2(0)), apart, literal)) * params.cell_mm;
            let below = params.radius * params.radius - dot(gap, gap);
            if below < 0.0 {
                continue;
            }
            let height = sqrt(below) / params.depth_mm;
            let at = in_blocks + u32(y) * params.cells + u32(x);
            let f = blocks.depth[at];
            let b = blocks.depth[at + cells];
            if keep {
                front = max(front, f + height);
                back = min(back, b - height);
            } else if f < EMPTY {
                front = min(front, f - height);
                back = max(back, b + height);
            }
        }
    }
    let out = params.dilation_at + id.z * 2u * cells + id.y * params.cells + id.x;
    dilation.depth[out] = front;
    dilation.depth[out + cells] = back;
}
