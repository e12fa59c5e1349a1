// Direction of steepest rise of the values: 3 x 3 x 3 places one voxel apart with weights near Scharr's, each interpolated linearly
// (method.md section 10 has what other filters reach).
//
//   g_x = D(x) S(y) S(z) and so on,   D = [-1 0 1],  S = [1 B 1] / (2 + B)
//
// Interpolation spreads a place over two texels, so that along each axis four take part. In: `volume`, `edge`. Cost: 24 filtered
// reads, or 64 of texels where the filter is too coarse.

// Scharr takes 3.3; this suits places that are interpolated (method.md section 10).
const MIDDLE = 3.0;

// In texels of the volume a voxel.
fn texel_gradient(position: vec3<f32>) -> vec3<f32> {
    // Of a place between four texels of an axis the first two are read at once, and the last two.
    let floored = floor(position);
    let w = position - floored;
    let first = 1.0 + MIDDLE * (1.0 - w);
    let second = 1.0 + MIDDLE * w;
    if params.by_hand == 1u {
        return gradient_by_hand(vec3<i32>(floored), w);
    }
    let low = floored - 1.0 + (w + MIDDLE * (1.0 - w)) / first;
    let high = floored + 1.0 + w / second;
    let share = second / (2.0 + MIDDLE);
    let before = position - 1.0;
    let behind = position + 1.0;
    return vec3(
        face_x(behind.x, low, high, share) - face_x(before.x, low, high, share),
        face_y(behind.y, low, high, share) - face_y(before.y, low, high, share),
        face_z(behind.z, low, high, share) - face_z(before.z, low, high, share),
    );
}

fn texel_between(position: vec3<f32>) -> f32 {
    return textureSampleLevel(volume, edge, (position + 0.5) / frame.dims.xyz, 0.0).r;
}

// S of the two axes beside one, at a place of it.
fn face_x(x: f32, low: vec3<f32>, high: vec3<f32>, share: vec3<f32>) -> f32 {
    return mix(
        mix(texel_between(vec3(x, low.y, low.z)), texel_between(vec3(x, high.y, low.z)), share.y),
        mix(texel_between(vec3(x, low.y, high.z)), texel_between(vec3(x, high.y, high.z)), share.y),
        share.z,
    );
}

fn face_y(y: f32, low: vec3<f32>, high: vec3<f32>, share: vec3<f32>) -> f32 {
    return mix(
        mix(texel_between(vec3(low.x, y, low.z)), texel_between(vec3(high.x, y, low.z)), share.x),
        mix(texel_between(vec3(low.x, y, high.z)), texel_between(vec3(high.x, y, high.z)), share.x),
        share.z,
    );
}

fn face_z(z: f32, low: vec3<f32>, high: vec3<f32>, share: vec3<f32>) -> f32 {
    return mix(
        mix(texel_between(vec3(low.x, low.y, z)), texel_between(vec3(high.x, low.y, z)), share.x),
        mix(texel_between(vec3(low.x, high.y, z)), texel_between(vec3(high.x, high.y, z)), share.x),
        share.y,
    );
}

// The same from texels, each read once: the weights of the four of each axis.
fn gradient_by_hand(floored: vec3<i32>, w: vec3<f32>) -> vec3<f32> {
    let last = vec3<i32>(frame.dims.xyz) - 1;
    let x = clamp(vec4(floored.x) + vec4(-1, 0, 1, 2), vec4(0), vec4(last.x));
    let y = clamp(vec4(floored.y) + vec4(-1, 0, 1, 2), vec4(0), vec4(last.y));
    let z = clamp(vec4(floored.z) + vec4(-1, 0, 1, 2), vec4(0), vec4(last.z));
    let d_z = rises(w.z);
    let s_z = means(w.z);
    let a = slab(x, y, z.x, w);
    let b = slab(x, y, z.y, w);
    let c = slab(x, y, z.z, w);
    let d = slab(x, y, z.w, w);
    return vec3(
        dot(vec4(a.x, b.x, c.x, d.x), s_z),
        dot(vec4(a.y, b.y, c.y, d.y), s_z),
        dot(vec4(a.z, b.z, c.z, d.z), d_z),
    );
}

// Of a plane of texels: D S, S D and S S along x and y.
fn slab(x: vec4<i32>, y: vec4<i32>, z: i32, w: vec3<f32>) -> vec3<f32> {
    let d_x = rises(w.x);
    let s_x = means(w.x);
    let a = texels(x, y.x, z);
    let b = texels(x, y.y, z);
    let c = texels(x, y.z, z);
    let d = texels(x, y.w, z);
    let means_x = vec4(dot(a, s_x), dot(b, s_x), dot(c, s_x), dot(d, s_x));
    let rises_x = vec4(dot(a, d_x), dot(b, d_x), dot(c, d_x), dot(d, d_x));
    return vec3(dot(rises_x, means(w.y)), dot(means_x, rises(w.y)), dot(means_x, means(w.y)));
}

fn texels(x: vec4<i32>, y: i32, z: i32) -> vec4<f32> {
    return vec4(texel_at(x.x, y, z), texel_at(x.y, y, z), texel_at(x.z, y, z), texel_at(x.w, y, z));
}

fn rises(w: f32) -> vec4<f32> {
    return vec4(w - 1.0, -w, 1.0 - w, w);
}

fn means(w: f32) -> vec4<f32> {
    return vec4(1.0 - w, w + MIDDLE * (1.0 - w), 1.0 - w + MIDDLE * w, w) / (2.0 + MIDDLE);
}
