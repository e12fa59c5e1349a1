// Ambient occlusion of a point by a triangle, exactly (AOV section 4), and its falloff (section 5.1).
//
// alpha is the share of the triangle that is there: where masks and clips leave a part, it is taken to be spread over all of it (section 5.3).
//
//   AO = -1/2pi sum_i theta_i n.m_i    m_i = S(p_i x p_j), theta_i the angle between p_i and p_j, over the polygon that n.p >= 0 leaves
//   g  = alpha prod_{i=0..k} clamp(1 - p_i.m_i / delta, 0, 1)    m_i the inward normals of the edges, m_k = -(normal of the face), p_k = p_0
//
// The paper's eq. 19 takes the angle by acos, which in f32 loses small ones; its eq. 20 and 24 end the product before k, the distance from the
// face. Corners are relative to the point.
//
// The volume, where g is above 0, ends with the box of a sliver; or, as printed (section 5.2), every volume where its corners are no farther than
// CLAMP delta from the triangle's, which cuts where g is above 0: from corners of 60 degrees on.

#include "shared/world.wgsl"

const TURN = 6.28318530718;

// What an edge of the polygon contributes.
fn edge_term(p: vec3<f32>, q: vec3<f32>, normal: vec3<f32>) -> f32 {
    let across = cross(p, q);
    let sine = length(across);
    return select(0.0, atan2(sine, dot(p, q)) * dot(normal, across) / sine, sine > 0.0);
}

// Of corners that wind clockwise for the point, so that the triangle faces it.
fn occlusion_by(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, normal: vec3<f32>) -> f32 {
    let heights = vec3(dot(normal, a), dot(normal, b), dot(normal, c));
    let above = heights >= vec3(0.0);
    let count = u32(above.x) + u32(above.y) + u32(above.z);
    if count == 0u {
        return 0.0;
    }
    // Turned so that the corner of its own kind is the first.
    let odd = select(vec3<bool>(!above.x, !above.y, !above.z), above, count == 1u);
    var p = a;
    var q = b;
    var r = c;
    var h = heights;
    if count != 3u && odd.y {
        p = b;
        q = c;
        r = a;
        h = heights.yzx;
    } else if count != 3u && odd.z {
        p = c;
        q = a;
        r = b;
        h = heights.zxy;
    }
    // Where edges from the first corner pass through the tangent plane.
    let pq = p + (q - p) * (h.x / (h.x - h.y));
    let rp = p + (r - p) * (h.x / (h.x - h.z));
    var one = p;
    var two = q;
    var three = r;
    var four = p;
    if count == 1u {
        two = pq;
        three = rp;
    } else if count == 2u {
        one = pq;
        four = rp;
    }
    let sum = edge_term(one, two, normal) + edge_term(two, three, normal) + edge_term(three, four, normal)
        + edge_term(four, one, normal);
    return max(0.0, -sum / TURN);
}

// How much a triangle counts for a point, g; above 0 within its volume. `nothing`: how far in front of a face, in mm, what lies there is taken for
// the face itself. `clamped`: volumes end as printed; a constant wherever time counts.
fn falloff_of(
    triangle: WorldTriangle,
    share: f32,
    point: vec3<f32>,
    delta: f32,
    nothing: f32,
    clamped: bool,
) -> f32 {
    if share <= 0.0 {
        return 0.0;
    }
    let kind = u32(triangle.c.w);
    let a = triangle.a.xyz - point;
    var b = triangle.b.xyz - point;
    var c = triangle.c.xyz - point;
    var face = normalize(cross(b - a, c - a));
    var height = -dot(a, face);
    if height < 0.0 && (kind & TWO_SIDED) != 0u {
        let swapped = b;
        b = c;
        c = swapped;
        face = -face;
        height = -height;
    }
    if height <= nothing || height >= delta {
        return 0.0;
    }
    let along_ab = normalize(b - a);
    let along_bc = normalize(c - b);
    let along_ca = normalize(a - c);
    // How far outside each edge the point is.
    let outside = vec3(
        dot(a, cross(face, along_ab)),
        dot(b, cross(face, along_bc)),
        dot(c, cross(face, along_ca)),
    );
    let near = clamp(1.0 - outside / delta, vec3(0.0), vec3(1.0));
    let falloff = near.x * near.y * near.z * (1.0 - height / delta);
    if falloff <= 0.0 {
        return 0.0;
    }
    if clamped {
        return select(0.0, share * falloff, in_clamped(a, b, c, face, delta));
    }
    if (kind & SLIVER) != 0u && !in_box(a, b, c, face, delta) {
        return 0.0;
    }
    return share * falloff;
}

// What a triangle at these corners contributes to a point's occlusion: falloff times exact occlusion.
fn contribution(
    triangle: WorldTriangle,
    share: f32,
    point: vec3<f32>,
    normal: vec3<f32>,
    delta: f32,
    nothing: f32,
    clamped: bool,
) -> f32 {
    let falloff = falloff_of(triangle, share, point, delta, nothing, clamped);
    if falloff <= 0.0 {
        return 0.0;
    }
    let a = triangle.a.xyz - point;
    let b = triangle.b.xyz - point;
    let c = triangle.c.xyz - point;
    // Of two sides the one that faces the point.
    let behind = dot(a, cross(b - a, c - a)) > 0.0;
    return falloff * occlusion_by(a, select(b, c, behind), select(c, b, behind), normal);
}

// Of delta: the farthest that a clamped corner is from the triangle's.
const CLAMP = 2.0;

// From a corner to that of the clamped volume: away from the triangle between its edges, until it is delta from both (eq. 28), or CLAMP delta.
fn clamped_extension(along_next: vec3<f32>, along_before: vec3<f32>, face: vec3<f32>, delta: f32) -> vec3<f32> {
    // Of the half angle twice the sine, and beside it twice the cosine: one of them has a direction.
    let inward = cross(face, along_next) + cross(face, along_before);
    let sine = length(inward);
    let away = select(CLAMP, 2.0 / sine, CLAMP * sine > 2.0);
    return -normalize(inward + along_next - along_before) * (away * delta);
}

// Whether the point is over the base of a clamped volume.
fn in_clamped(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, face: vec3<f32>, delta: f32) -> bool {
    let ab = normalize(b - a);
    let bc = normalize(c - b);
    let ca = normalize(a - c);
    let p = a + clamped_extension(ab, ca, face, delta);
    let q = b + clamped_extension(bc, ab, face, delta);
    let r = c + clamped_extension(ca, bc, face, delta);
    return dot(p, cross(face, q - p)) <= 0.0 && dot(q, cross(face, r - q)) <= 0.0 && dot(r, cross(face, p - r)) <= 0.0;
}

// Whether the point is over the box of a triangle in its plane, along its longest edge, grown by delta.
fn in_box(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, face: vec3<f32>, delta: f32) -> bool {
    let along = longest_edge(a, b, c);
    let across = cross(face, along);
    let u = vec3(dot(a, along), dot(b, along), dot(c, along));
    let v = vec3(dot(a, across), dot(b, across), dot(c, across));
    let low = vec2(min(u.x, min(u.y, u.z)), min(v.x, min(v.y, v.z)));
    let high = vec2(max(u.x, max(u.y, u.z)), max(v.x, max(v.y, v.z)));
    return all(low <= vec2(delta)) && all(high >= vec2(-delta));
}

// Its direction.
fn longest_edge(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> vec3<f32> {
    let ab = b - a;
    let bc = c - b;
    let ca = a - c;
    let one = select(ab, bc, dot(bc, bc) > dot(ab, ab));
    return normalize(select(one, ca, dot(ca, ca) > dot(one, one)));
}
