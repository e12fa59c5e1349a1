// Depth peeling (Everitt 2001, as CAO section 3.4 step 2 uses it), of all faces at once: each pass draws the nearest faces behind
// those of the pass before. Faces at one depth come in the order of the mesh, so that of parts that touch none is lost.

struct PeelParams {
    // corner of the map in the rigid frame, mm; 2 / edge of the map
    corner: vec3<f32>,
    per_half: f32,
    // scale of the mesh; 1 / depth range in mm
    scale: vec3<f32>,
    per_depth: f32,
    // number of the pass; the first has none before it
    surface: u32,
}

struct Vertices {
    // xyz of the vertex, once for each corner of each triangle
    corner: array<vec4<f32>>,
}

struct Vertex {
    @builtin(position) position: vec4<f32>,
    // least and most depth of the triangle
    @location(0) @interpolate(flat) range: vec2<f32>,
    @location(1) @interpolate(flat) triangle: u32,
}

struct Fragment {
    @builtin(frag_depth) depth: f32,
    // twice the number of the triangle, and 1 if it faces the clip camera
    @location(0) face: u32,
}

#include "shared/peeled.wgsl"

var<immediate> params: PeelParams;
@group(0) @binding(0) var<storage, read> vertices: Vertices;
@group(0) @binding(1) var before: texture_depth_2d;
@group(0) @binding(2) var face_before: texture_2d<u32>;
@group(0) @binding(3) var<storage, read> peeled: Peeled;

fn on_map(index: u32) -> vec3<f32> {
    let rigid = vertices.corner[index].xyz * params.scale;
    return (rigid - params.corner) * vec3(params.per_half, params.per_half, params.per_depth);
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Vertex {
    // Behind a pass that drew nothing there is nothing: nowhere to be drawn.
    if peeled.surfaces < params.surface {
        return Vertex(vec4(2.0, 2.0, 2.0, 1.0), vec2(0.0), 0u);
    }
    let map = on_map(index);
    let triangle = index / 3u;
    let depths = vec3(on_map(3u * triangle).z, on_map(3u * triangle + 1u).z, on_map(3u * triangle + 2u).z);
    let range = vec2(min(depths.x, min(depths.y, depths.z)), max(depths.x, max(depths.y, depths.z)));
    return Vertex(vec4(map.xy - 1.0, map.z, 1.0), range, triangle);
}

// The depth is written by the shader so that what the next pass compares with is what this one stored, to the bit. Of a triangle
// seen almost edge-on the rasterizer may extrapolate it; it never leaves the triangle's own range.
@fragment
fn fragment(in: Vertex, @builtin(front_facing) front: bool) -> Fragment {
    let depth = clamp(in.position.z, in.range.x, in.range.y);
    let face = 2u * in.triangle + u32(front);
    if params.surface != 0u {
        let pixel = vec2<i32>(in.position.xy);
        let last = textureLoad(before, pixel, 0);
        if depth < last || (depth == last && face <= textureLoad(face_before, pixel, 0).r) {
            discard;
        }
    }
    return Fragment(depth, face);
}
