// The same as trace.wgsl by the device's ray queries, for which the triangles lie in an acceleration structure too. The device finds what a
// ray may hit; masks and clips are asked as there. What differs is rounding: a device decides by its own arithmetic whether a ray along an
// edge passes.

enable wgpu_ray_query;

#include "shared/there.wgsl"
#include "shared/cosine_rays.wgsl"

@group(0) @binding(0) var<uniform> eyes: Eyes;
@group(0) @binding(1) var world: acceleration_structure;
// in the structure's order
@group(0) @binding(2) var<storage, read> triangles: Triangles;
@group(0) @binding(3) var<storage, read> looks: Looks;
@group(0) @binding(4) var<storage, read> materials: Materials;
@group(0) @binding(5) var<storage, read> texels: Texels;
@group(0) @binding(6) var<storage, read> geometry: Geometry;
// until the last piece has come the sum over the rays so far
@group(0) @binding(7) var<storage, read_write> accessibility: Accessibility;
@group(0) @binding(8) var<storage, read> clips: Clips;
@group(0) @binding(9) var<storage, read> layers: Layers;

// Where there are caps, rays walk.
fn way_to_hit(origin: vec3<f32>, direction: vec3<f32>, caps: bool) -> f32 {
    let flags = select(RAY_FLAG_NONE, RAY_FLAG_FORCE_OPAQUE, params.whole != 0u);
    var query: ray_query;
    rayQueryInitialize(&query, world, RayDesc(flags, 0xffu, 0.0, params.delta, origin, direction));
    while rayQueryProceed(&query) {
        let hit = rayQueryGetCandidateIntersection(&query);
        let triangle = triangles.triangle[hit.primitive_index];
        if is_there(hit.primitive_index, triangle, hit.barycentrics) && is_left(triangle, origin + hit.t * direction) {
            rayQueryConfirmIntersection(&query);
        }
    }
    let hit = rayQueryGetCommittedIntersection(&query);
    return select(params.delta, hit.t, hit.kind == RAY_QUERY_INTERSECTION_TRIANGLE);
}

@compute @workgroup_size(LANES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    trace_pixel(group, local, false);
}
