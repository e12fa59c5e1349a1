// Rays through the world, which pass what clips hide. Kernels bind `tree` over the triangles' boxes, `triangles`, and what `there.wgsl`
// asks for.

#include "shared/there.wgsl"

struct Hit {
    // way along the ray, in its direction's lengths
    t: f32,
    triangle: u32,
    // weights of the second and the third corner
    at: vec2<f32>,
}

// What a ray may miss a triangle by, in shares of it: no ray passes between two that share an edge.
const EDGE = 1e-6;

// How much farther than computed a box may end (Ize 2013).
const ROUNDING = 1.0000004;

// Where a ray hits a triangle (Möller and Trumbore 1997), from either side; t is below 0 where it does not.
fn hit_of(triangle: WorldTriangle, origin: vec3<f32>, direction: vec3<f32>) -> vec3<f32> {
    let ab = triangle.b.xyz - triangle.a.xyz;
    let ac = triangle.c.xyz - triangle.a.xyz;
    let across = cross(direction, ac);
    let volume = dot(ab, across);
    let away = origin - triangle.a.xyz;
    let turned = cross(away, ab);
    let u = dot(away, across) / volume;
    let v = dot(direction, turned) / volume;
    let t = dot(ac, turned) / volume;
    let inside = volume != 0.0 && u >= -EDGE && v >= -EDGE && u + v <= 1.0 + EDGE;
    return select(vec3(-1.0), vec3(t, u, v), inside);
}

// The first hit behind `begin` and before `end`; of none NO_TRIANGLE, at `end`.
fn first_hit(origin: vec3<f32>, direction: vec3<f32>, begin: f32, end: f32) -> Hit {
    // Of an axis that the ray does not run along, so far that only boxes about it are crossed.
    let inverse = select(1.0 / direction, vec3(1e30), abs(direction) < vec3(1e-30));
    var hit = Hit(end, NO_TRIANGLE, vec2(0.0));
    let nodes = tree.node[0].skip;
    var i = 0u;
    while i < nodes {
        let node = tree.node[i];
        let one = (node.low - origin) * inverse;
        let other = (node.high - origin) * inverse;
        let enters = min(one, other);
        let leaves = max(one, other) * ROUNDING;
        let near = max(max(enters.x, enters.y), max(enters.z, begin));
        let far = min(min(leaves.x, leaves.y), min(leaves.z, hit.t));
        if near > far {
            i = node.skip;
            continue;
        }
        let first = leaf_first(node);
        for (var k = 0u; k < leaf_count(node); k++) {
            let triangle = triangles.triangle[first + k];
            let at = hit_of(triangle, origin, direction);
            let passes = at.x > begin && at.x < hit.t;
            if passes && is_there(first + k, triangle, at.yz) && is_left(triangle, origin + at.x * direction) {
                hit = Hit(at.x, first + k, at.yz);
            }
        }
        i++;
    }
    return hit;
}
