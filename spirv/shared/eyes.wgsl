// Eyes and the frame's settings. World is millimetres with the volume's centre at the origin.

struct Eye {
    // position in mm
    origin: vec4<f32>,
    // direction through image coordinates (0,0), and its change along u and v in [0,1]; the component along the view axis
    // is 1, so that a ray's parameter is the view depth in mm
    base: vec4<f32>,
    along_u: vec4<f32>,
    along_v: vec4<f32>,
    // Vulkan depth of view depth t: x + y / t; near and far plane in mm
    depth: vec4<f32>,
    // world -> clip space
    view_projection: mat4x4<f32>,
}

struct Frame {
    eye: array<Eye, 2>,
    // voxels along each axis
    dims: vec4<f32>,
    // mm; w: step along the ray in mm
    spacing: vec4<f32>,
    // unit vector towards the light; w: reference length of the opacity in mm
    light: vec4<f32>,
    // ambient and diffuse part, opacity at which a ray ends, value of a texel of 0
    ambient: f32,
    diffuse: f32,
    opaque: f32,
    bias: f32,
    // value = texel * scale + bias
    scale: f32,
    // 1: ambient occlusion is shown, 0: solid colour
    occluded: f32,
    // 1: samples start at a different fraction of a step in every pixel
    jitter: f32,
    // the ambient factor is shown times this
    gain: f32,
}

fn index_of(world: vec3<f32>) -> vec3<f32> {
    return world / frame.spacing.xyz + 0.5 * (frame.dims.xyz - 1.0);
}

// Ambient factor at an index position, snapped to 1/256 voxel: the resolution of texture filters on GPUs, and far above
// the rounding of the two eyes' rays, so that both read the very same bits at the same point.
fn ambient_at(position: vec3<f32>) -> f32 {
    let snapped = round(position * 256.0) / 256.0;
    return textureSampleLevel(ambient, edge, (snapped + 0.5) / frame.dims.xyz, 0.0).r;
}
