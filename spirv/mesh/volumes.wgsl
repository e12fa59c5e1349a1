// Ambient occlusion volumes as the paper draws them (AOV section 5), without a geometry shader: vertices are pulled, 24 for the prism of a
// triangle, 36 for the box of a sliver; back faces, behind which the pixel's surface does not lie, each adding what its triangle
// contributes. An eye inside a volume is no case of its own: it sees the back.
//
// Depth is near / distance, without a far plane, so that no back is cut off; nothing is at 0. Of a static world the corners are made once,
// by `corners`; of a moving one by each vertex.

#include "shared/geometry.wgsl"
#include "shared/occluder.wgsl"
#include "shared/bricks.wgsl"
#include "shared/accessibility.wgsl"

struct VolumesParams {
    size: vec2<u32>,
    view: u32,
    // of a volume's base: 3 of a prism, 4 of a box
    corners: u32,
    // the first of the items that are drawn, or made; how many are made
    first: u32,
    count: u32,
    delta: f32,
}

struct Items {
    // triangles, those with prisms before those with boxes
    triangle: array<u32>,
}

struct Corners {
    // eight for each item: the base's, then those over them
    corner: array<vec4<f32>>,
}

struct Vertex {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) triangle: u32,
}

var<immediate> params: VolumesParams;
@group(0) @binding(0) var<uniform> eyes: Eyes;
@group(0) @binding(1) var<storage, read> items: Items;
@group(0) @binding(2) var<storage, read> triangles: Triangles;
@group(0) @binding(3) var<storage, read> geometry: Geometry;
@group(0) @binding(4) var<storage, read> made: Corners;
@group(0) @binding(5) var<storage, read_write> corners_to_make: Corners;
@group(0) @binding(6) var sums: texture_2d<f32>;
@group(0) @binding(7) var<storage, read_write> accessibility: Accessibility;
@group(0) @binding(8) var<storage, read> shares: Shares;

// Where a vertex of a volume is: a corner of its base, and 1 over it.
fn place_in(vertex: u32, corners: u32) -> vec2<u32> {
    let caps = 3u * (corners - 2u);
    if vertex < 2u * caps {
        // Fans: the base seen from below, the top from above.
        let above = vertex / caps;
        let part = (vertex % caps) / 3u;
        let corner = vertex % 3u;
        let second = select(part + 2u - (corner - 1u), part + corner, above == 1u);
        return vec2(select(second, 0u, corner == 0u), above);
    }
    let side = (vertex - 2u * caps) / 6u;
    let corner = (vertex - 2u * caps) % 6u;
    let next = corner == 1u || corner == 2u || corner == 4u;
    let over = corner == 2u || corner == 4u || corner == 5u;
    return vec2(select(side, (side + 1u) % corners, next), u32(over));
}

// A corner of a triangle's volume: of its prism the triangle's corner, moved out until it is delta from both edges (eq. 23 to 29), or as far
// as it is clamped; of a sliver one of the box about its longest edge, delta around it.
fn corner_of(triangle: WorldTriangle, place: vec2<u32>, delta: f32, clamped: bool) -> vec3<f32> {
    let a = triangle.a.xyz;
    let b = triangle.b.xyz;
    let c = triangle.c.xyz;
    let face = normalize(cross(b - a, c - a));
    let kind = u32(triangle.c.w);
    let under = select(0.0, -delta, (kind & TWO_SIDED) != 0u);
    let height = select(under, delta, place.y == 1u);
    if !clamped && (kind & SLIVER) != 0u {
        let along = longest_edge(a, b, c);
        let across = cross(face, along);
        let u = vec2(dot(b - a, along), dot(c - a, along));
        let v = vec2(dot(b - a, across), dot(c - a, across));
        let right = place.x == 1u || place.x == 2u;
        let far = place.x >= 2u;
        let x = select(min(0.0, min(u.x, u.y)) - delta, max(0.0, max(u.x, u.y)) + delta, right);
        let y = select(min(0.0, min(v.x, v.y)) - delta, max(0.0, max(v.x, v.y)) + delta, far);
        return a + along * x + across * y + face * height;
    }
    var corner = a;
    var next = b;
    var before = c;
    if place.x == 1u {
        corner = b;
        next = c;
        before = a;
    } else if place.x == 2u {
        corner = c;
        next = a;
        before = b;
    }
    let along_next = normalize(next - corner);
    let along_before = normalize(corner - before);
    if clamped {
        return corner + clamped_extension(along_next, along_before, face, delta) + face * height;
    }
    let inward = cross(face, along_next);
    let inward_before = cross(face, along_before);
    let out = (inward + inward_before) * (delta / (1.0 + dot(inward, inward_before)));
    return corner - out + face * height;
}

