// What both kernels know.

// Bits, the first of eight.
const CHANGED = 256u;
// All of them; a [reference] and a <tag> to nowhere.
const ALL_CHANGED = 255u * CHANGED;

struct Inner {
    direction: vec3<f32>,
    count: u32,
    // x, y
    place: vec2<u32>,
}

// No buffer holds it.
struct Local {
    x: f32,
}
