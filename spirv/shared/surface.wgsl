// What a place of a triangle looks like, and whether its mask leaves it. Kernels bind `looks`, `materials` and `texels`.

#include "shared/world.wgsl"

// A unit vector of two 16-bit numbers (Meyer 2010): the octahedron unfolded.
fn normal_of(packed: u32) -> vec3<f32> {
    let at = unpack2x16snorm(packed);
    let z = 1.0 - abs(at.x) - abs(at.y);
    let under = max(-z, 0.0);
    let xy = at - select(vec2(-under), vec2(under), at >= vec2(0.0));
    return normalize(vec3(xy, z));
}

// Of corners' numbers, that at the weights of the second and the third.
fn uv_at(look: Look, at: vec2<f32>) -> vec2<f32> {
    return look.uv_a * (1.0 - at.x - at.y) + look.uv_b * at.x + look.uv_c * at.y;
}

fn texel_at(material: SurfaceMaterial, x: i32, y: i32) -> vec4<f32> {
    let width = i32(material.width);
    let height = i32(material.height);
    let wrapped = vec2((x + width) % width, (y + height) % height);
    return unpack4x8unorm(texels.texel[material.texture_at + u32(wrapped.y * width + wrapped.x)]);
}

// Colour as coded and opacity, bilinear between the four nearest texels, repeated; white without a texture.
fn texture_at(material: SurfaceMaterial, uv: vec2<f32>) -> vec4<f32> {
    if material.width == 0u {
        return vec4(1.0);
    }
    let place = fract(uv) * vec2(f32(material.width), f32(material.height)) - 0.5;
    let first = floor(place);
    let share = place - first;
    let x = i32(first.x);
    let y = i32(first.y);
    let above = mix(texel_at(material, x, y), texel_at(material, x + 1, y), share.x);
    let below = mix(texel_at(material, x, y + 1), texel_at(material, x + 1, y + 1), share.x);
    return mix(above, below, share.y);
}
