// The truth (AOV section 6): how many rays of a pixel are hit, and how near, by walks through the tree of triangles.
// `capped` is for worlds of which clips cut meshes that ask for caps, which occlude as well.

#include "shared/ray.wgsl"
#include "shared/caps.wgsl"
#include "shared/cosine_rays.wgsl"

@group(0) @binding(0) var<uniform> eyes: Eyes;
@group(0) @binding(1) var<storage, read> tree: Tree;
@group(0) @binding(2) var<storage, read> triangles: Triangles;
@group(0) @binding(3) var<storage, read> looks: Looks;
@group(0) @binding(4) var<storage, read> materials: Materials;
@group(0) @binding(5) var<storage, read> texels: Texels;
@group(0) @binding(6) var<storage, read> geometry: Geometry;
// until the last piece has come the sum over the rays so far
@group(0) @binding(7) var<storage, read_write> accessibility: Accessibility;
@group(0) @binding(8) var<storage, read> clips: Clips;
@group(0) @binding(9) var<storage, read> layers: Layers;

fn way_to_hit(origin: vec3<f32>, direction: vec3<f32>, caps: bool) -> f32 {
    let hit = first_hit(origin, direction, 0.0, params.delta);
    if caps {
        return first_cap(origin, direction, 0.0, hit).t;
    }
    return hit.t;
}

@compute @workgroup_size(LANES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    trace_pixel(group, local, false);
}

@compute @workgroup_size(LANES)
fn capped(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    trace_pixel(group, local, true);
}
