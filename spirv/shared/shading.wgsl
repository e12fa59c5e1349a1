// The light that a visible place of a ray sends towards the eye.

// Below this gradient of opacity per smallest spacing there is no surface.
const FLAT = 1e-4;

fn opacity_at(position: vec3<f32>) -> f32 {
    return textureSampleLevel(opacity, field, (position + 0.5) / frame.dims.xyz, 0.0).r;
}

// Lambert's term of a surface seen from either side, from the gradient of the clipped opacity, so that cut faces are shaded
// as surfaces. Where there is no gradient there is no surface, and the term is 1.
fn surface_light(position: vec3<f32>) -> f32 {
    let voxel = frame.spacing.xyz / min(frame.spacing.x, min(frame.spacing.y, frame.spacing.z));
    let gradient = vec3(
        opacity_at(position + vec3(1.0, 0.0, 0.0)) - opacity_at(position - vec3(1.0, 0.0, 0.0)),
        opacity_at(position + vec3(0.0, 1.0, 0.0)) - opacity_at(position - vec3(0.0, 1.0, 0.0)),
        opacity_at(position + vec3(0.0, 0.0, 1.0)) - opacity_at(position - vec3(0.0, 0.0, 1.0)),
    ) / (2.0 * voxel);
    let steepness = length(gradient);
    if steepness < FLAT {
        return 1.0;
    }
    return abs(dot(gradient, frame.light.xyz)) / steepness;
}

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

// Linear red, green and blue that it sends back along the ray, whose direction in the world may have any length.
fn shaded(at: Shown, direction: vec3<f32>) -> vec3<f32> {
    let light = frame.ambient + frame.diffuse * surface_light(at.position);
    return light * mix(1.0, frame.gain * ambient_at(at.position), frame.occluded) * at.colour;
}
