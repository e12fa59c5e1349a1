// The ambient factor that a place of a ray shows: of the air in front of its surface, V_AO a voxel h out along its own rise.
//
//   A(x) = sum w V'        over the eight voxels round y = x + h g / max(|g|, LEAST_RISE),   g = change of V_AO a length h at x
//
// w are linear weights; V' is V_AO, but of voxels that hold 1, as those do that need no value (method.md section 5.3), what V_AO
// and g at x make of y: so nothing jumps where a moving clip takes a voxel its value. At the place itself a wall's own
// matter takes a part of its light that edges do not lose (method.md section 10). In: index position, `ambient`,
// `edge`, `frame`. Cost: 7 filtered reads and 8 of texels.

// Rise a voxel below which the way out shortens, to none where there is no surface. At a wall it is 0.2 and more.
const LEAST_RISE = 0.1;

// Which channel of V_AO is read: of values of features side by side (fdao.wgsl) that of the feature of the place that is looked at; or LEAST,
// the least of four; or GREATEST, which is 1 where there is no matter of one of four features, and of every other rule the voxel's value.
var<private> channel = 0u;
const LEAST = 4u;
const GREATEST = 5u;

fn channel_of(texel: vec4<f32>) -> f32 {
    if channel >= LEAST {
        let low = min(texel.xy, texel.zw);
        let high = max(texel.xy, texel.zw);
        return select(max(high.x, high.y), min(low.x, low.y), channel == LEAST);
    }
    return dot(texel, vec4<f32>(vec4(channel) == vec4(0u, 1u, 2u, 3u)));
}

// The field itself, ones included: they are out of the matter.
fn ambient_between(position: vec3<f32>) -> f32 {
    return channel_of(textureSampleLevel(ambient, edge, (position + 0.5) / frame.dims.xyz, 0.0));
}

// The air in front of a place: its index coordinates, and V_AO there by how it rises at the place.
fn air_of(position: vec3<f32>) -> vec4<f32> {
    let x = vec3(1.0, 0.0, 0.0);
    let voxel = min(frame.spacing.x, min(frame.spacing.y, frame.spacing.z)) / frame.spacing.xyz;
    let rise = 0.5 * voxel * vec3(
        ambient_between(position + x.xyy) - ambient_between(position - x.xyy),
        ambient_between(position + x.yxy) - ambient_between(position - x.yxy),
        ambient_between(position + x.yyx) - ambient_between(position - x.yyx),
    );
    let out = rise / max(length(rise), LEAST_RISE);
    return vec4(position + voxel * out, min(ambient_between(position) + dot(rise, out), 1.0));
}

fn factor_at(x: i32, y: i32, z: i32) -> f32 {
    return channel_of(textureLoad(ambient, vec3(x, y, z), 0));
}

// Rounded to 1/256 voxel: the field itself, sampled on a finer lattice than the voxels'. The two eyes' rays meet a point with
// different rounding, far less than that, so that both read the very same bits at every point but those on a border between
// two such cells (about 0.3 % of arbitrary points); there they read values 1/256 voxel apart, which differ by the field's
// change over that way.
fn ambient_at(position: vec3<f32>) -> f32 {
    let air = air_of(round(position * 256.0) / 256.0);
    let last = vec3<i32>(frame.dims.xyz) - 1;
    let l = clamp(vec3<i32>(floor(air.xyz)), vec3(0), last);
    let h = clamp(vec3<i32>(floor(air.xyz)) + 1, vec3(0), last);
    let w = fract(air.xyz);
    let low = vec4(factor_at(l.x, l.y, l.z), factor_at(h.x, l.y, l.z), factor_at(l.x, h.y, l.z), factor_at(h.x, h.y, l.z));
    let high = vec4(factor_at(l.x, l.y, h.z), factor_at(h.x, l.y, h.z), factor_at(l.x, h.y, h.z), factor_at(h.x, h.y, h.z));
    let across = vec4((1.0 - w.x) * (1.0 - w.y), w.x * (1.0 - w.y), (1.0 - w.x) * w.y, w.x * w.y);
    let risen_low = select(low, vec4(air.w), low >= vec4(1.0));
    let risen_high = select(high, vec4(air.w), high >= vec4(1.0));
    return mix(dot(across, risen_low), dot(across, risen_high), w.z);
}
