// Caps: where a ray, in the inside of closed meshes that ask for it, comes out of what clips hide, it meets the surface of the cut.
//
// A place is inside where a ray leaves by more faces behind it than it enters by. No face is crossed twice, or missed, where a ray passes
// through an edge: on which side of it the ray is, is decided once for both faces.
//
// Kernels bind what `ray.wgsl` and `stretches.wgsl` ask for.

#include "shared/ray.wgsl"
#include "shared/stretches.wgsl"

struct Cap {
    // way along the ray, in its direction's lengths; without a cap the end of it
    t: f32,
    // a face of the mesh that is cut, or NO_TRIANGLE
    triangle: u32,
    // the clip that the ray comes out of
    clip: u32,
}

// What a line crosses behind a place.
struct Crossings {
    // faces through which it leaves less those through which it enters
    balance: i32,
    // the first of those, NO_TRIANGLE and infinitely far where there is none; and the first of these
    leaves: f32,
    leaving: u32,
    enters: f32,
}

const ALL_BODIES = 0xffffffffu;

fn body_of(triangle: WorldTriangle) -> u32 {
    return materials.material[u32(triangle.b.w)].body;
}

// Whether the middle is to the left of the way from a to b: of a place on the way the same for both directions, so that it is on one side.
fn is_left_of(a: vec2<f32>, b: vec2<f32>) -> bool {
    let turned = b.x < a.x || b.x == a.x && b.y < a.y;
    let low = select(a, b, turned);
    let high = select(b, a, turned);
    return (low.x * high.y - low.y * high.x >= 0.0) != turned;
}

// A corner from a ray's origin: across the ray, and along the axis that it runs along most (Woop et al. 2013).
fn sheared(corner: vec3<f32>, line: Line, axis: u32) -> vec3<f32> {
    let way = corner - line.origin;
    let x = (axis + 1u) % 3u;
    let y = (axis + 2u) % 3u;
    let along = way[axis] / line.direction[axis];
    return vec3(way[x] - line.direction[x] * along, way[y] - line.direction[y] * along, along);
}

// Where a line crosses a triangle; y is 1 where it leaves by it, -1 where it enters, 0 where it misses.
fn crossing_of(triangle: WorldTriangle, line: Line, axis: u32) -> vec2<f32> {
    let a = sheared(triangle.a.xyz, line, axis);
    let b = sheared(triangle.b.xyz, line, axis);
    let c = sheared(triangle.c.xyz, line, axis);
    let left = is_left_of(a.xy, b.xy);
    if is_left_of(b.xy, c.xy) != left || is_left_of(c.xy, a.xy) != left {
        return vec2(0.0);
    }
    // Shares of the corners, of which rounding must not make a place beyond them.
    let weights = abs(vec3(b.x * c.y - b.y * c.x, c.x * a.y - c.y * a.x, a.x * b.y - a.y * b.x));
    let t = dot(weights, vec3(a.z, b.z, c.z)) / max(weights.x + weights.y + weights.z, 1e-30);
    return vec2(t, select(-1.0, 1.0, left == (line.direction[axis] > 0.0)));
}

