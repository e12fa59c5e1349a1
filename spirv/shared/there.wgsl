// What of a triangle a ray can hit: what its mask and the clips leave. Kernels bind `clips`, `layers`, and what `surface.wgsl` asks for.

#include "shared/surface.wgsl"
#include "shared/clips.wgsl"

fn is_there(index: u32, triangle: WorldTriangle, at: vec2<f32>) -> bool {
    if (u32(triangle.c.w) & MASKED) == 0u {
        return true;
    }
    let material = materials.material[u32(triangle.b.w)];
    return material.colour.a * texture_at(material, uv_at(looks.triangle[index], at)).a >= material.cutoff;
}

// Whether clips leave a place of a triangle.
fn is_left(triangle: WorldTriangle, place: vec3<f32>) -> bool {
    return (u32(triangle.c.w) & SPARED) != 0u || visible(place);
}
