// Stage 6 of CAO section 3.5: the volume by ray casting, all views in one dispatch. Front to back, early termination, leaps over bricks that show nothing, clipped samples skipped by the shadow test of section 3.2, ambient factor
// from V_AO at every sample that shows anything.

#include "shared/transfer.wgsl"

@group(0) @binding(0) var volume: texture_3d<f32>;
@group(0) @binding(2) var opacity: texture_3d<f32>;
@group(0) @binding(3) var ambient: texture_3d<f32>;
// linear; transparent outside, and continued from the edge
@group(0) @binding(4) var field: sampler;
@group(0) @binding(5) var edge: sampler;
@group(0) @binding(6) var<uniform> frame: Frame;
@group(0) @binding(7) var<storage, read> distances: Distances;
@group(0) @binding(8) var<storage, read> clips: Clips;
@group(0) @binding(9) var<storage, read> layers: Layers;

// a layer a view: premultiplied, linear; Vulkan's 0 ... 1
@group(0) @binding(10) var colours: texture_storage_2d_array<rgba32float, write>;
@group(0) @binding(11) var depths: texture_storage_2d_array<r32float, write>;
// the colours of `half_floats`: WGSL states a storage image's format, so that each has an entry point
@group(0) @binding(12) var half_colours: texture_storage_2d_array<rgba16float, write>;

#include "shared/bricks.wgsl"
#include "shared/clips.wgsl"
#include "shared/distances.wgsl"
#include "shared/eyes.wgsl"

struct RaycastParams {
    // pixels of one view
    size: vec2<u32>,
    // 1: the device filters these texels too coarsely, so values are interpolated here
    by_hand: u32,
    // the band: the view's row that is the images' first, and how many rows they hold
    first_row: u32,
    rows: u32,
    // tiles of the band to draw, counted along its rows of tiles
    first_tile: u32,
    tiles: u32,
}

struct Pixel {
    // premultiplied, linear
    colour: vec4<f32>,
    depth: f32,
}

var<immediate> params: RaycastParams;

// Pixels along the edge of a workgroup's tile: its rays read nearly the same bricks.
const TILE = 8u;

// Part of a step by which a leap ends early: more than rounding moves a sample, so that none is left out.
const LEAP_MARGIN = 0.1;

// Halvings of a step at a cut: to 1/16 of it.
const CUT_HALVINGS = 4u;

fn texel_at(x: i32, y: i32, z: i32) -> f32 {
    return textureLoad(volume, vec3(x, y, z), 0).r;
}

// What a filter should give.
fn interpolated(position: vec3<f32>) -> f32 {
    let last = frame.dims.xyz - 1.0;
    let at = clamp(position, vec3(0.0), last);
    let l = vec3<i32>(at);
    let h = min(l + 1, vec3<i32>(last));
    let w = at - vec3<f32>(l);
    let low = mix(
        mix(texel_at(l.x, l.y, l.z), texel_at(h.x, l.y, l.z), w.x),
        mix(texel_at(l.x, h.y, l.z), texel_at(h.x, h.y, l.z), w.x),
        w.y,
    );
    let high = mix(
        mix(texel_at(l.x, l.y, h.z), texel_at(h.x, l.y, h.z), w.x),
        mix(texel_at(l.x, h.y, h.z), texel_at(h.x, h.y, h.z), w.x),
        w.y,
    );
    return mix(low, high, w.z);
}

fn value_at(position: vec3<f32>) -> f32 {
    var texel = 0.0;
    if params.by_hand == 1u {
        texel = interpolated(position);
    } else {
        texel = textureSampleLevel(volume, edge, (position + 0.5) / frame.dims.xyz, 0.0).r;
    }
    return texel * frame.scale + frame.bias;
}

#include "shared/shading.wgsl"

// Whether nothing that lies further along the ray can change a pixel of the picture by more than the frame's tolerance. What
// remains adds at most its share of the brightest light to a component, or takes as much of a background; sRGB coding
// spreads that by its slope, which is largest at the darkest component so far (12.92 at 0, 1.055/2.4 c^(-7/12) above).
fn ends(colour: vec3<f32>, alpha: f32) -> bool {
    let rest = 1.0 - alpha;
    // The slope at 1 is the least.
    if rest * 0.4396 > frame.remainder {
        return false;
    }
    let darkest = clamp(min(colour.r, min(colour.g, colour.b)), 0.003, 1.0);
    return rest * min(12.92, 0.4396 * pow(darkest, -7.0 / 12.0)) <= frame.remainder;
}

