// Normals of cut faces in the world: of the clip that cut, whatever the volume holds there. They point out of what is left, into what
// is hidden, where the eye is.
//
// Of analytic shapes exactly: the gradient of the distance, through the inverse of the scale. Of meshes from the depth map of the
// layer that the ray crossed.

#include "shared/clips.wgsl"

// Direction of the gradient of a shape's distance at its surface, in local units. Where faces meet, of the one that is farther out.
fn local_normal(kind: u32, p: vec3<f32>) -> vec3<f32> {
    let ring = length(p.xy);
    let outwards = vec3(p.xy / max(ring, 1e-30), 0.0);
    switch kind {
        case BOX: {
            let d = abs(p);
            return sign(p) * vec3<f32>(d >= vec3(max(d.x, max(d.y, d.z))));
        }
        case SPHERE: {
            return p;
        }
        case CYLINDER: {
            return select(outwards, vec3(0.0, 0.0, sign(p.z)), abs(p.z) > ring);
        }
        case CONE: {
            let flank = (2.0 * ring + p.z - 1.0) / sqrt(5.0);
            return select(2.0 * outwards + vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, -1.0), -1.0 - p.z > flank);
        }
        case TORUS: {
            return (ring - 1.0) * outwards + vec3(0.0, 0.0, p.z);
        }
        default: {
            return vec3(0.0, 0.0, -1.0);
        }
    }
}

// Pixels round a wall that say how it runs, each way: a stair of one pixel turns the mean direction of 13 x 13 by 1 degree in the mean.
const WALL_WINDOW = 6;

fn depth_at(c: u32, map: u32, pixel: vec2<i32>) -> f32 {
    let resolution = i32(clips.clip[c].resolution);
    if any(pixel < vec2(0)) || any(pixel >= vec2(resolution)) {
        return EMPTY;
    }
    return layers.depth[clips.clip[c].layers_at + (map * u32(resolution) + u32(pixel.y)) * u32(resolution) + u32(pixel.x)];
}

// Change of a map's depth from this pixel to the next one along a direction, by the two on its side or the two on the other: those that
// lie more nearly in a line with it, for a line of three that leads over an edge bends there.
fn rise_of(c: u32, map: u32, pixel: vec2<i32>, depth: f32, along: vec2<i32>) -> f32 {
    let forwards = rise_to(depth, depth_at(c, map, pixel + along), depth_at(c, map, pixel + 2 * along));
    let backwards = rise_to(depth, depth_at(c, map, pixel - along), depth_at(c, map, pixel - 2 * along));
    return select(-backwards.x, forwards.x, forwards.y <= backwards.y);
}

// Change to the next depth, and how much of a bend follows: beyond all others where the face ends.
fn rise_to(depth: f32, next: f32, after: f32) -> vec2<f32> {
    if next >= EMPTY {
        return vec2(0.0, 4.0);
    }
    return vec2(next - depth, select(abs(after - 2.0 * next + depth), 3.0, after >= EMPTY));
}

// Direction across a wall along the map's view, by what is inside round it at this depth.
fn across_wall(c: u32, map: vec3<f32>, pixel: vec2<i32>) -> vec2<f32> {
    var across = vec2(0.0);
    for (var y = -WALL_WINDOW; y <= WALL_WINDOW; y++) {
        for (var x = -WALL_WINDOW; x <= WALL_WINDOW; x++) {
            let there = pixel + vec2(x, y);
            let offset = vec2<f32>(there) + 0.5 - map.xy;
            let reach = f32(WALL_WINDOW) + 0.5;
            let weight = max(1.0 - dot(offset, offset) / (reach * reach), 0.0);
            var within = 0.0;
            for (var pair = 0u; pair < clips.clip[c].pairs; pair++) {
                let front = depth_at(c, 2u * pair, there);
                if front < map.z && map.z < depth_at(c, 2u * pair + 1u, there) {
                    within = 1.0;
                }
            }
            across += within * weight * offset;
        }
    }
    return across;
}

