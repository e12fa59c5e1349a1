// Layer pairs of a clip mesh from its surfaces in the order of depth, as `peel` draws them, and the bounds of their blocks.
//
// Along the ray of a pixel each face adds 1 to the winding number or takes 1 away. A pair begins where the number leaves 0 and ends
// where it is 0 again. Gaps and pairs no longer than ONE_DEPTH are none.

struct PairsParams {
    // pixels along the edge of the layers, most pairs that are kept
    resolution: u32,
    pairs: u32,
    // in `layers`
    layers_at: u32,
    blocks_at: u32,
    // number of the surface, and 1 if no more is drawn
    surface: u32,
    last: u32,
}

// The pairs of a pixel so far.
struct Pixel {
    // winding number behind the last surface
    winding: i32,
    // pairs, the one that has not ended yet too
    count: u32,
    // where the last pair began and ended
    begin: f32,
    end: f32,
}

struct Pixels {
    pixel: array<Pixel>,
}

// Peeled, while invocations write it.
struct GrowingPeeled {
    across: u32,
    down: u32,
    pairs: atomic<u32>,
    surfaces: atomic<u32>,
    seen: atomic<u32>,
    most: atomic<u32>,
    beyond: atomic<u32>,
    open: atomic<u32>,
    from_first: atomic<u32>,
}

#include "shared/layers.wgsl"

var<immediate> params: PairsParams;
@group(0) @binding(0) var depths: texture_depth_2d;
@group(0) @binding(1) var faces: texture_2d<u32>;
@group(0) @binding(2) var<storage, read_write> pixels: Pixels;
@group(0) @binding(3) var<storage, read_write> peeled: GrowingPeeled;
@group(0) @binding(4) var<storage, read_write> layers: Layers;

// One surface more. The first makes all layers empty; behind one that no pixel has there is nothing.
@compute @workgroup_size(8, 8, 1)
fn add(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2(params.resolution)) || atomicLoad(&peeled.surfaces) < params.surface {
        return;
    }
    let size = params.resolution * params.resolution;
    let index = id.y * params.resolution + id.x;
    let at = params.layers_at + index;
    var pixel = Pixel(0, 0u, EMPTY, EMPTY);
    if params.surface == 0u {
        for (var map = 0u; map < 2u * params.pairs; map++) {
            layers.depth[at + map * size] = EMPTY;
        }
    } else {
        pixel = pixels.pixel[index];
    }
    let z = textureLoad(depths, vec2<i32>(id.xy), 0);
    if z < EMPTY {
        if atomicLoad(&peeled.surfaces) <= params.surface {
            atomicMax(&peeled.surfaces, params.surface + 1u);
        }
        if params.last != 0u {
            atomicAdd(&peeled.seen, 1u);
        }
        let before = pixel.winding;
        let front = (textureLoad(faces, vec2<i32>(id.xy), 0).r & 1u) != 0u;
        pixel.winding += select(-1, 1, front);
        if before == 0 {
            // A gap of nothing is none: the last pair goes on.
            if pixel.count == 0u || z - pixel.end > ONE_DEPTH {
                pixel.count++;
                pixel.begin = z;
                pixel.end = z;
            }
        } else if pixel.winding == 0 {
            pixel.end = z;
            if z - pixel.begin <= ONE_DEPTH {
                // Nor is a pair of nothing one.
                pixel.count--;
                pixel.end = NO_BACK;
            } else if pixel.count <= params.pairs {
                let pair = at + (2u * pixel.count - 2u) * size;
                layers.depth[pair] = pixel.begin;
                layers.depth[pair + size] = z;
            }
        }
    }
    pixels.pixel[index] = pixel;
}

// What was found, after the last surface.
@compute @workgroup_size(8, 8, 1)
fn finish(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2(params.resolution)) {
        return;
    }
    let size = params.resolution * params.resolution;
    let index = id.y * params.resolution + id.x;
    let pixel = pixels.pixel[index];
    if pixel.winding != 0 {
        atomicAdd(&peeled.open, 1u);
        atomicMax(&peeled.from_first, size - index);
    }
    // One that has not ended may still be one of nothing.
    let count = pixel.count - select(0u, 1u, pixel.winding != 0);
    if count > params.pairs {
        atomicAdd(&peeled.beyond, 1u);
    }
    if count > atomicLoad(&peeled.most) {
        atomicMax(&peeled.most, count);
        atomicMax(&peeled.pairs, min(count, params.pairs));
    }
}

// Nearest front, farthest back, farthest front and nearest back of a block of pixels and a pair. A pixel with nothing inside counts as
// NO_FRONT and NO_BACK, behind and before everything.
@compute @workgroup_size(8, 8, 1)
fn blocks(@builtin(global_invocation_id) id: vec3<u32>) {
    let edge = (params.resolution + BLOCK - 1u) / BLOCK;
    if any(id.xy >= vec2(edge)) || id.z >= atomicLoad(&peeled.pairs) {
        return;
    }
    let size = params.resolution * params.resolution;
    let first = id.xy * BLOCK;
    let end = min(first + BLOCK, vec2(params.resolution));
    var nearest_front = NO_FRONT;
    var farthest_back = NO_BACK;
    var farthest_front = NO_BACK;
    var nearest_back = NO_FRONT;
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            let at = params.layers_at + 2u * id.z * size + y * params.resolution + x;
            let front = layers.depth[at];
            let back = layers.depth[at + size];
            let holds = front < back;
            let f = select(NO_FRONT, front, holds);
            let b = select(NO_BACK, back, holds);
            nearest_front = min(nearest_front, f);
            farthest_back = max(farthest_back, b);
            farthest_front = max(farthest_front, f);
            nearest_back = min(nearest_back, b);
        }
    }
    let out = params.blocks_at + id.z * BLOCK_BOUNDS * edge * edge + id.y * edge + id.x;
    layers.depth[out] = nearest_front;
    layers.depth[out + edge * edge] = farthest_back;
    layers.depth[out + 2u * edge * edge] = farthest_front;
    layers.depth[out + 3u * edge * edge] = nearest_back;
}
