// The rays of a pixel (AOV section 6): cosine-weighted, into the half space over its surface, each hit within delta with linear falloff; a
// sequence of low discrepancy (Roberts's R2), shifted by a hash of the pixel, some at a time.
//
//   AO = 1/N sum_i max(0, 1 - t_i / delta)
//
// Kernels bind `eyes`, `geometry` and `accessibility`, and say how far a ray goes: `way_to_hit(origin, direction, caps)`, at most `params.delta`;
// `caps`: whether caps end it, too.

#include "shared/geometry.wgsl"
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
    // 1: neither masks nor clips take any of the triangles, so that ray queries need not ask
    whole: u32,
}

var<immediate> params: TraceParams;

const TAU = 6.28318530718;

// What the sequence goes on by along each axis, in 2^-32: 1/g and 1/g^2 of the plastic number g.
const STEP_X = 3242174889u;
const STEP_Y = 2447445414u;

fn trace_pixel(group: vec3<u32>, local: u32, caps: bool) {
    let index = (group.y * GROUPS_PER_ROW + group.x) * LANES + local;
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
        sum += 1.0 - way_to_hit(origin, direction, caps) / params.delta;
    }
    if params.first_ray + params.rays == params.all_rays {
        sum = 1.0 - sum / f32(params.all_rays);
    }
    accessibility.pixel[index] = sum;
}
