// Clip shapes at their poses, and which points they hide (CAO section 3.2). A point on a surface is visible, eq. (1).

#include "shared/clip_bits.wgsl"
#include "shared/layers.wgsl"

struct Clip {
    // rows of the world -> rigid frame transform, mm
    to_rigid: array<vec4<f32>, 3>,
    // scale along the shape's axes, and the smallest of the three
    scale: vec4<f32>,
    // meshes: corner of the clip camera's map in the rigid frame, and 1 / pixel edge
    corner: vec4<f32>,
    kind: u32,
    // 0 remove: the inside is hidden; 1 keep: the outside is
    keep: u32,
    // meshes: layer pairs, their place in `layers` and the map's resolution
    pairs: u32,
    layers_at: u32,
    resolution: u32,
    // meshes: place in `dilation` and resolution of the dilation maps
    dilation_at: u32,
    dilation_resolution: u32,
    per_depth: f32,
    // meshes: corner x, y of the dilation maps in the rigid frame, 1 / cell edge; all: bound of rounding in mm
    cells: vec4<f32>,
    // meshes: place in `layers` of the bounds of blocks
    blocks_at: u32,
}

struct Clips {
    count: u32,
    clip: array<Clip, MOST_CLIPS>,
}

// Kinds of shapes.
const PLANE = 0u;
const BOX = 1u;
const SPHERE = 2u;
const CYLINDER = 3u;
const CONE = 4u;
const TORUS = 5u;
const MESH = 6u;

fn rigid_of(c: u32, world: vec3<f32>) -> vec3<f32> {
    let p = vec4(world, 1.0);
    return vec3(dot(clips.clip[c].to_rigid[0], p), dot(clips.clip[c].to_rigid[1], p), dot(clips.clip[c].to_rigid[2], p));
}

fn box_distance(p: vec3<f32>, half_edges: vec3<f32>) -> f32 {
    let d = abs(p) - half_edges;
    return min(max(d.x, max(d.y, d.z)), 0.0) + length(max(d, vec3(0.0)));
}

// Signed distance in local units, negative inside; as clip.rs has it.
fn local_distance(kind: u32, p: vec3<f32>) -> f32 {
    let ring = length(p.xy);
    switch kind {
        case BOX: {
            return box_distance(p, vec3(1.0));
        }
        case SPHERE: {
            return length(p) - 1.0;
        }
        case CYLINDER: {
            let d = vec2(ring - 1.0, abs(p.z) - 1.0);
            return min(max(d.x, d.y), 0.0) + length(max(d, vec2(0.0)));
        }
        case CONE: {
            let base = vec2(ring - min(ring, 1.0), p.z + 1.0);
            let flank = vec2(-1.0, 2.0);
            let from_rim = vec2(ring - 1.0, p.z + 1.0);
            let side = from_rim - flank * clamp(dot(from_rim, flank) / 5.0, 0.0, 1.0);
            let nearest = sqrt(min(dot(base, base), dot(side, side)));
            return select(nearest, -nearest, p.z > -1.0 && ring * 2.0 + p.z < 1.0);
        }
        case TORUS: {
            return length(vec2(ring - 1.0, p.z)) - 0.4;
        }
        default: {
            return -p.z;
        }
    }
}

fn map_of(c: u32, rigid: vec3<f32>) -> vec3<f32> {
    let corner = clips.clip[c].corner;
    return (rigid - corner.xyz) * vec3(corner.w, corner.w, clips.clip[c].per_depth);
}

// Whether the point lies between the front and back depth of some layer pair (eq. (1), P pairs instead of one).
fn inside_layers(c: u32, rigid: vec3<f32>) -> bool {
    let resolution = clips.clip[c].resolution;
    let map = map_of(c, rigid);
    // Before it becomes a whole number, which may not hold what is far outside.
    if !(all(map.xy >= vec2(0.0)) && all(map.xy < vec2(f32(resolution)))) {
        return false;
    }
    let pixel = vec2<u32>(map.xy);
    let size = resolution * resolution;
    var at = clips.clip[c].layers_at + pixel.y * resolution + pixel.x;
    for (var pair = 0u; pair < clips.clip[c].pairs; pair++) {
        if layers.depth[at] < map.z && map.z < layers.depth[at + size] {
            return true;
        }
        at += 2u * size;
    }
    return false;
}

fn inside(c: u32, world: vec3<f32>) -> bool {
    let rigid = rigid_of(c, world);
    if clips.clip[c].kind == MESH {
        return inside_layers(c, rigid);
    }
    return local_distance(clips.clip[c].kind, rigid / clips.clip[c].scale.xyz) < 0.0;
}

// None of the clips.
const NO_CLIP = MOST_CLIPS;

// The first of these clips, a bit for each, that hides the point.
fn hiding(among: u32, world: vec3<f32>) -> u32 {
    for (var c = 0u; c < clips.count; c++) {
        if (among >> c & 1u) != 0u && inside(c, world) == (clips.clip[c].keep == 0u) {
            return c;
        }
    }
    return NO_CLIP;
}

// Whether none of them does.
fn visible_to(among: u32, world: vec3<f32>) -> bool {
    return hiding(among, world) == NO_CLIP;
}

fn visible(world: vec3<f32>) -> bool {
    return visible_to(ALL_CLIPS, world);
}
