// The light that a visible place of a ray sends towards the eye: ambient, Lambert's diffuse and Blinn's specular part.
//
//   L = A k_a c + A' (k_d c d + k_s s)     A = min(gain a, 1) where it is shown, else 1;  A' the same where it multiplies all light
//
// Where a surface is, d = max(n.l, 0) and s = d max(n.h, 0)^shininess; where none is, d = 1/2 and s = 0. What a surface is: `steepness`.
// Just behind a cut or a face of the volume, n is the normal of what cut. a: `air.wgsl`; of coloured light it has red, green and blue.
// Cost: 26 reads where n is the gradient's, 14 for a.

#include "shared/gradient.wgsl"
#include "shared/clip_normal.wgsl"
#include "shared/coloured_air.wgsl"

// A visible place of a ray.
struct Shown {
    // index coordinates
    position: vec3<f32>,
    // mm
    world: vec3<f32>,
    value: f32,
    // unlit, linear
    colour: vec3<f32>,
    // the clip out of which the ray came last, NO_CLIP where there was none
    cut: u32,
    // mm of way since then
    beside: f32,
}

// Voxels of way behind a cut to which its normal holds, and from which the gradient's does. A step may end a quarter behind it.
const CUT_HOLDS = 0.25;
const CUT_ENDS = 0.75;

// Relative change of opacity over a voxel below which there is no surface, and above which there is: what noise of a level or two
// of 255 makes of half opacity, and what an edge of some ten voxels has.
const NO_SURFACE = 0.02;
const SURFACE = 0.2;

// Rise of the values from a voxel before to a voxel behind, of all their change on the way, from which on a gradient has a direction.
const STRAIGHT = 0.2;

// Mean of |n.l| over all directions: Lambert's term of what has none.
const NO_DIRECTION = 0.5;

// The diffuse and the specular part of the light that comes back from a surface, by the share of it that is turned to the front and to
// the back of its normal.
fn reflected(normal: vec3<f32>, front: f32, back: f32, towards_eye: vec3<f32>) -> vec2<f32> {
    let light = frame.light.xyz;
    let slope = dot(normal, light);
    let arriving = max(front * slope, -back * slope);
    let half_way = light + towards_eye;
    // An eye that looks into the light has no half way.
    let mirrored = min(abs(dot(normal, half_way)) / max(length(half_way), 1e-6), 1.0);
    // Light from behind the surface that the eye sees does not mirror.
    let same_side = slope * dot(normal, half_way) > 0.0;
    return vec2(arriving, select(0.0, arriving * pow(mirrored, frame.shininess), same_side));
}

// Inside the volume, by the gradient of the values. Opacity a voxel before and behind the place along the gradient says how much of a
// surface there is, relative to the largest of the three, and which side is out: a ridge has two.
fn reflected_inside(at: Shown, towards_eye: vec3<f32>) -> vec2<f32> {
    let gradient = rise_at(at.position) / frame.spacing.xyz;
    let rise = length(gradient);
    let none = vec2(NO_DIRECTION, 0.0);
    if !(rise > 0.0) {
        return none;
    }
    let normal = gradient / rise;
    let voxel = normal * smallest_spacing() / frame.spacing.xyz;
    let here = opacity_of(at.value);
    let low = value_at(at.position - voxel);
    let high = value_at(at.position + voxel);
    let before = opacity_of(low);
    let behind = opacity_of(high);
    let change = abs(before - here) + abs(behind - here);
    if !(change > 0.0) {
        return none;
    }
    let largest = max(here, max(before, behind));
    // On the crest of a ridge the gradient is what rounding makes of nothing.
    let way = abs(low - at.value) + abs(high - at.value);
    let straight = smoothstep(0.0, STRAIGHT, abs(high - low) / max(way, 1e-30));
    let share = smoothstep(NO_SURFACE, SURFACE, change / largest) * straight;
    // -1 ... 1: out is against the gradient, both ways, along it.
    let out = (before - behind) / change;
    let lit_back = max(1.0 - max(out, 0.0), frame.two_sided);
    let lit_front = max(1.0 + min(out, 0.0), frame.two_sided);
    return mix(none, reflected(normal, lit_front, lit_back, towards_eye), share);
}

fn smallest_spacing() -> f32 {
    return min(frame.spacing.x, min(frame.spacing.y, frame.spacing.z));
}

// At any place.
fn reflected_at(at: Shown, direction: vec3<f32>) -> vec2<f32> {
    let towards_eye = -normalize(direction);
    let along = direction / frame.spacing.xyz;
    // The face of the volume through which the ray came in, and the way since then.
    let face = select(frame.dims.xyz - 0.5, vec3(-0.5), along > vec3(0.0));
    let since = select((at.position - face) / along, vec3(1e30), along == vec3(0.0));
    let first = min(since.x, min(since.y, since.z));
    let entered = first * length(direction);
    let by_clip = at.cut != NO_CLIP && at.beside <= entered;
    let way = select(entered, at.beside, by_clip) / smallest_spacing();
    let cut = 1.0 - smoothstep(CUT_HOLDS, CUT_ENDS, way);
    // Once: it is much code, and drivers write out every call.
    var inside = vec2(0.0);
    if cut < 1.0 {
        inside = reflected_inside(at, towards_eye);
    }
    if cut == 0.0 {
        return inside;
    }
    var normal = vec3(0.0);
    if by_clip {
        normal = clip_normal(at.cut, at.world + at.beside * towards_eye, towards_eye);
    } else {
        // Of two faces that meet, both: their edge has no direction of its own.
        normal = normalize(-sign(direction) * vec3<f32>(since <= vec3(first)));
    }
    let back = reflected(normal, 1.0, frame.two_sided, towards_eye);
    if cut == 1.0 {
        return back;
    }
    return mix(inside, back, cut);
}

// Linear red, green and blue that it sends back along the ray, whose direction in the world may have any length. `coloured`: V_AO is of
// coloured light.
fn shaded(at: Shown, direction: vec3<f32>, coloured: bool) -> vec3<f32> {
    var back = vec2(0.0);
    if frame.diffuse + frame.specular > 0.0 {
        back = reflected_at(at, direction);
    }
    if coloured && frame.occluded > 0.0 {
        let open = min(frame.gain * coloured_ambient_at(at.position), vec3(1.0));
        let open_rest = mix(vec3(1.0), open, frame.occluded_rest);
        let matt = open * frame.ambient + open_rest * frame.diffuse * back.x;
        return matt * at.colour + open_rest * frame.specular * back.y;
    }
    var open = 1.0;
    if frame.occluded > 0.0 {
        open = min(frame.gain * ambient_at(at.position), 1.0);
    }
    let open_rest = mix(1.0, open, frame.occluded_rest);
    let matt = open * frame.ambient + open_rest * frame.diffuse * back.x;
    return matt * at.colour + open_rest * frame.specular * back.y;
}
