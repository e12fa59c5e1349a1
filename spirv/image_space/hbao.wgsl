// Horizon-based ambient occlusion (after Bavoil and Sainz 2008, AOV figure 8): in each of N directions of the image the highest horizon that steps
// within R find, above the surface's tangent. `cao_twin::image_space::hbao` has the equations.
//
// In: normals and depths, the eyes. Out: `accessibility` before its filter, one write a pixel. Cost: N × 6 depths a pixel.

struct HbaoParams {
    size: vec2<u32>,
    // R in mm
    radius: f32,
    // N
    directions: u32,
    // sine and cosine of the angle above the tangent that no horizon counts below
    bias: vec2<f32>,
    // 1: what a horizon adds falls off with its distance; 0: it does not, at any distance
    falloff: f32,
}

#include "shared/seen.wgsl"

var<immediate> params: HbaoParams;
@group(0) @binding(0) var<storage, read> geometry: Geometry;
@group(0) @binding(1) var<uniform> eyes: Eyes;
@group(0) @binding(2) var<storage, read_write> accessibility: Accessibility;

const STEPS = 6u;

// Sine of the angle of the tangent above the image plane, raised by the bias, along a direction of which the normal has these components: along it,
// and towards the eye.
fn raised(along: f32, back: f32) -> f32 {
    let size = max(sqrt(along * along + back * back), 1e-20);
    // A surface that leans over ends at the view axis.
    let sine = select(sign(-along), -along / size, back > 0.0);
    let cosine = max(back, 0.0) / size;
    let beyond = cosine * params.bias.y - sine * params.bias.x;
    return select(1.0, sine * params.bias.y + cosine * params.bias.x, beyond > 0.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let index = pixel_index(params.size, id.z, id.xy);
    let here = geometry.pixel[index];
    if here.w <= 0.0 {
        accessibility.pixel[index] = 1.0;
        return;
    }
    let eye = eyes.eye[id.z];
    let position = position_of(eye, params.size, id.xy, here.w);
    let right = normalize(eye.along_u.xyz);
    let down = normalize(eye.along_v.xyz);
    // Towards the eye: down is down.
    let back = cross(down, right);
    let noise = scrambled(id.y * params.size.x + id.x);
    let jitter = f32(scrambled(noise) >> 8u) / 16777216.0;
    let apart = 0xffffffffu / params.directions;
    var sum = 0.0;
    for (var k = 0u; k < params.directions; k++) {
        // Turned by a share of what lies between two directions.
        let angle = angle_of(k * apart + noise / params.directions);
        let along = cos(angle) * right + sin(angle) * down;
        var horizon = raised(dot(here.xyz, along), dot(here.xyz, back));
        for (var i = 0u; i < STEPS; i++) {
            let way = params.radius * (f32(i) + jitter) / f32(STEPS);
            let at = place_of(eye, params.size, position + way * along);
            let shown = depth_at(params.size, id.z, at.xy);
            // Not the pixel itself: a device may give it two positions, a rounding apart.
            let pixel = vec2<u32>(at.xy);
            if shown <= 0.0 || all(pixel == id.xy) {
                continue;
            }
            let to = position_of(eye, params.size, pixel, shown) - position;
            let squared = dot(to, to);
            let share = 1.0 - params.falloff * squared / (params.radius * params.radius);
            // Nothing beyond R.
            if share <= 0.0 {
                continue;
            }
            let sine = dot(to, back) / sqrt(squared);
            if sine > horizon {
                sum += share * (sine - horizon);
                horizon = sine;
            }
        }
    }
    accessibility.pixel[index] = clamp(1.0 - sum / f32(params.directions), 0.0, 1.0);
}
