// What the image-space methods share: depths of places, accessibility a pixel, and patterns of samples without tables.
// Whoever includes this binds `geometry`.

#include "shared/accessibility.wgsl"
#include "shared/geometry.wgsl"
#include "shared/hash.wgsl"

const TAU = 6.28318530718;

// 2^32 / the golden ratio: its multiples are spread evenly over the whole numbers, however many there are.
const GOLDEN = 0x9e3779b9u;

// The view depth in mm that a place of a view's image shows, in pixels; 0 where nothing is, and outside of the image.
fn depth_at(size: vec2<u32>, view: u32, place: vec2<f32>) -> f32 {
    // Written so that a place that is no number is outside.
    if !(all(place >= vec2(0.0)) && all(place < vec2<f32>(size))) {
        return 0.0;
    }
    return geometry.pixel[pixel_index(size, view, vec2<u32>(place))].w;
}

// The angle of a share of a turn, in 2^32ths, in −π … π.
fn angle_of(turn: u32) -> f32 {
    return (f32(turn >> 8u) / 16777216.0 - 0.5) * TAU;
}
