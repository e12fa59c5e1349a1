// Every layout that WGSL pads and Rust does not, and every kind of constant.

#include "shared/outer.wgsl"

const STEP = 8;
const BELOW: i32 = -STEP - 1;
// In radians,
// all the way round.
const TURN = 2.0 * 3.14159265;
const TINY = 1e-6;
const MASK = ~0u;
const WIDE = ALL_CHANGED > 4u;
const TILE = vec2(8u, 4u);
const MIXED = vec4(vec2(1.0, 2.0), vec2(3.0));
const ZERO = vec3<i32>();
const OFFSETS = array(vec3(0.5), vec3(1.0, 2.0, 3.0));
const SCALED = mat2x2(TURN, 0.0, 0.0, 1.0);
const LOCAL = Local(1.0);

// Of all kinds.
struct Awkward {
    // no gap behind it
    normal: vec3<f32>,
    weight: f32,
    centre: vec3<f32>,
    size: vec2<u32>,
    corner: vec3<i32>,
    points: array<vec3<f32>, 2>,
    inner: Inner,
    turn: mat3x3<f32>,
    view: mat4x4<f32>,
    narrow: mat2x2<f32>,
    pad: u32,
    in: u32,
    @align(32) far: f32,
    many: array<vec4<f32>, 54>,
}

struct Counted {
    total: atomic<u32>,
    parts: array<Inner>,
}

struct Words {
    word: array<u32>,
}

// What there is to do.
@group(0) @binding(0) var<uniform> awkward: Awkward;
@group(0) @binding(1) var<storage, read_write> counted: Counted;
@group(0) @binding(2) var<storage, read> outer: Outer;
@group(0) @binding(3) var volume: texture_3d<f32>;
@group(0) @binding(4) var linear: sampler;
@group(0) @binding(5) var<storage, read_write> words: Words;

@compute @workgroup_size(4, 4, 2)
fn main() {
    atomicAdd(&counted.total, awkward.in + outer.inner[0].count);
    words.word[0] = u32(textureSampleLevel(volume, linear, vec3(0.0), 0.0).r);
}

@compute @workgroup_size(64)
fn list_words() {
    words.word[1] = CHANGED;
}

@compute @workgroup_size(32)
fn clear_words() {
    words.word[2] = 0u;
}

@compute @workgroup_size(1)
fn nothing() {
}
