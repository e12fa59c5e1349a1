// The colour of a place of a volume with features: that of the feature which has the largest share of the place's opacity, of those of the
// eight voxels round it; the lowest number where two have as much; where clips hide the place, of those voxels that they leave whole. Where the feature has no colour of its own, the transfer function's, of
// the mean value of the feature's voxels, which is one of the feature's own: no colour between two features is a third one's.
//
// Cost: 8 reads; 8 more of opacities where features meet, 8 more of values where the feature has no colour.

fn feature_at(x: i32, y: i32, z: i32) -> u32 {
    return textureLoad(feature_index, vec3(x, y, z), 0).r;
}

fn source_at(x: i32, y: i32, z: i32) -> f32 {
    return textureLoad(values, vec3(x, y, z), 0).r;
}

// Who has the most of a place's opacity, and the eight voxels round it.
struct Owner {
    feature: u32,
    // the feature whose light it has: the same, or of a place of nobody's the one that has the most opacity; 0 where none has any
    light: u32,
    // lowest and highest voxel
    l: vec3<i32>,
    h: vec3<i32>,
    // linear weights of four voxels of a slice, and of the upper slice
    across: vec4<f32>,
    up: f32,
    // features of the voxels of both slices
    low: vec4<u32>,
    high: vec4<u32>,
}

fn owner_of(position: vec3<f32>) -> Owner {
    let last = frame.dims.xyz - 1.0;
    let at = clamp(position, vec3(0.0), last);
    let l = vec3<i32>(at);
    let h = min(l + 1, vec3<i32>(last));
    let w = at - vec3<f32>(l);
    let across = vec4((1.0 - w.x) * (1.0 - w.y), w.x * (1.0 - w.y), (1.0 - w.x) * w.y, w.x * w.y);
    let low = vec4(feature_at(l.x, l.y, l.z), feature_at(h.x, l.y, l.z), feature_at(l.x, h.y, l.z), feature_at(h.x, h.y, l.z));
    let high = vec4(feature_at(l.x, l.y, h.z), feature_at(h.x, l.y, h.z), feature_at(l.x, h.y, h.z), feature_at(h.x, h.y, h.z));
    var own = low.x;
    var beside = 0u;
    if any(low != vec4(own)) || any(high != vec4(own)) {
        let below = (1.0 - w.z) * across * vec4(texel_at(l.x, l.y, l.z), texel_at(h.x, l.y, l.z), texel_at(l.x, h.y, l.z), texel_at(h.x, h.y, l.z));
        let above = w.z * across * vec4(texel_at(l.x, l.y, h.z), texel_at(h.x, l.y, h.z), texel_at(l.x, h.y, h.z), texel_at(h.x, h.y, h.z));
        var most = 0.0;
        var most_beside = 0.0;
        for (var k = 0u; k <= features.count; k++) {
            if only_spared && features.each[k].spared == 0u {
                continue;
            }
            let share = dot(below, vec4<f32>(low == vec4(k))) + dot(above, vec4<f32>(high == vec4(k)));
            if share > most {
                most = share;
                own = k;
            }
            if k > 0u && share > most_beside {
                most_beside = share;
                beside = k;
            }
        }
    }
    return Owner(own, select(own, beside, own == 0u), l, h, across, w.z, low, high);
}

fn colour_by(owner: Owner) -> vec3<f32> {
    let own = owner.feature;
    let colour = features.each[own].colour;
    if colour.w == 1.0 {
        return colour.rgb;
    }
    let l = owner.l;
    let h = owner.h;
    let below = (1.0 - owner.up) * owner.across * vec4<f32>(owner.low == vec4(own));
    let above = owner.up * owner.across * vec4<f32>(owner.high == vec4(own));
    let sum = dot(below, vec4(source_at(l.x, l.y, l.z), source_at(h.x, l.y, l.z), source_at(l.x, h.y, l.z), source_at(h.x, h.y, l.z)))
        + dot(above, vec4(source_at(l.x, l.y, h.z), source_at(h.x, l.y, h.z), source_at(l.x, h.y, h.z), source_at(h.x, h.y, h.z)));
    let weight = max(dot(below, vec4(1.0)) + dot(above, vec4(1.0)), 1e-30);
    return colour_of(sum / weight * features.scale + features.bias);
}
