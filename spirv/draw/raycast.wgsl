// Stage 6 of CAO section 3.5: the volume by ray casting, all views in one dispatch. Front to back, a segment between two samples at a time,
// through which the value is taken as linear and its opacity integrated exactly; steps halve where a segment's opacity says little of its
// parts. Leaps over bricks that show nothing, clipped parts skipped by the shadow test of section 3.2, ambient factor from V_AO in front of
// where a segment's light comes from.
//
// With features, `featured`, the volume is that of opacities after features and the transfer function says that its values are opacities, so
// that voxels are classified first and interpolated then (`features.wgsl`). Colours are those of features, and where a clip hides a place,
// what of it belongs to a feature that clips leave whole is there all the same.
//
// `coloured`: V_AO has red, green and blue (method.md section 2.1).

#include "shared/transfer.wgsl"

@group(0) @binding(0) var volume: texture_3d<f32>;
@group(0) @binding(3) var ambient: texture_3d<f32>;
// linear, continued from the edge
@group(0) @binding(5) var edge: sampler;
@group(0) @binding(6) var<uniform> frame: Frame;
@group(0) @binding(7) var<storage, read> distances: Distances;
@group(0) @binding(8) var<storage, read> clips: Clips;
@group(0) @binding(9) var<storage, read> layers: Layers;
@group(0) @binding(2) var<storage, read> bounds: Bounds;
// with features only: the values of the volume, which voxel is whose, and how that is shown
@group(0) @binding(13) var values: texture_3d<f32>;
@group(0) @binding(14) var feature_index: texture_3d<u32>;
@group(0) @binding(15) var<uniform> features: Features;

// a layer a view: premultiplied, linear; depth by the view's planes, and before where rays end, see `ended`
@group(0) @binding(10) var colours: texture_storage_2d_array<rgba32float, write>;
@group(0) @binding(11) var depths: texture_storage_2d_array<r32float, read_write>;
// the colours of `half_floats`: WGSL states a storage image's format, so that each has an entry point
@group(0) @binding(12) var half_colours: texture_storage_2d_array<rgba16float, write>;

#include "shared/bounds.wgsl"
#include "shared/spared.wgsl"
#include "shared/bricks.wgsl"
#include "shared/clips.wgsl"
#include "shared/distances.wgsl"
#include "shared/eyes.wgsl"
#include "shared/air.wgsl"

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
    // 1: `depths` holds at which depth in mm a pixel's rays end at the latest
    ended: u32,
    // 1: V_AO has the values of features side by side
    channels: u32,
}

struct Pixel {
    // premultiplied, linear
    colour: vec4<f32>,
    depth: f32,
}

var<immediate> params: RaycastParams;

// Pixels along the edge of a workgroup's tile: its rays read nearly the same bricks.
const TILE = 8u;

// Part of a step by which a leap ends early: more than rounding moves a sample, so that none behind it is left out.
const LEAP_MARGIN = 0.1;

// Halvings of a step at a cut: the depth of a face errs by less than 1/256 of it.
const CUT_HALVINGS = 8u;

// Parts that a step can be halved into.
const PARTS = 16u;

// Light is found for stretches of so many steps, at most a voxel, or that stop this share of a pixel's light.
const STEPS_LIT = 4.0;
const MOST_LIT = 0.125;

// A step is halved if it stops more than this share of a pixel's light, and this share more or less than it would if all of it were as one
// of its ends.
const MOST_CHANGE = 0.125;

// Whether clips hide the place that is looked at, so that only what they leave whole counts.
var<private> only_spared = false;

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

// The same of a volume with features, of those voxels that clips leave whole.
fn kept_at(position: vec3<f32>) -> f32 {
    let last = frame.dims.xyz - 1.0;
    let at = clamp(position, vec3(0.0), last);
    let l = vec3<i32>(at);
    let w = at - vec3<f32>(l);
    var sum = 0.0;
    for (var i = 0u; i < 8u; i++) {
        let up = vec3(i & 1u, i >> 1u & 1u, i >> 2u) == vec3(1u);
        let voxel = min(l + select(vec3(0), vec3(1), up), vec3<i32>(last));
        if is_spared(vec3<u32>(voxel)) {
            let weights = select(1.0 - w, w, up);
            sum += weights.x * weights.y * weights.z * textureLoad(volume, voxel, 0).r;
        }
    }
    return sum;
}