// In the mesh's rigid frame; its sign is the caller's. The ray came to `rigid` from the eye and has just crossed a face of the layers:
// the depth of one in this pixel, or the border to the pixel before. A border is a stair of a layer that comes to this depth within
// two pixels, by its own slope; or else a wall along the map's view, which no layer shows.
fn mesh_normal(c: u32, rigid: vec3<f32>, towards_eye: vec3<f32>) -> vec3<f32> {
    let corner = clips.clip[c].corner;
    let to_map = vec3(corner.w, corner.w, clips.clip[c].per_depth);
    let map = map_of(c, rigid);
    let way = towards_eye * to_map;
    let here = vec2<i32>(floor(map.xy));
    // Ways back to the borders of the pixel.
    let border = select(fract(map.xy), 1.0 - fract(map.xy), way.xy > vec2(0.0));
    let to_border = select(border / abs(way.xy), vec2(1e30), way.xy == vec2(0.0));
    let sideways = select(vec2(0, 1), vec2(1, 0), to_border.x < to_border.y);
    let before = here + sideways * vec2<i32>(sign(way.xy));

    // The first face before the border, and of both pixels the face nearest to the point.
    let maps = 2u * clips.clip[c].pairs;
    var m = maps;
    var pixel = here;
    var to_face = min(to_border.x, to_border.y);
    var nearest = maps;
    var nearest_in = here;
    var distance = 1e30;
    for (var i = 0u; i < maps; i++) {
        let depth = depth_at(c, i, here);
        let back = (depth - map.z) / way.z;
        if depth < EMPTY && back >= 0.0 && back < to_face {
            m = i;
            to_face = back;
        }
        if depth < EMPTY && abs(depth - map.z) < distance {
            nearest = i;
            nearest_in = here;
            distance = abs(depth - map.z);
        }
        let depth_before = depth_at(c, i, before);
        if depth_before < EMPTY && abs(depth_before - map.z) < distance {
            nearest = i;
            nearest_in = before;
            distance = abs(depth_before - map.z);
        }
    }
    let at_border = m == maps;
    if at_border {
        m = nearest;
        pixel = nearest_in;
    }
    var rise = vec2(0.0);
    if m < maps {
        let depth = depth_at(c, m, pixel);
        rise = vec2(rise_of(c, m, pixel, depth, vec2(1, 0)), rise_of(c, m, pixel, depth, vec2(0, 1)));
    }
    // Or a face that the ray crossed with that border in one step: within a pixel's edge.
    if at_border && distance > 2.0 * (abs(rise.x) + abs(rise.y)) + to_map.z / to_map.x {
        return vec3(across_wall(c, map, before), 0.0);
    }
    return vec3(rise * to_map.xy / to_map.z, -1.0);
}

// Of the cut at this point, on which a ray came out of a clip.
fn clip_normal(c: u32, world: vec3<f32>, towards_eye: vec3<f32>) -> vec3<f32> {
    let rigid = rigid_of(c, world);
    let rows = clips.clip[c].to_rigid;
    let to_rigid = mat3x3(rows[0].xyz, rows[1].xyz, rows[2].xyz);
    var normal = vec3(0.0);
    if clips.clip[c].kind == MESH {
        let eye = towards_eye * to_rigid;
        normal = mesh_normal(c, rigid, eye);
        normal *= select(1.0, -1.0, dot(normal, eye) < 0.0);
    } else {
        let scale = clips.clip[c].scale.xyz;
        normal = local_normal(clips.clip[c].kind, rigid / scale) / scale;
        normal *= select(-1.0, 1.0, clips.clip[c].keep == 1u);
    }
    // A mesh without an inside here, and the very centre of a shape, cut nothing and have none.
    return to_rigid * normal / max(length(normal), 1e-30);
}
