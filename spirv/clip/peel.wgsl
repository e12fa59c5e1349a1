// Depth peeling (Everitt 2001, as CAO section 3.4 step 2 uses it): one pass draws the nearest faces of one facing that lie
// behind those of the pass before. The k-th front and the k-th back layer make a pair.

struct PeelParams {
    // corner of the map in the rigid frame, mm; 2 / edge of the map
    corner: vec3<f32>,
    per_half: f32,
    // scale of the mesh; 1 / depth range in mm
    scale: vec3<f32>,
    per_depth: f32,
    // 1 in the first pass, which has none before it
    first: u32,
}

struct Vertices {
    // xyz of the vertex, once for each corner of each triangle
    corner: array<vec4<f32>>,
}

struct Fragment {
    @builtin(frag_depth) depth: f32,
}

var<immediate> params: PeelParams;
@group(0) @binding(0) var<storage, read> vertices: Vertices;
@group(0) @binding(1) var before: texture_depth_2d;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let rigid = vertices.corner[index].xyz * params.scale;
    let map = (rigid - params.corner) * vec3(params.per_half, params.per_half, params.per_depth);
    return vec4(map.xy - 1.0, map.z, 1.0);
}

// The depth is written by the shader so that what the next pass compares with is what this one stored, to the bit.
@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    if params.first == 0u && position.z <= textureLoad(before, vec2<i32>(position.xy), 0) {
        discard;
    }
    return Fragment(position.z);
}