fn value_at(position: vec3<f32>) -> f32 {
    var texel = 0.0;
    if only_spared {
        return kept_at(position);
    }
    if params.by_hand == 1u {
        texel = interpolated(position);
    } else {
        texel = textureSampleLevel(volume, edge, (position + 0.5) / frame.dims.xyz, 0.0).r;
    }
    return texel * frame.scale + frame.bias;
}

// Direction of steepest rise of the values; of what clips leave, by the same filter, place by place.
fn rise_at(position: vec3<f32>) -> vec3<f32> {
    if !only_spared {
        return texel_gradient(position);
    }
    var rise = vec3(0.0);
    for (var i = 0u; i < 27u; i++) {
        let step = vec3<f32>(vec3(i % 3u, i / 3u % 3u, i / 9u)) - 1.0;
        let weight = select(vec3(1.0), vec3(MIDDLE), step == vec3(0.0));
        rise += step * weight.yzx * weight.zxy * kept_at(position + step);
    }
    return rise;
}

#include "shared/shading.wgsl"
#include "shared/feature_colour.wgsl"

// Whether the rest of a ray's light cannot change a pixel of the picture by more than the frame's tolerance. It adds at most its share of
// the brightest light to a component, or takes as much of a background; sRGB coding spreads that by its slope, which is largest at the
// darkest component so far (12.92 at 0, 1.055/2.4 c^(-7/12) above).
fn ends(colour: vec3<f32>, rest: f32) -> bool {
    // The slope at 1 is the least.
    if rest * 0.4396 > frame.remainder {
        return false;
    }
    let darkest = clamp(min(colour.r, min(colour.g, colour.b)), 0.003, 1.0);
    return rest * min(12.92, 0.4396 * pow(darkest, -7.0 / 12.0)) <= frame.remainder;
}

// The brick that a sample reads.
fn brick_of(position: vec3<f32>, bricks: vec3<u32>) -> vec3<u32> {
    return vec3<u32>(clamp(vec3<i32>(floor(position / f32(BRICK))), vec3(0), vec3<i32>(bricks) - 1));
}

// Which clips may hide something there.
fn asked_at(position: vec3<f32>, bricks: vec3<u32>) -> u32 {
    return asked_in(distances.word[brick_index(brick_of(position, bricks), bricks)]);
}

// A value, its piece of the transfer function and its opacity.
struct Sample {
    value: f32,
    piece: u32,
    opacity: f32,
}

fn sample_of(value: f32) -> Sample {
    let piece = piece_of(value);
    return Sample(value, piece, opacity_in(piece, value));
}

// What a segment of a ray adds in front of black.
struct Segment {
    // the share of light that it stops
    alpha: f32,
    // that share of its colours, unlit
    colour: vec3<f32>,
    // where its light comes from: share of its length
    centre: f32,
}

// Optical depth of a reference length along which the opacity goes evenly from a to b: the mean of -ln(1 - x) over [a, b].
fn mean_depth(a: f32, b: f32) -> f32 {
    let u = 1.0 - a;
    let v = 1.0 - b;
    let middle = 0.5 * (u + v);
    let width = v - u;
    if abs(width) <= 0.2 * middle {
        // In closed form its digits cancel; here the next term of the series is below 1e-5.
        return -log(middle) + width * width / (24.0 * middle * middle);
    }
    // Where nothing passes, x ln x is 0.
    return 1.0 - (select(v * log(v), 0.0, v <= 0.0) - select(u * log(u), 0.0, u <= 0.0)) / width;
}

// Of a stretch along which opacity goes evenly from a to b, one of them above 0: the share of light that passes, and the share of its
// length at which the light that it sends leaves it, on average.
fn piece(a: f32, b: f32, length: f32) -> vec2<f32> {
    let stops = min(a, b) >= 1.0;
    let depth = length * mean_depth(a, b);
    let passes = select(exp(-depth), 0.0, stops);
    // Of an even stretch; and how much later where opacity rises.
    let even = select(1.0 / depth - passes / (1.0 - passes), 0.5 - depth / 12.0, depth < 0.05);
    let later = passes * (b - a) / (6.0 * (b + a));
    return vec2(passes, select(even + later, 0.0, stops));
}

