// A view. World is millimetres, with the volume's centre at the origin where there is a volume.

// Views drawn at once.
const MOST_VIEWS = 4u;

struct Eye {
    // position in mm
    origin: vec4<f32>,
    // direction through image coordinates (0,0), and its change along u and v in [0,1]; the component along the view axis
    // is 1, so that a ray's parameter is the view depth in mm
    base: vec4<f32>,
    along_u: vec4<f32>,
    along_v: vec4<f32>,
    // depth of view depth t: x + y / t, reversed where y > 0; near and far plane in mm
    depth: vec4<f32>,
    // world -> clip space
    view_projection: mat4x4<f32>,
}
