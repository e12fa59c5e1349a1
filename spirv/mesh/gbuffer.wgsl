// What each pixel of every view shows of a world: the first hit of the ray through its middle. Normals are those of the triangles, towards
// the eye: ambient occlusion is of the surface as it is, not as it is lit.

#include "shared/geometry.wgsl"
#include "shared/ray.wgsl"
#include "shared/hits.wgsl"

struct GbufferParams {
    // pixels of a view
    size: vec2<u32>,
}

var<immediate> params: GbufferParams;
@group(0) @binding(0) var<uniform> eyes: Eyes;
@group(0) @binding(1) var<storage, read> tree: Tree;
@group(0) @binding(2) var<storage, read> triangles: Triangles;
@group(0) @binding(3) var<storage, read> looks: Looks;
@group(0) @binding(4) var<storage, read> materials: Materials;
@group(0) @binding(5) var<storage, read> texels: Texels;
@group(0) @binding(6) var<storage, read_write> geometry: Geometry;
@group(0) @binding(7) var<storage, read_write> hits: Hits;
@group(0) @binding(8) var<storage, read> clips: Clips;
@group(0) @binding(9) var<storage, read> layers: Layers;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let eye = eyes.eye[id.z];
    let direction = direction_through(eye, params.size, vec2<f32>(id.xy) + 0.5);
    let hit = first_hit(eye.origin.xyz, direction, eye.depth.z, eye.depth.w);
    let index = pixel_index(params.size, id.z, id.xy);
    if hit.triangle == NO_TRIANGLE {
        geometry.pixel[index] = vec4(0.0);
        hits.pixel[index] = vec2(NO_TRIANGLE, 0u);
        return;
    }
    let triangle = triangles.triangle[hit.triangle];
    let across = normalize(cross(triangle.b.xyz - triangle.a.xyz, triangle.c.xyz - triangle.a.xyz));
    let normal = select(across, -across, dot(across, direction) > 0.0);
    geometry.pixel[index] = vec4(normal, hit.t);
    hits.pixel[index] = vec2(hit.triangle, pack2x16unorm(hit.at));
}
