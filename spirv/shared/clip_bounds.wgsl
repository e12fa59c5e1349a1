// What the clips do to a whole box of points, from bounds instead of samples (method.md section 6). Conservative: where the
// bounds do not decide, the answer is CUT or SOME, and points have to be looked at.

#include "shared/clip_codes.wgsl"

// Bounds of rounding: a distance is computed twice, at the box's centre and at a point in it, each time right to
// `cells.w`, the clip's bound; twice that for the bounds' own operations.
const ROUNDINGS = 4.0;

// Largest component along each rigid axis of the way from a box's centre to a point in it.
fn rigid_extent(c: u32, half_edges: vec3<f32>) -> vec3<f32> {
    return vec3(
        dot(abs(clips.clip[c].to_rigid[0].xyz), half_edges),
        dot(abs(clips.clip[c].to_rigid[1].xyz), half_edges),
        dot(abs(clips.clip[c].to_rigid[2].xyz), half_edges),
    );
}

// Least and largest distance of points up to `extent` from `p`. Distances are exact, so that they change by no more than the
// way, `ball` at most; a plane's and a box's are also known from the axes.
fn between(kind: u32, distance: f32, p: vec3<f32>, half: vec3<f32>, extent: vec3<f32>, ball: f32) -> vec2<f32> {
    if kind == PLANE {
        return vec2(distance - extent.z, distance + extent.z);
    }
    var bounds = vec2(distance - ball, distance + ball);
    if kind == BOX {
        // Grows with each |p|.
        bounds.x = max(bounds.x, box_distance(max(abs(p) - extent, vec3(0.0)), half));
        bounds.y = min(bounds.y, box_distance(abs(p) + extent, half));
    }
    return bounds;
}

// The same in local units for a box of world points around a point of the rigid frame, rounding included.
fn local_between(c: u32, rigid: vec3<f32>, half_edges: vec3<f32>) -> vec2<f32> {
    let kind = clips.clip[c].kind;
    let scale = clips.clip[c].scale;
    let p = rigid / scale.xyz;
    let extent = rigid_extent(c, half_edges) / scale.xyz;
    let ball = min(length(extent), length(half_edges) / scale.w);
    let rounding = ROUNDINGS * clips.clip[c].cells.w / scale.w;
    return between(kind, local_distance(kind, p), p, vec3(1.0), extent, ball) + vec2(-rounding, rounding);
}

// What an analytic clip hides of a box of world points.
fn shape_visibility(c: u32, rigid: vec3<f32>, half_edges: vec3<f32>) -> u32 {
    let distance = local_between(c, rigid, half_edges);
    if distance.x <= 0.0 && distance.y >= 0.0 {
        return CUT;
    }
    return select(HIDDEN, VISIBLE, (distance.x > 0.0) == (clips.clip[c].keep == 0u));
}

// Several clips together hide what any of them hides.
fn joined_visibility(one: u32, other: u32) -> u32 {
    if one == HIDDEN || other == HIDDEN {
        return HIDDEN;
    }
    if one == VISIBLE {
        return other;
    }
    return select(min(one, other), one, other == VISIBLE);
}
