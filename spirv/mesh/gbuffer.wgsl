// What each pixel of every view shows of a world: the first hit of the ray through its middle. Normals are those of the triangles, towards
// the eye: ambient occlusion is of the surface as it is, not as it is lit. `capped` is for worlds of which clips cut meshes that ask for caps:
// there a pixel shows the surface of the cut, with the normal of the clip.

#include "shared/geometry.wgsl"
#include "shared/ray.wgsl"
#include "shared/caps.wgsl"
#include "shared/clip_normal.wgsl"
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

// Of a cut, towards the eye. A mesh's is asked for a little behind its face, where the ray has crossed it for sure.
fn cap_normal(cap: Cap, origin: vec3<f32>, direction: vec3<f32>) -> vec3<f32> {
    let behind = cap.t + doubt(line_of(origin, direction, cap.t), cap.t);
    let towards_eye = -normalize(direction);
    let normal = clip_normal(cap.clip, origin + behind * direction, towards_eye);
    return select(normal, towards_eye, dot(normal, normal) < 0.5);
}

fn write_pixel(id: vec3<u32>, caps: bool) {
    if any(id.xy >= params.size) {
        return;
    }
    let eye = eyes.eye[id.z];
    let direction = direction_through(eye, params.size, vec2<f32>(id.xy) + 0.5);
    let hit = first_hit(eye.origin.xyz, direction, eye.depth.z, eye.depth.w);
    let index = pixel_index(params.size, id.z, id.xy);
    if caps {
        let cap = first_cap(eye.origin.xyz, direction, eye.depth.z, hit);
        if cap.triangle != NO_TRIANGLE {
            geometry.pixel[index] = vec4(cap_normal(cap, eye.origin.xyz, direction), cap.t);
            hits.pixel[index] = vec2(cap.triangle, ON_CAP);
            return;
        }
    }
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

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    write_pixel(id, false);
}

@compute @workgroup_size(8, 8)
fn capped(@builtin(global_invocation_id) id: vec3<u32>) {
    write_pixel(id, true);
}
