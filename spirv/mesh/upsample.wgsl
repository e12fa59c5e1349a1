// Occlusion of every pixel from that of some (AOV section 3.2, 5): a mean over the taps x taps nearest blocks, joint with the geometry.
//
//   w_i = exp(-d_i^2 / 2 sigma^2) exp(-(n.(p_i - p))^2 / 2 (delta/10)^2) max(0, n.n_i)^8    sigma = taps/4 blocks
//
// d_i in blocks, p_i and n_i those of the block's own pixel. The distance is that from the tangent plane and not of depths, which slopes
// have too. Where the weights sum to less than LEAST no block is like the pixel: it is listed, and computed for itself.

#include "shared/geometry.wgsl"
#include "shared/accessibility.wgsl"
#include "shared/sparse.wgsl"

struct UpsampleParams {
    size: vec2<u32>,
    blocks: vec2<u32>,
    step: u32,
    // blocks along an edge of the kernel, odd
    taps: u32,
    delta: f32,
}

var<immediate> params: UpsampleParams;
@group(0) @binding(0) var<uniform> eyes: Eyes;
@group(0) @binding(1) var<storage, read> geometry: Geometry;
@group(0) @binding(2) var<storage, read> sparse_sums: Sparse;
@group(0) @binding(3) var<storage, read_write> accessibility: Accessibility;
@group(0) @binding(4) var<storage, read_write> failures: Failures;

const LEAST = 1e-3;
// Written for a pixel that no block is like: below any accessibility.
const FAILED = -1.0;
// Of delta: how far from the tangent plane a block may be.
const PLANE = 0.1;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let index = pixel_index(params.size, id.z, id.xy);
    let here = geometry.pixel[index];
    if here.w == 0.0 {
        accessibility.pixel[index] = 1.0;
        return;
    }
    let eye = eyes.eye[id.z];
    let point = position_of(eye, params.size, id.xy, here.w);
    let reach = i32(params.taps / 2u);
    let sigma = 0.25 * f32(params.taps);
    let plane = PLANE * params.delta;
    let middle = vec2<i32>(id.xy / params.step);
    var sum = 0.0;
    var weights = 0.0;
    for (var y = -reach; y <= reach; y++) {
        for (var x = -reach; x <= reach; x++) {
            let block = middle + vec2(x, y);
            if any(block < vec2(0)) || any(block >= vec2<i32>(params.blocks)) {
                continue;
            }
            let pixel = min(vec2<u32>(block) * params.step + params.step / 2u, params.size - 1u);
            let there = geometry.pixel[pixel_index(params.size, id.z, pixel)];
            if there.w == 0.0 {
                continue;
            }
            let away = (vec2<f32>(pixel) - vec2<f32>(id.xy)) / f32(params.step);
            let off = dot(here.xyz, position_of(eye, params.size, pixel, there.w) - point);
            let alike = max(0.0, dot(here.xyz, there.xyz));
            let alike2 = alike * alike;
            let alike4 = alike2 * alike2;
            let weight = exp(-0.5 * (dot(away, away) / (sigma * sigma) + off * off / (plane * plane))) * alike4 * alike4;
            sum += weight * sparse_sums.block[pixel_index(params.blocks, id.z, vec2<u32>(block))];
            weights += weight;
        }
    }
    if weights < LEAST {
        accessibility.pixel[index] = FAILED;
        failures.pixel[atomicAdd(&failures.count, 1u)] = index;
        return;
    }
    accessibility.pixel[index] = 1.0 - sum / weights;
}
