// As air.wgsl, of V_AO in coloured light: red, green and blue, each as it is there; the way out of the surface is along the rise of their
// mean. Cost: as there.

fn colours_between(position: vec3<f32>) -> vec3<f32> {
    return textureSampleLevel(ambient, edge, (position + 0.5) / frame.dims.xyz, 0.0).rgb;
}

fn colours_at(x: i32, y: i32, z: i32) -> vec3<f32> {
    return textureLoad(ambient, vec3(x, y, z), 0).rgb;
}

// Of two voxels side by side along x: `risen` in place of what holds 1.
fn colours_beside(risen: vec3<f32>, one: vec3<f32>, other: vec3<f32>, share: f32) -> vec3<f32> {
    return mix(select(one, risen, one >= vec3(1.0)), select(other, risen, other >= vec3(1.0)), share);
}

fn coloured_ambient_at(place: vec3<f32>) -> vec3<f32> {
    let position = round(place * 256.0) / 256.0;
    let x = vec3(1.0, 0.0, 0.0);
    let voxel = min(frame.spacing.x, min(frame.spacing.y, frame.spacing.z)) / frame.spacing.xyz;
    // A column an axis, red, green and blue of each.
    let rise = mat3x3(
        0.5 * voxel.x * (colours_between(position + x.xyy) - colours_between(position - x.xyy)),
        0.5 * voxel.y * (colours_between(position + x.yxy) - colours_between(position - x.yxy)),
        0.5 * voxel.z * (colours_between(position + x.yyx) - colours_between(position - x.yyx)),
    );
    let mean = vec3(1.0 / 3.0) * rise;
    let out = mean / max(length(mean), LEAST_RISE);
    let risen = min(colours_between(position) + rise * out, vec3(1.0));
    let air = position + voxel * out;
    let last = vec3<i32>(frame.dims.xyz) - 1;
    let l = clamp(vec3<i32>(floor(air)), vec3(0), last);
    let h = clamp(vec3<i32>(floor(air)) + 1, vec3(0), last);
    let w = fract(air);
    let low = mix(
        colours_beside(risen, colours_at(l.x, l.y, l.z), colours_at(h.x, l.y, l.z), w.x),
        colours_beside(risen, colours_at(l.x, h.y, l.z), colours_at(h.x, h.y, l.z), w.x),
        w.y,
    );
    let high = mix(
        colours_beside(risen, colours_at(l.x, l.y, h.z), colours_at(h.x, l.y, h.z), w.x),
        colours_beside(risen, colours_at(l.x, h.y, h.z), colours_at(h.x, h.y, h.z), w.x),
        w.y,
    );
    return mix(low, high, w.z);
}
