// The truth (AOV section 6): cosine-weighted rays into the half space over each pixel's surface, each hit within delta with linear
// falloff. Rays of a pixel are a sequence of low discrepancy (Roberts's R2), shifted by a hash of the pixel; some at a time.
//
//   AO = 1/N sum_i max(0, 1 - t_i / delta)
//
// `capped` is for worlds of which clips cut meshes that ask for caps, which occlude as well.

#include "shared/geometry.wgsl"
#include "shared/ray.wgsl"
#include "shared/caps.wgsl"
#include "shared/bricks.wgsl"
#include "shared/hash.wgsl"
#include "shared/accessibility.wgsl"

struct TraceParams {
    size: vec2<u32>,
    // of all views
    pixels: u32,
    // the first ray of this piece, how many, and how many in all
    first_ray: u32,
    rays: u32,
    all_rays: u32,
    // mm: beyond which nothing occludes
    delta: f32,
}

var<immediate> params: TraceParams;
@group(0) @binding(0) var<uniform> eyes: Eyes;
@group(0) @binding(1) var<storage, read> tree: Tree;
@group(0) @binding(2) var<storage, read> triangles: Triangles;
@group(0) @binding(3) var<storage, read> looks: Looks;
@group(0) @binding(4) var<storage, read> materials: Materials;
@group(0) @binding(5) var<storage, read> texels: Texels;
@group(0) @binding(6) var<storage, read> geometry: Geometry;
// until the last piece has come the sum over the rays so far
@group(0) @binding(7) var<storage, read_write> accessibility: Accessibility;
@group(0) @binding(8) var<storage, read> clips: Clips;
@group(0) @binding(9) var<storage, read> layers: Layers;

const TAU = 6.28318530718;

// What the sequence goes on by along each axis, in 2^-32: 1/g and 1/g^2 of the plastic number g.
const STEP_X = 3242174889u;
const STEP_Y = 2447445414u;

fn trace_pixel(group: vec3<u32>, local: u32, caps: bool) {
    let index = (group.y * GROUPS_PER_ROW + group.x) * 64u + local;
    if index >= params.pixels {
        return;
    }
    let pixels = params.size.x * params.size.y;
    let here = geometry.pixel[index];
    if here.w == 0.0 {
        accessibility.pixel[index] = 1.0;
        return;
    }
    let in_view = index % pixels;
    let place = vec2(in_view % params.size.x, in_view / params.size.x);
    let normal = here.xyz;
    let point = position_of(eyes.eye[index / pixels], params.size, place, here.w);
    let origin = point + uncertainty(point, here.w) * normal;
    // Two directions across (Duff et al. 2017).
    let side = select(-1.0, 1.0, normal.z >= 0.0);
    let a = -1.0 / (side + normal.z);
    let tangent = vec3(1.0 + side * normal.x * normal.x * a, side * normal.x * normal.y * a, -side * normal.x);
    let bitangent = vec3(normal.x * normal.y * a, side + normal.y * normal.y * a, -normal.y);
    let shift_x = scrambled(2u * index);
    let shift_y = scrambled(2u * index + 1u);
    var sum = 0.0;
    if params.first_ray != 0u {
        sum = accessibility.pixel[index];
    }
    for (var i = params.first_ray; i < params.first_ray + params.rays; i++) {
        let u = f32((i * STEP_X + shift_x) >> 8u) / 16777216.0;
        let angle = f32((i * STEP_Y + shift_y) >> 8u) / 16777216.0 * TAU;
        let ring = sqrt(u);
        let direction = tangent * (ring * cos(angle)) + bitangent * (ring * sin(angle)) + normal * sqrt(1.0 - u);
        let hit = first_hit(origin, direction, 0.0, params.delta);
        var t = hit.t;
        if caps {
            t = first_cap(origin, direction, 0.0, hit).t;
        }
        sum += 1.0 - t / params.delta;
    }
    if params.first_ray + params.rays == params.all_rays {
        sum = 1.0 - sum / f32(params.all_rays);
    }
    accessibility.pixel[index] = sum;
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    trace_pixel(group, local, false);
}

@compute @workgroup_size(64)
fn capped(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    trace_pixel(group, local, true);
}
