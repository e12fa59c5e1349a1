// Volumetric ambient occlusion (after Szirmay-Kalos and others 2009, AOV figure 9): how much of a ball that touches the surface from outside lies in
// front of what the image shows, by lines along the view axis. `cao_twin::image_space::volumetric` has the equations.
//
// In: normals and depths, the eyes. Out: `accessibility`, one write a pixel. Cost: a depth a line.

struct VolumetricParams {
    size: vec2<u32>,
    // R, the ball's diameter, in mm
    radius: f32,
    // lines
    samples: u32,
}

#include "shared/seen.wgsl"

var<immediate> params: VolumetricParams;
@group(0) @binding(0) var<storage, read> geometry: Geometry;
@group(0) @binding(1) var<uniform> eyes: Eyes;
@group(0) @binding(2) var<storage, read_write> accessibility: Accessibility;

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
    let radius = 0.5 * params.radius;
    let middle = position_of(eye, params.size, id.xy, here.w) + radius * here.xyz;
    let right = normalize(eye.along_u.xyz);
    let down = normalize(eye.along_v.xyz);
    let turn = scrambled(id.y * params.size.x + id.x);
    var free = 0.0;
    var whole = 0.0;
    for (var i = 0u; i < params.samples; i++) {
        // A spiral that covers the disc evenly, in radii.
        let area = (f32(i) + 0.5) / f32(params.samples);
        let angle = angle_of(i * GOLDEN + turn);
        let off = radius * sqrt(area) * vec2(cos(angle), sin(angle));
        let half = radius * sqrt(1.0 - area);
        let at = place_of(eye, params.size, middle + off.x * right + off.y * down);
        let shown = depth_at(params.size, id.z, at.xy);
        let seen = at.z > 0.0 && shown > 0.0;
        // From where the line enters the ball to the surface, or to where it leaves.
        free += select(2.0 * half, clamp(shown - at.z + half, 0.0, 2.0 * half), seen);
        whole += 2.0 * half;
    }
    accessibility.pixel[index] = free / whole;
}
