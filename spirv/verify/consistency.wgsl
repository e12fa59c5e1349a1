// What each eye sees at given points of the volume: for every point and eye, the transmittance in front of it and the
// ambient factor that the ray cast reads there. The point goes the eye's own way: projected into its image, back along the
// pixel's ray, to the sample at the point's depth. Stereo consistency (CAO section 5) is that both read the same bits.

@group(0) @binding(0) var opacity: texture_3d<f32>;
@group(0) @binding(1) var ambient: texture_3d<f32>;
@group(0) @binding(2) var field: sampler;
@group(0) @binding(3) var edge: sampler;
@group(0) @binding(4) var<uniform> frame: Frame;
@group(0) @binding(5) var<storage, read> points: Points;
@group(0) @binding(6) var<storage, read_write> seen: AllSeen;

#include "shared/eyes.wgsl"
#include "shared/air.wgsl"
#include "shared/coloured_air.wgsl"

struct ConsistencyParams {
    count: u32,
    // what V_AO has: ONE value, or several, of which the least is read: four of FEATURES, or COLOURS
    channels: u32,
}

struct Points {
    // world position in mm
    world: array<vec4<f32>>,
}

// What one eye reads at one point.
struct Seen {
    // transmittance between the eye and the point's voxel, 0 ... 1; OUTSIDE where the point is outside the eye's image
    transmittance: f32,
    // ambient factor at the point
    ambient: f32,
}

struct AllSeen {
    // two entries a point, left and right
    by_eye: array<Seen>,
}

const OUTSIDE = -1.0;

const ONE = 0u;
const FEATURES = 1u;
const COLOURS = 2u;

var<immediate> params: ConsistencyParams;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.count {
        return;
    }
    channel = select(0u, LEAST, params.channels == FEATURES);
    let world = points.world[id.x];
    for (var view = 0u; view < 2u; view++) {
        let eye = frame.eye[view];
        let clip = eye.view_projection * vec4(world.xyz, 1.0);
        let uv = clip.xy / clip.w * 0.5 + 0.5;
        let out = 2u * id.x + view;
        if clip.w < eye.depth.z || any(uv < vec2(0.0)) || any(uv > vec2(1.0)) {
            seen.by_eye[out] = Seen(OUTSIDE, 0.0);
            continue;
        }
        let ray = ray_through(eye, uv);
        let exponent = frame.spacing.w / frame.light.w;
        // Up to the voxel that the point belongs to.
        let voxel = max(frame.spacing.x, max(frame.spacing.y, frame.spacing.z));
        let end = min(ray.end, clip.w - 1.5 * voxel / length(ray.direction));
        var transmittance = 1.0;
        for (var i = 0u; transmittance > 0.01; i++) {
            let t = ray.begin + f32(i) * ray.step;
            if !(t < end) {
                break;
            }
            let a = textureSampleLevel(opacity, field, (ray.start + t * ray.along + 0.5) / frame.dims.xyz, 0.0).r;
            transmittance *= select(pow(1.0 - a, exponent), 0.0, a >= 1.0);
        }
        let place = ray.start + clip.w * ray.along;
        var read = 0.0;
        if params.channels == COLOURS {
            let colours = coloured_ambient_at(place);
            read = min(colours.r, min(colours.g, colours.b));
        } else {
            read = ambient_at(place);
        }
        seen.by_eye[out] = Seen(transmittance, read);
    }
}
