// A host's depth as what a ray cast ends at: the distance in mm along the view axis, a view at a time.

struct SceneDepthParams {
    // the host's rectangle in its image
    first: vec2<u32>,
    size: vec2<u32>,
    // pixels to be drawn, the view's layer of the picture
    drawn: vec2<u32>,
    view: u32,
    // depth at distance t: a + b / t
    a: f32,
    b: f32,
}

var<immediate> params: SceneDepthParams;

@group(0) @binding(0) var scene: texture_2d<f32>;
@group(0) @binding(1) var ends: texture_storage_2d_array<r32float, write>;

// Farther than anything.
const NOWHERE = 3e38;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.drawn) {
        return;
    }
    // The pixel that holds the ray's place.
    let place = (vec2<f32>(id.xy) + 0.5) * vec2<f32>(params.size) / vec2<f32>(params.drawn);
    let at = params.first + min(vec2<u32>(place), params.size - 1u);
    let difference = textureLoad(scene, at, 0).r - params.a;
    // At the depth of an infinite far plane, and by rounding beyond it, there is nothing.
    let t = select(params.b / difference, NOWHERE, difference * params.b <= 0.0);
    textureStore(ends, id.xy, params.view, vec4(t, 0.0, 0.0, 0.0));
}
