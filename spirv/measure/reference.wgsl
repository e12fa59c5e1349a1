// Converged ambient occlusion at given points (measure.md section 1): very many directions and, along each, very short steps.
//
// Opacity is interpolated here from eight texels in f32: the weights of a graphics processor's filter have 8 bits, which is too
// coarse for a truth. The volume comes with a rim of one transparent voxel, so that opacity is 0 on its border and beyond.

struct ReferenceParams {
    // of the volume with its rim
    dims: vec3<u32>,
    // of a ray
    samples: u32,
    // 1 / spacing in mm
    per_mm: vec3<f32>,
    directions: u32,
    // distance of the first sample and between samples, mm
    first: f32,
    step: f32,
    // step / reference length of the opacity
    exponent: f32,
    // AMBIENT, LITERAL, END
    rule: u32,
    // points to work on
    base: u32,
    count: u32,
    // 1: the device's filter works in f32, as those of software drivers do, and is twice as fast as eight reads
    filtered: u32,
}

struct Directions {
    // unit vectors in mm space, and the light from there in shares of the mean
    unit: array<vec4<f32>>,
}

struct Points {
    // index coordinates in the volume with its rim
    at: array<vec4<f32>>,
}

struct Found {
    ambient: array<f32>,
}

#include "shared/bricks.wgsl"
#include "shared/opaque.wgsl"

// Rules along a ray.
const AMBIENT = 0u;
const LITERAL = 1u;
const END = 2u;
// What is left of a ray below this adds no more than this.
const DARK = 1e-7;
// A ray of END stops with less than this left.
const STOP = 0.01;

var<immediate> params: ReferenceParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
// Steps of one voxel, diagonals included, to the nearest voxel with opacity; at most 255.
@group(0) @binding(1) var clearance: texture_3d<u32>;
@group(0) @binding(2) var field: sampler;
@group(0) @binding(3) var<storage, read> directions: Directions;
@group(0) @binding(4) var<storage, read> points: Points;
@group(0) @binding(5) var<storage, read_write> found: Found;

var<workgroup> sums: array<f32, LANES>;

fn opacity_at(position: vec3<f32>) -> f32 {
    if params.filtered == 1u {
        return textureSampleLevel(opacity, field, (position + 0.5) / vec3<f32>(params.dims), 0.0).r;
    }
    let low = min(vec3<u32>(position), params.dims - 2u);
    let t = position - vec3<f32>(low);
    var plane: array<f32, 2>;
    for (var z = 0u; z < 2u; z++) {
        let a = textureLoad(opacity, low + vec3(0u, 0u, z), 0).r;
        let b = textureLoad(opacity, low + vec3(1u, 0u, z), 0).r;
        let c = textureLoad(opacity, low + vec3(0u, 1u, z), 0).r;
        let d = textureLoad(opacity, low + vec3(1u, 1u, z), 0).r;
        plane[z] = mix(mix(a, b, t.x), mix(c, d, t.x), t.y);
    }
    return mix(plane[0], plane[1], t.z);
}

// (1 - exp(-x)) / x; below 0.01 its series, whose next term is 4e-8.
fn mean_transmittance(x: f32) -> f32 {
    if x < 0.01 {
        return 1.0 - x * (0.5 - x / 6.0);
    }
    return (1.0 - exp(-x)) / x;
}

// Mean over the samples of one ray, or what is left at its end; `along` is its direction in voxels a mm.
fn ray(start: vec3<f32>, along: vec3<f32>) -> f32 {
    // Samples in the box of the texels; those behind it see no opacity.
    let side = select(vec3(0.0), vec3<f32>(params.dims - 1u), along > vec3(0.0));
    let crossing = select((side - start) / along, vec3(1e30), along == vec3(0.0));
    let leave = min(crossing.x, min(crossing.y, crossing.z));
    let inside = min(u32(clamp(floor((leave - params.first) / params.step) + 1.0, 0.0, 1e9)), params.samples);
    let size = abs(along) * params.step;
    let per_voxel = 1.0 / max(size.x, max(size.y, size.z));
    let last = vec3<f32>(params.dims - 1u);

    var before = 1.0;
    var sum = 0.0;
    var m = 0u;
    while m < inside {
        let position = clamp(start + (params.first + f32(m) * params.step) * along, vec3(0.0), last);
        let a = opacity_at(position);
        if a == 0.0 {
            // No sample within the clearance has opacity in one of its eight texels: half a voxel to the texel looked up,
            // one to theirs, and a hundredth for rounding.
            let clear = f32(textureLoad(clearance, vec3<u32>(position + 0.5), 0).r);
            let skip = min(1u + u32(max(clear - 1.51, 0.0) * per_voxel), inside - m);
            sum += before * f32(skip);
            m += skip;
            continue;
        }
        m += 1u;
        let q = 1.0 - a;
        if q < OPAQUE {
            sum += select(before, 0.0, params.rule == AMBIENT);
            before = 0.0;
            break;
        }
        let depth = -params.exponent * log(q);
        sum += before * select(1.0, mean_transmittance(depth), params.rule == AMBIENT);
        before *= exp(-depth);
        if params.rule == END && before < STOP {
            break;
        }
        if before < DARK {
            before = 0.0;
            break;
        }
    }
    if params.rule == END {
        return before;
    }
    return (sum + before * f32(params.samples - m)) / f32(params.samples);
}

// One workgroup a point; its invocations share the directions.
@compute @workgroup_size(LANES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = item_of_group(group);
    let listed = index < params.count;
    var sum = 0.0;
    if listed && params.samples > 0u {
        let start = points.at[params.base + index].xyz;
        for (var k = lane; k < params.directions; k += LANES) {
            let direction = directions.unit[k];
            sum += direction.w * ray(start, direction.xyz * params.per_mm);
        }
    }
    sums[lane] = sum;
    workgroupBarrier();
    if lane == 0u && listed {
        var total = 0.0;
        for (var i = 0u; i < LANES; i++) {
            total += sums[i];
        }
        found.ambient[params.base + index] = select(total / f32(params.directions), 1.0, params.samples == 0u);
    }
}
