// What a device's filter makes of two texels of 8 bits that differ by the least that they can.

struct Found {
    value: array<f32, STEPS>,
}

@group(0) @binding(0) var texels: texture_3d<f32>;
@group(0) @binding(1) var linear: sampler;
@group(0) @binding(2) var<storage, read_write> found: Found;

// From the middle of the one texel to that of the other.
const STEPS = 64u;

@compute @workgroup_size(STEPS)
fn main(@builtin(local_invocation_index) lane: u32) {
    let x = 0.25 + 0.5 * f32(lane) / f32(STEPS);
    found.value[lane] = textureSampleLevel(texels, linear, vec3(x, 0.5, 0.5), 0.0).r;
}
