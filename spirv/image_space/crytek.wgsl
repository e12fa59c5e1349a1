// Ambient occlusion from depth alone (after Mittring 2007, AOV figure 9): 16 points in the ball of radius R around what a pixel shows, mirrored at
// a plane that changes over 4 × 4 pixels; a point is hidden where the image shows something nearer. `cao_twin::image_space::crytek` has the
// equations.
//
// In: normals and depths (normals are not read), the eyes. Out: `accessibility` before its blur, one write a pixel. Cost: 16 depths a pixel.

struct CrytekParams {
    size: vec2<u32>,
    // R in mm
    radius: f32,
}

#include "shared/seen.wgsl"

var<immediate> params: CrytekParams;
@group(0) @binding(0) var<storage, read> geometry: Geometry;
@group(0) @binding(1) var<uniform> eyes: Eyes;
@group(0) @binding(2) var<storage, read_write> accessibility: Accessibility;

// Half of the points: the others are opposite.
const PAIRS = 8u;

// A direction: its height above the equator, and its turn in 2^32ths.
fn direction(height: f32, turn: u32) -> vec3<f32> {
    let ring = sqrt(1.0 - height * height);
    let angle = angle_of(turn);
    return vec3(ring * cos(angle), ring * sin(angle), height);
}

// A point of the upper half of the unit ball. Reversed bits of its number are its place between middle and rim, in equal volumes.
fn point(i: u32) -> vec3<f32> {
    let height = (f32(i) + 0.5) / f32(PAIRS);
    let share = (f32(reverseBits(i) >> 29u) + 0.5) / f32(PAIRS);
    return direction(height, i * GOLDEN) * pow(share, 1.0 / 3.0);
}

// The normal of the mirror of a pixel: one of 16, neighbours far from each other.
fn mirror(pixel: vec2<u32>) -> vec3<f32> {
    let i = (7u * (pixel.x % 4u + 4u * (pixel.y % 4u))) % 16u;
    return direction((f32(i) + 0.5) / 8.0 - 1.0, i * GOLDEN);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let index = pixel_index(params.size, id.z, id.xy);
    let depth = geometry.pixel[index].w;
    if depth <= 0.0 {
        accessibility.pixel[index] = 1.0;
        return;
    }
    let eye = eyes.eye[id.z];
    let middle = position_of(eye, params.size, id.xy, depth);
    let normal = mirror(id.xy);
    var hidden = 0u;
    for (var i = 0u; i < 2u * PAIRS; i++) {
        let side = select(-params.radius, params.radius, i % 2u == 0u);
        let at = place_of(eye, params.size, middle + side * reflect(point(i / 2u), normal));
        let shown = depth_at(params.size, id.z, at.xy);
        // What is in front of it by more than R is another thing. Behind the eye nothing is known.
        let hides = at.z > 0.0 && shown > 0.0 && shown < at.z && at.z - shown <= params.radius;
        hidden += u32(hides);
    }
    accessibility.pixel[index] = 1.0 - f32(hidden) / f32(2u * PAIRS);
}