// Between two samples, `length` reference lengths apart: piece by piece of the transfer function.
fn segment(near: Sample, far: Sample, length: f32) -> Segment {
    let up = far.value >= near.value;
    let whole = far.value - near.value;
    var open = 1.0;
    var colour = vec3(0.0);
    var centre = 0.0;
    var here = near;
    var begun = 0.0;
    loop {
        let last = here.piece == far.piece;
        // Up to the next control point; in the last piece it does not count.
        let point = transfer.opacity[select(max(here.piece, 1u) - 1u, min(here.piece, MOST_POINTS - 1u), up)];
        let value = select(point.x, far.value, last);
        let opacity = select(point.y, far.opacity, last);
        let done = select(clamp((value - near.value) / whole, begun, 1.0), 1.0, last);
        if max(here.opacity, opacity) > 0.0 && done > begun {
            let found = piece(here.opacity, opacity, length * (done - begun));
            let passes = found.x;
            let within = found.y;
            let share = open * (1.0 - passes);
            colour += share * colour_of(mix(here.value, value, within));
            centre += share * mix(begun, done, within);
            open *= passes;
        }
        if last || open <= 0.0 {
            break;
        }
        begun = done;
        let piece = select(here.piece - 1u, here.piece + 1u, up);
        here = Sample(value, piece, transfer.opacity[select(piece, piece - 1u, up)].y);
    }
    let alpha = 1.0 - open;
    return Segment(alpha, colour, select(0.5, centre / alpha, alpha > 0.0));
}

// Two segments of a volume with features, one behind the other, as one, the first of which has a share of the length.
fn joined(a: Segment, b: Segment, share: f32) -> Segment {
    let behind = (1.0 - a.alpha) * b.alpha;
    let alpha = a.alpha + behind;
    let centre = a.alpha * a.centre * share + behind * mix(share, 1.0, b.centre);
    return Segment(alpha, vec3(0.0), select(0.5, centre / alpha, alpha > 0.0));
}

// Whether a step has to be halved, through which `open` of the light comes to the eye: its opacity is not that of its ends, because a
// surface is in it, and matters.
fn varies(found: Segment, near: Sample, far: Sample, length: f32, open: f32) -> bool {
    if open * found.alpha <= MOST_CHANGE {
        return false;
    }
    let passes = 1.0 - vec2(near.opacity, far.opacity);
    let ends = 1.0 - select(pow(passes, vec2(length)), vec2(0.0), passes <= vec2(0.0));
    return any(open * abs(ends - found.alpha) > vec2(MOST_CHANGE));
}

// View depths, a hidden and a visible one, between which a clip cuts the ray: the last halves of these.
fn cut_between(sides: vec2<f32>, eye: Eye, direction: vec3<f32>) -> vec2<f32> {
    var found = sides;
    for (var i = 0u; i < CUT_HALVINGS; i++) {
        let middle = 0.5 * (found.x + found.y);
        if visible(eye.origin.xyz + middle * direction) {
            found.y = middle;
        } else {
            found.x = middle;
        }
    }
    return found;
}

// The part of a ray that passes what can be seen: how many whole steps lie before it, and the depth at its end. A step and more is left
// on each side: what comes before a cut counts too, and rounding does not.
fn shown_part(ray: Ray, bricks: vec3<u32>) -> vec2<f32> {
    let first = bricks - vec3(bounds.from_first[0], bounds.from_first[1], bounds.from_first[2]);
    let end = vec3(bounds.to_last[0], bounds.to_last[1], bounds.to_last[2]);
    if end.x == 0u {
        return vec2(0.0, ray.begin);
    }
    // Bricks at the volume's faces reach to them, half a voxel further than their voxels' centres.
    let low = vec3<f32>(first * BRICK) - 1.0;
    let high = vec3<f32>(end * BRICK);
    let part = crossing(ray.start, ray.along, low, high);
    return vec2(clamp(floor((part.x - ray.begin) / ray.step - 1.5), 0.0, 1e8), min(ray.end, part.y + ray.step));
}

