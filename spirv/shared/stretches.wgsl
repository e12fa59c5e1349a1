// Which stretches of a ray clips hide: of planes, boxes, balls, cylinders and cones by their equations, of a torus by its distance, of meshes
// pixel by pixel of their layers. Kernels bind `clips` and `layers`.

#include "shared/clips.wgsl"
#include "shared/geometry.wgsl"

struct Line {
    origin: vec3<f32>,
    direction: vec3<f32>,
    // how far it is looked at, in the direction's lengths as all ways along it
    end: f32,
    // way of the origin from the world's
    away: f32,
}

// Where a shape is not met, and where the stretches of one without end do.
const NOWHERE = vec2(3e38, 3e38);
const BEYOND = 1e30;

fn line_of(origin: vec3<f32>, direction: vec3<f32>, end: f32) -> Line {
    return Line(origin, direction, end, length(origin) / length(direction));
}

// How far from where it is computed a place on the line may be, along it. What is shorter is no stretch.
fn doubt(line: Line, t: f32) -> f32 {
    return UNCERTAIN * (line.away + abs(t));
}

fn shared_stretch(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2(max(a.x, b.x), min(a.y, b.y));
}

// Where low < p + s d < high.
fn between_faces(p: f32, d: f32, low: f32, high: f32) -> vec2<f32> {
    if d == 0.0 {
        return select(NOWHERE, vec2(-BEYOND, BEYOND), low < p && p < high);
    }
    let a = (low - p) / d;
    let b = (high - p) / d;
    return vec2(min(a, b), max(a, b));
}

// The roots of a s^2 + 2 b s + c, the smaller one first, without cancellation (Numerical Recipes 5.6); one at infinity where a is 0.
fn roots(a: f32, b: f32, c: f32) -> vec2<f32> {
    let q = -(b + select(-1.0, 1.0, b >= 0.0) * sqrt(max(b * b - a * c, 0.0)));
    let one = q / select(a, -1e-30, abs(a) < 1e-30);
    let other = select(c / q, 0.0, q == 0.0);
    return vec2(min(one, other), max(one, other));
}

// Where a s^2 + 2 b s + c < 0, of an a that is not negative.
fn within_quadric(a: f32, b: f32, c: f32) -> vec2<f32> {
    if a < 1e-30 {
        return select(NOWHERE, vec2(-BEYOND, BEYOND), c < 0.0);
    }
    return select(NOWHERE, roots(a, b, c), b * b - a * c > 0.0);
}

// In a cone: its lower nappe, over its base.
fn within_cone(p: vec3<f32>, d: vec3<f32>) -> vec2<f32> {
    let under = 1.0 - p.z;
    let a = dot(d.xy, d.xy) - 0.25 * d.z * d.z;
    let b = dot(p.xy, d.xy) + 0.25 * under * d.z;
    let c = dot(p.xy, p.xy) - 0.25 * under * under;
    var within = vec2(0.0);
    if a >= 1e-30 {
        within = within_quadric(a, b, c);
    } else {
        // Steeper than its flank: in one nappe up to one root, in the other from the other on.
        let both = roots(a, b, c);
        within = select(vec2(-BEYOND, both.x), vec2(both.y, BEYOND), d.z < 0.0);
    }
    return shared_stretch(within, between_faces(p.z, d.z, -1.0, 1.0));
}

// Of a torus steps are as long as its distance, and at least this: what lies between is thinner than rounding.
const LEAST_STEP = 1e-3;
const RING_HALVINGS = 12u;

// In a torus, the first stretch that ends behind `s`.
fn within_torus(p: vec3<f32>, d: vec3<f32>, s: f32) -> vec2<f32> {
    let around = within_quadric(dot(d, d), dot(p, d), dot(p, p) - 1.96);
    let speed = length(d);
    var at = max(s, around.x);
    var before = at;
    var begin = NOWHERE.x;
    var inside = false;
    while at < around.y {
        let distance = local_distance(TORUS, p + at * d);
        if (distance < 0.0) == inside {
            before = at;
            at += max(abs(distance), LEAST_STEP) / speed;
            continue;
        }
        // Between the last two steps it came in or out.
        for (var i = 0u; i < RING_HALVINGS; i++) {
            let middle = 0.5 * (before + at);
            if (local_distance(TORUS, p + middle * d) < 0.0) == inside {
                before = middle;
            } else {
                at = middle;
            }
        }
        if inside && at > s {
            break;
        }
        inside = !inside;
        begin = at;
    }
    return vec2(begin, select(begin, at, inside));
}