fn drawn(corner: vec3<f32>, triangle: u32) -> Vertex {
    let eye = eyes.eye[params.view];
    let clip = eye.view_projection * vec4(corner, 1.0);
    return Vertex(vec4(clip.xy, eye.depth.z, clip.w), triangle);
}

fn vertices() -> u32 {
    return 12u * params.corners - 12u;
}

fn made_by_vertex(index: u32, clamped: bool) -> Vertex {
    let triangle = items.triangle[params.first + index / vertices()];
    let place = place_in(index % vertices(), params.corners);
    return drawn(corner_of(triangles.triangle[triangle], place, params.delta, clamped), triangle);
}

@vertex
fn dynamic_volume(@builtin(vertex_index) index: u32) -> Vertex {
    return made_by_vertex(index, false);
}

@vertex
fn dynamic_volume_clamped(@builtin(vertex_index) index: u32) -> Vertex {
    return made_by_vertex(index, true);
}

@vertex
fn static_volume(@builtin(vertex_index) index: u32) -> Vertex {
    let item = params.first + index / vertices();
    let place = place_in(index % vertices(), params.corners);
    return drawn(made.corner[8u * item + 4u * place.y + place.x].xyz, items.triangle[item]);
}

fn occlusion_in(in: Vertex, clamped: bool) -> f32 {
    let pixel = vec2<u32>(in.position.xy);
    let here = geometry.pixel[pixel_index(params.size, params.view, pixel)];
    let point = position_of(eyes.eye[params.view], params.size, pixel, here.w);
    let triangle = triangles.triangle[in.triangle];
    let share = shares.triangle[in.triangle];
    let nothing = uncertainty(point, here.w);
    return contribution(triangle, share, point, here.xyz, params.delta, nothing, clamped);
}

@fragment
fn occlude(in: Vertex) -> @location(0) f32 {
    return occlusion_in(in, false);
}

@fragment
fn occlude_clamped(in: Vertex) -> @location(0) f32 {
    return occlusion_in(in, true);
}

// The corners of the volumes of a static world.
fn make_corners(group: vec3<u32>, local: u32, clamped: bool) {
    let work = (group.y * GROUPS_PER_ROW + group.x) * 64u + local;
    if work >= 8u * params.count {
        return;
    }
    let triangle = triangles.triangle[items.triangle[work / 8u]];
    let place = vec2(work % 4u, work / 4u % 2u);
    corners_to_make.corner[work] = vec4(corner_of(triangle, place, params.delta, clamped), 1.0);
}

@compute @workgroup_size(64)
fn corners(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    make_corners(group, local, false);
}

@compute @workgroup_size(64)
fn corners_clamped(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    make_corners(group, local, true);
}

struct Filled {
    @builtin(frag_depth) depth: f32,
}

// One triangle over the whole picture.
@vertex
fn whole(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(4u * (index & 1u)) - 1.0, f32(2u * (index & 2u)) - 1.0, 0.0, 1.0);
}

// The depth that volumes are tested against.
@fragment
fn depth(@builtin(position) position: vec4<f32>) -> Filled {
    let distance = geometry.pixel[pixel_index(params.size, params.view, vec2<u32>(position.xy))].w;
    return Filled(select(0.0, eyes.eye[params.view].depth.z / distance, distance > 0.0));
}

// What is left of the light.
@compute @workgroup_size(8, 8)
fn settle(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id.xy < params.size) {
        let sum = textureLoad(sums, id.xy, 0).r;
        accessibility.pixel[pixel_index(params.size, params.view, id.xy)] = 1.0 - min(sum, 1.0);
    }
}