// What it crosses of capped meshes, or of one of them, behind `begin`.
fn crossings(line: Line, begin: f32, body: u32) -> Crossings {
    let inverse = select(1.0 / line.direction, vec3(1e30), abs(line.direction) < vec3(1e-30));
    let long = abs(line.direction);
    var axis = select(0u, 1u, long.y > long.x);
    axis = select(axis, 2u, long.z > max(long.x, long.y));
    var found = Crossings(0, NOWHERE.x, NO_TRIANGLE, NOWHERE.x);
    let nodes = tree.node[0].skip;
    var i = 0u;
    while i < nodes {
        let node = tree.node[i];
        let one = (node.low - line.origin) * inverse;
        let other = (node.high - line.origin) * inverse;
        let enters = min(one, other);
        let leaves = max(one, other) * ROUNDING;
        let near = max(max(enters.x, enters.y), max(enters.z, begin));
        if near > min(leaves.x, min(leaves.y, leaves.z)) {
            i = node.skip;
            continue;
        }
        let first = leaf_first(node);
        for (var k = 0u; k < leaf_count(node); k++) {
            let triangle = triangles.triangle[first + k];
            if (u32(triangle.c.w) & CAPPED) == 0u {
                continue;
            }
            let at = crossing_of(triangle, line, axis);
            if at.y == 0.0 || at.x <= begin || body != ALL_BODIES && body != body_of(triangle) {
                continue;
            }
            found.balance += i32(at.y);
            if at.y < 0.0 {
                found.enters = min(found.enters, at.x);
            } else if at.x < found.leaves {
                found.leaves = at.x;
                found.leaving = first + k;
            }
        }
        i++;
    }
    return found;
}

// A face of the mesh that a place on a line is inside of: of several the one that it leaves first. NO_TRIANGLE outside of all.
fn inside_of(line: Line, t: f32) -> u32 {
    var first = NO_TRIANGLE;
    // A face that the line leaves by, where, and the mesh that it is of, where that is asked for.
    var face = NO_TRIANGLE;
    var leaves = t;
    var body = ALL_BODIES;
    loop {
        let found = crossings(line, select(t, leaves, body == ALL_BODIES), body);
        if body != ALL_BODIES {
            if found.balance > 0 {
                break;
            }
            body = ALL_BODIES;
            continue;
        }
        face = found.leaving;
        leaves = found.leaves;
        // What is left without being entered is around the place.
        if first == NO_TRIANGLE && (found.balance <= 0 || found.leaves < found.enters) {
            face = select(face, NO_TRIANGLE, found.balance <= 0);
            break;
        }
        if face == NO_TRIANGLE {
            face = first;
            break;
        }
        first = select(first, face, first == NO_TRIANGLE);
        body = body_of(triangles.triangle[face]);
    }
    return face;
}

// Whether a ray leaves a capped mesh by a face of it.
fn leaves_by(triangle: WorldTriangle, direction: vec3<f32>) -> bool {
    let across = cross(triangle.b.xyz - triangle.a.xyz, triangle.c.xyz - triangle.a.xyz);
    return (u32(triangle.c.w) & CAPPED) != 0u && dot(across, direction) > 0.0;
}

// The first cap between `begin` and a hit, which is none that clips hide.
fn first_cap(origin: vec3<f32>, direction: vec3<f32>, begin: f32, hit: Hit) -> Cap {
    let line = line_of(origin, direction, hit.t);
    let none = Cap(hit.t, NO_TRIANGLE, NO_CLIP);
    var t = begin;
    while t < hit.t {
        // On to where something is hidden, and to its end: on through one clip after the other, as long as they hide.
        var through = NO_CLIP;
        loop {
            var next = NOWHERE.x;
            var hides = false;
            for (var c = 0u; c < clips.count && t < hit.t; c++) {
                let hidden = hidden_stretch(c, line, t);
                if hidden.x <= t + doubt(line, t) {
                    t = hidden.y;
                    through = c;
                    hides = true;
                } else {
                    next = min(next, hidden.x);
                }
            }
            if !hides {
                if through != NO_CLIP {
                    break;
                }
                t = next;
            }
            if !(t < hit.t) {
                return none;
            }
        }
        var triangle = NO_TRIANGLE;
        // What it crosses within rounding was passed by, as hidden; or else it is the hit, seen from inside.
        let behind = t + doubt(line, t);
        if hit.t > behind {
            triangle = inside_of(line, behind);
        } else if hit.triangle != NO_TRIANGLE && leaves_by(triangles.triangle[hit.triangle], direction) {
            triangle = hit.triangle;
        }
        if triangle != NO_TRIANGLE {
            return Cap(t, triangle, through);
        }
    }
    return none;
}