// In a mesh, from `t` on: pixel by pixel of its map, what is between the faces of its pairs. It goes on over borders of pixels.
fn within_layers(c: u32, line: Line, t: f32) -> vec2<f32> {
    let rows = clips.clip[c].to_rigid;
    let corner = clips.clip[c].corner;
    let resolution = i32(clips.clip[c].resolution);
    let size = resolution * resolution;
    let p = map_of(c, rigid_of(c, line.origin));
    let d = line.direction * mat3x3(rows[0].xyz, rows[1].xyz, rows[2].xyz) * vec3(corner.ww, clips.clip[c].per_depth);
    var over = shared_stretch(between_faces(p.x, d.x, 0.0, f32(resolution)), between_faces(p.y, d.y, 0.0, f32(resolution)));
    over = shared_stretch(shared_stretch(over, between_faces(p.z, d.z, 0.0, 1.0)), vec2(t, line.end));
    var pixel = clamp(vec2<i32>(floor(p.xy + over.x * d.xy)), vec2(0), vec2(resolution - 1));
    var found = NOWHERE;
    while over.x < over.y && all(pixel >= vec2(0)) && all(pixel < vec2(resolution)) {
        let border = vec2<f32>(pixel) + select(vec2(0.0), vec2(1.0), d.xy > vec2(0.0));
        let to_border = select((border - p.xy) / d.xy, vec2(BEYOND), d.xy == vec2(0.0));
        // At corners some are passed in no time.
        let out = max(min(min(to_border.x, to_border.y), over.y), over.x);
        let at = clips.clip[c].layers_at + u32(pixel.y * resolution + pixel.x);
        // The first that is met in this pixel, and on through those that follow on one another.
        var goes_on = over.x < out;
        while goes_on {
            goes_on = false;
            var nearest = NOWHERE;
            for (var pair = 0u; pair < clips.clip[c].pairs; pair++) {
                let front = at + 2u * pair * u32(size);
                let faces = between_faces(p.z, d.z, layers.depth[front], layers.depth[front + u32(size)]);
                if layers.depth[front] < layers.depth[front + u32(size)] && faces.y > over.x && faces.x < nearest.x {
                    nearest = faces;
                }
            }
            if nearest.x < out && found.x == NOWHERE.x {
                found = vec2(max(nearest.x, over.x), over.x);
            }
            if found.x != NOWHERE.x && nearest.x <= max(found.y, found.x) {
                found.y = min(nearest.y, out);
                over.x = found.y;
                goes_on = found.y < out;
            }
        }
        if found.x != NOWHERE.x && found.y < out {
            return found;
        }
        over.x = out;
        pixel += select(vec2(0, 1), vec2(1, 0), to_border.x < to_border.y) * vec2<i32>(sign(d.xy));
    }
    return found;
}

// Inside a clip's shape, the first stretch that ends behind `t`.
fn within(c: u32, line: Line, t: f32) -> vec2<f32> {
    let kind = clips.clip[c].kind;
    if kind == MESH {
        return within_layers(c, line, t);
    }
    let rows = clips.clip[c].to_rigid;
    let scale = clips.clip[c].scale.xyz;
    let start = rigid_of(c, line.origin) / scale;
    let d = line.direction * mat3x3(rows[0].xyz, rows[1].xyz, rows[2].xyz) / scale;
    // From where the ray is nearest to the shape's middle: numbers are small there.
    let middle = -dot(start, d) / dot(d, d);
    let p = start + middle * d;
    var found = vec2(0.0);
    switch kind {
        case BOX: {
            let across = shared_stretch(between_faces(p.x, d.x, -1.0, 1.0), between_faces(p.y, d.y, -1.0, 1.0));
            found = shared_stretch(across, between_faces(p.z, d.z, -1.0, 1.0));
        }
        case SPHERE: {
            found = within_quadric(dot(d, d), dot(p, d), dot(p, p) - 1.0);
        }
        case CYLINDER: {
            let around = within_quadric(dot(d.xy, d.xy), dot(p.xy, d.xy), dot(p.xy, p.xy) - 1.0);
            found = shared_stretch(around, between_faces(p.z, d.z, -1.0, 1.0));
        }
        case CONE: {
            found = within_cone(p, d);
        }
        case TORUS: {
            found = within_torus(p, d, t - middle);
        }
        default: {
            found = between_faces(p.z, d.z, 0.0, BEYOND);
        }
    }
    found += middle;
    return select(NOWHERE, found, found.x < found.y && found.y > t);
}

// What a clip hides of a ray: the first stretch that ends behind `t` and its doubt.
fn hidden_stretch(c: u32, line: Line, t: f32) -> vec2<f32> {
    let keep = clips.clip[c].keep == 1u;
    var begin = t;
    while begin < line.end {
        let found = within(c, line, begin);
        // What a kept shape hides is before, between and behind its stretches.
        if select(found.y, found.x, keep) > begin + doubt(line, begin) {
            return select(found, vec2(begin, found.x), keep);
        }
        begin = found.y;
    }
    return vec2(begin, NOWHERE.y);
}