// A segment of a volume with features, whose values are opacities. Its colour is found where it is lit.
fn segment_of_features(near: f32, far: f32, length: f32) -> Segment {
    if max(near, far) <= 0.0 || length <= 0.0 {
        return Segment(0.0, vec3(0.0), 0.5);
    }
    let found = piece(near, far, length);
    return Segment(1.0 - found.x, vec3(0.0), found.y);
}

// A value as it is, of a volume with features.
fn opacity_sample(opacity: f32) -> Sample {
    return Sample(opacity, 1u, opacity);
}

// What an eye sees at a place in pixels, up to a view depth. `featured`: of a volume with features; `coloured`: of V_AO in coloured light.
fn seen(eye: Eye, place: vec2<f32>, end: f32, featured: bool, coloured: bool) -> Pixel {
    let ray = ray_through(eye, place / vec2<f32>(params.size));
    let start = ray.start;
    let along = ray.along;
    let part = ray.step / f32(PARTS);
    // mm of way a mm of view depth
    let slant = frame.spacing.w / ray.step;
    // Parts of a stretch: whole steps, so that rounding does not decide.
    let stretch = PARTS * u32(clamp(smallest_spacing() / frame.spacing.w + 0.01, 1.0, STEPS_LIT));
    let bricks = bricks_of(vec3<u32>(frame.dims.xyz));
    // Whether something of what clips hide is there all the same.
    let spares = featured && features.any_spared == 1u;

    var colour = vec3(0.0);
    var alpha = 0.0;
    // Reversed depths are larger nearby.
    let nothing = select(1.0, 0.0, eye.depth.y > 0.0);
    var depth = nothing;
    // Parts of steps so far, integers so that samples keep their places whatever is leapt over; and how many the next step has.
    var shown = shown_part(ray, bricks);
    shown.y = min(shown.y, end);
    var n = PARTS * u32(shown.x);
    var size = PARTS;
    // Before this one samples are known to be in what the ray looked at last.
    var n_out = 0u;
    // Value at n. After a leap, and at first, it is not known.
    var here = 0.0;
    var known = false;
    // The clip of the last cut, and the depth at which the ray came out of it.
    var cut = NO_CLIP;
    var t_cut = 0.0;
    var over = false;
    // Whether clips show the place at asked_n.
    var asked_n = ~0u;
    var shown_from = false;
    // Of the stretch that is not lit yet: where it begins, what passes, the colours that it stops, and depth and value, each times the
    // share that is stopped there.
    var first = 0u;
    var open = 1.0;
    var tint = vec3(0.0);
    var centre = vec2(0.0);
    loop {
        // A stretch at a time, so that neighbouring rays are lit together whatever they have passed.
        loop {
            var t = ray.begin + f32(n) * part;
            over = !(t < shown.y);
            let covered = (1.0 - alpha) * (1.0 - open);
            let full = n % PARTS == 0u && (covered > MOST_LIT || n - first >= stretch);
            // What is left out of a stretch also moves the place where it is lit: by its share of a voxel, over which light changes by less
            // than all of it.
            if over || open < 1.0 && (full || ends(colour, 2.0 * (1.0 - alpha) * open)) {
                break;
            }
            if n >= n_out && size == PARTS {
                let position = start + t * along;
                let brick = vec3<i32>(brick_of(position, bricks));
                let leap = i32(distance_in(distances.word[brick_index(vec3<u32>(brick), bricks)]));
                // To the last sample before the bricks that are not nearer than `leap`, or out of this one.
                let way = max(leap, 1);
                let faces = vec3<f32>(select(brick - way + 1, brick + way, along > vec3(0.0)) * i32(BRICK));
                // A ray along an axis never leaves through the faces beside it; in their plane the quotient would be 0/0.
                let out = select((faces - start) / along, vec3(1e30), along == vec3(0.0));
                let t_out = min(out.x, min(out.y, out.z));
                let last = PARTS * u32(clamp(floor((t_out - ray.begin) / ray.step - LEAP_MARGIN), 0.0, 1e8));
                // A leap ends where the next brick is looked at; in a brick that shows something, behind it.
                n_out = last + 1u;
                if leap > 0 && last > n {
                    n = last;
                    t = ray.begin + f32(n) * part;
                    known = false;
                }
            }
            let t_next = select(t, min(ray.begin + f32(n + size) * part, shown.y), known);
            let next = value_at(start + t_next * along);
            // Whether any value between has opacity.
            if known && max(here, next) > transfer.least && min(here, next) < transfer.most {
                var t_from = t;
                var t_to = t_next;
                var near = here;
                var far = next;
                var shows = true;
                var shown_to = true;
                // At a cut: depths on its two sides, the hidden one first.
                var sides = vec2(t);
                if clips.count > 0u {
                    // A place is asked once, though two segments meet there.
                    if asked_n != n {
                        shown_from = visible_to(asked_at(start + t * along, bricks), eye.origin.xyz + t * ray.direction);
                    }
                    shown_to = visible_to(asked_at(start + t_next * along, bricks), eye.origin.xyz + t_next * ray.direction);
                    shows = shown_from || shown_to;
                    if shown_from != shown_to {
                        // Only the part on one side of the cut shows.
                        sides = cut_between(select(vec2(t_next, t), vec2(t, t_next), shown_to), eye, ray.direction);
                        let at_cut = value_at(start + sides.y * along);
                        if shown_to {
                            t_from = sides.y;
                            near = at_cut;
                            cut = hiding(ALL_CLIPS, eye.origin.xyz + sides.x * ray.direction);
                            t_cut = sides.y;
                        } else {
                            t_to = sides.y;
                            far = at_cut;
                        }
                    }
                }
                // Of what clips hide only what they leave whole counts.
                let halves = shown_from != shown_to && clips.count > 0u;
                var kept = Segment(0.0, vec3(0.0), 0.5);
                var kept_ends = vec2(0.0);
                if spares && clips.count > 0u && !(shown_from && shown_to) {
                    let t_ends = vec2(select(t, sides.x, shown_from), select(t_next, sides.x, shown_to));
                    kept_ends = vec2(kept_at(start + t_ends.x * along), kept_at(start + t_ends.y * along));
                    kept = segment_of_features(kept_ends.x, kept_ends.y, (t_ends.y - t_ends.x) * slant / frame.light.w);
                }
                if shows || kept.alpha > 0.0 {
                    var found = kept;
                    var from_sample = opacity_sample(kept_ends.x);
                    var to_sample = opacity_sample(kept_ends.y);
                    // in reference lengths
                    var length = (t_to - t_from) * slant / frame.light.w;
                    if !featured {
                        from_sample = sample_of(near);
                        to_sample = sample_of(far);
                        found = segment(from_sample, to_sample, length);
                    } else if shows {
                        let open_part = segment_of_features(near, far, length);
                        found = open_part;
                        if spares && halves {
                            let share = (sides.x - t) / (t_next - t);
                            if shown_from {
                                found = joined(open_part, kept, share);
                                far = kept_ends.y;
                            } else {
                                found = joined(kept, open_part, share);
                                near = kept_ends.x;
                            }
                            t_from = t;
                            t_to = t_next;
                            length = (t_to - t_from) * slant / frame.light.w;
                        }
                        from_sample = opacity_sample(near);
                        to_sample = opacity_sample(far);
                    } else {
                        near = kept_ends.x;
                        far = kept_ends.y;
                    }
                    if size > 1u && varies(found, from_sample, to_sample, length, open * (1.0 - alpha)) {
                        size /= 2u;
                        asked_n = n;
                        continue;
                    }
                    if open == 1.0 {
                        first = n;
                    }
                    tint += open * found.colour;
                    centre += open * found.alpha * vec2(mix(t_from, t_to, found.centre), mix(near, far, found.centre));
                    open *= 1.0 - found.alpha;
                }
                shown_from = shown_to;
                asked_n = n + size;
            }
            here = next;
            if known {
                n += size;
                size = min(min(2u * size, PARTS), n & (~n + 1u));
            }
            known = true;
        }
        if open == 1.0 {
            break;
        }
        // It is lit where its light comes from.
        let stops = 1.0 - open;
        let t_shown = centre.x / stops;
        if spares && clips.count > 0u {
            only_spared = !visible_to(asked_at(start + t_shown * along, bricks), eye.origin.xyz + t_shown * ray.direction);
        }
        var unlit = tint / stops;
        if featured {
            let owner = owner_of(start + t_shown * along);
            unlit = colour_by(owner);
            if params.channels == 1u {
                // With more features than channels all of them hold the same.
                channel = select((owner.light - 1u) % LEAST, GREATEST, owner.light == 0u);
            }
        }
        let at = Shown(
            start + t_shown * along,
            eye.origin.xyz + t_shown * ray.direction,
            centre.y / stops,
            unlit,
            // What clips leave whole they do not cut.
            select(cut, NO_CLIP, only_spared),
            (t_shown - t_cut) * slant,
        );
        colour += (1.0 - alpha) * stops * shaded(at, ray.direction, coloured);
        only_spared = false;
        alpha += (1.0 - alpha) * stops;
        if depth == nothing && alpha >= 0.5 {
            depth = eye.depth.x + eye.depth.y / t_shown;
        }
        if over || ends(colour, 1.0 - alpha) {
            break;
        }
        open = 1.0;
        tint = vec3(0.0);
        centre = vec2(0.0);
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
fn pixel_of(texel: vec2<u32>, view: u32, featured: bool, coloured: bool) -> Pixel {
    let centre = vec2<f32>(texel + vec2(0u, params.first_row)) + 0.5;
    var end = 3e38;
    if params.ended == 1u {
        end = textureLoad(depths, texel, view).r;
    }
    var mean = Pixel(vec4(0.0), 1.0);
    for (var i = 0u; i < frame.samples; i++) {
        let pair = frame.places[i / 2u];
        let one = seen(frame.eye[view], centre + select(pair.xy, pair.zw, (i & 1u) == 1u), end, featured, coloured);
        mean.colour += frame.share * one.colour;
        if i == 0u {
            mean.depth = one.depth;
        }
    }
    return mean;
}

// A texel of single floats, and one of half floats. `featured`, `coloured`: as `seen` has them.
fn write_floats(group: vec3<u32>, local: vec2<u32>, featured: bool, coloured: bool) {
    let texel = texel_of(group, local);
    if is_inside(texel) {
        let pixel = pixel_of(texel, group.z, featured, coloured);
        textureStore(colours, texel, group.z, pixel.colour);
        textureStore(depths, texel, group.z, vec4(pixel.depth, 0.0, 0.0, 0.0));
    }
}

fn write_halves(group: vec3<u32>, local: vec2<u32>, featured: bool, coloured: bool) {
    let texel = texel_of(group, local);
    if is_inside(texel) {
        let pixel = pixel_of(texel, group.z, featured, coloured);
        textureStore(half_colours, texel, group.z, pixel.colour);
        textureStore(depths, texel, group.z, vec4(pixel.depth, 0.0, 0.0, 0.0));
    }
}

@compute @workgroup_size(TILE, TILE)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    write_floats(group, local.xy, false, false);
}

@compute @workgroup_size(TILE, TILE)
fn half_floats(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    write_halves(group, local.xy, false, false);
}

@compute @workgroup_size(TILE, TILE)
fn featured(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    write_floats(group, local.xy, true, false);
}

@compute @workgroup_size(TILE, TILE)
fn featured_half_floats(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    write_halves(group, local.xy, true, false);
}

@compute @workgroup_size(TILE, TILE)
fn coloured(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    write_floats(group, local.xy, false, true);
}

@compute @workgroup_size(TILE, TILE)
fn coloured_half_floats(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    write_halves(group, local.xy, false, true);
}

@compute @workgroup_size(TILE, TILE)
fn featured_coloured(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    write_floats(group, local.xy, true, true);
}

@compute @workgroup_size(TILE, TILE)
fn featured_coloured_half_floats(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    write_halves(group, local.xy, true, true);
}