// What an eye sees at a place in pixels.
fn seen(eye: Eye, place: vec2<f32>) -> Pixel {
    let ray = ray_through(eye, place / vec2<f32>(params.size));
    let start = ray.start;
    let along = ray.along;

    let exponent = frame.spacing.w / frame.light.w;
    let bricks = bricks_of(vec3<u32>(frame.dims.xyz));
    let last_brick = vec3<i32>(bricks) - 1;

    var colour = vec3(0.0);
    var alpha = 0.0;
    var depth = 1.0;
    // Samples so far, and that number at the last hidden one: integers, for an f32 stops counting at 2^24.
    var k = 0u;
    var hidden = 0xffffffffu;
    // The sample at which the last leap over something hidden ended.
    var landed = 0xffffffffu;
    loop {
        let t = ray.begin + (f32(k) + 0.5) * ray.step;
        if !(t < ray.end) {
            break;
        }
        let position = start + t * along;
        let brick = clamp(vec3<i32>(floor(position / f32(BRICK))), vec3(0), last_brick);
        let word = distances.word[brick_index(vec3<u32>(brick), bricks)];
        let far = vec2<i32>(distances_of(word));
        let to_opacity = far.x;
        let leap = far.y;
        if leap > 0 && k != landed {
            // To the first sample behind the bricks nearer than `leap`; samples keep their places, so the picture does not
            // change.
            let low = vec3<f32>(brick - leap + 1) * f32(BRICK);
            let high = vec3<f32>(brick + leap) * f32(BRICK);
            let out_low = select((low - start) / along, vec3(1e30), brick < vec3(leap));
            let out_high = select((high - start) / along, vec3(1e30), brick + leap > last_brick);
            // A ray along an axis never leaves through the faces beside it; in their plane the quotient would be 0/0.
            let out = select(select(out_low, out_high, along > vec3(0.0)), vec3(1e30), along == vec3(0.0));
            let t_out = min(out.x, min(out.y, out.z));
            let first = ceil((t_out - ray.begin) / ray.step - 0.5 - LEAP_MARGIN);
            k = max(k + 1u, u32(clamp(first, 0.0, 1e9)));
            if to_opacity < leap {
                // What a clip hides is among what is leapt over: the last sample of it may be the one before a cut.
                k -= 1u;
                landed = k;
            }
            continue;
        }
        k += 1u;
        var value = value_at(position);
        var a = opacity_of(value);
        if a <= 0.0 {
            continue;
        }
        if !visible_to(asked_in(word), eye.origin.xyz + t * ray.direction) {
            hidden = k;
            continue;
        }
        var t_shown = t;
        var shown = position;
        if hidden == k - 1u {
            // The sample after a hidden one stands for the cut between them: it moves there, so that a cut face is shaded at
            // one depth and shows no rings.
            var t_hidden = t - ray.step;
            for (var i = 0u; i < CUT_HALVINGS; i++) {
                let middle = 0.5 * (t_hidden + t_shown);
                if visible(eye.origin.xyz + middle * ray.direction) {
                    t_shown = middle;
                } else {
                    t_hidden = middle;
                }
            }
            shown = start + t_shown * along;
            value = value_at(shown);
            a = opacity_of(value);
        }
        let covered = 1.0 - select(pow(1.0 - a, exponent), 0.0, a >= 1.0);
        colour += (1.0 - alpha) * covered * shaded(shown, value);
        alpha += (1.0 - alpha) * covered;
        if depth == 1.0 && alpha >= 0.5 {
            depth = eye.depth.x + eye.depth.y / t_shown;
        }
        if ends(colour, alpha) {
            break;
        }
    }
    return Pixel(vec4(colour, alpha), clamp(depth, 0.0, 1.0));
}

// The texel of an invocation; outside of the images where there is none. A workgroup takes a tile of one view.
fn texel_of(group: vec3<u32>, local: vec2<u32>) -> vec2<u32> {
    let item = item_of_group(group);
    if item >= params.tiles {
        return params.size;
    }
    let tile = params.first_tile + item;
    let across = (params.size.x + TILE - 1u) / TILE;
    return TILE * vec2(tile % across, tile / across) + local;
}

fn is_inside(texel: vec2<u32>) -> bool {
    return all(texel < vec2(params.size.x, params.rows));
}

// The mean of a pixel's samples, and the depth of the one nearest to its centre.
fn pixel_of(texel: vec2<u32>, view: u32) -> Pixel {
    let centre = vec2<f32>(texel + vec2(0u, params.first_row)) + 0.5;
    var mean = Pixel(vec4(0.0), 1.0);
    for (var i = 0u; i < frame.samples; i++) {
        let pair = frame.places[i / 2u];
        let one = seen(frame.eye[view], centre + select(pair.xy, pair.zw, (i & 1u) == 1u));
        mean.colour += frame.share * one.colour;
        if i == 0u {
            mean.depth = one.depth;
        }
    }
    return mean;
}

@compute @workgroup_size(TILE, TILE)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let texel = texel_of(group, local.xy);
    if is_inside(texel) {
        let pixel = pixel_of(texel, group.z);
        textureStore(colours, texel, group.z, pixel.colour);
        textureStore(depths, texel, group.z, vec4(pixel.depth, 0.0, 0.0, 0.0));
    }
}

@compute @workgroup_size(TILE, TILE)
fn half_floats(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let texel = texel_of(group, local.xy);
    if is_inside(texel) {
        let pixel = pixel_of(texel, group.z);
        textureStore(half_colours, texel, group.z, pixel.colour);
        textureStore(depths, texel, group.z, vec4(pixel.depth, 0.0, 0.0, 0.0));
    }
}
