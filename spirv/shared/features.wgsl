// Features, parts of a volume: how each is shown.

// Most features; 0 is none.
const MOST_FEATURES = 8u;

struct Feature {
    // linear; w 1: it has one, 0: the transfer function's counts
    colour: vec4<f32>,
    // its values, from the first on and below the second, where they decide
    low: f32,
    high: f32,
    // what opacities are multiplied with; 0 where it is hidden
    factor: f32,
    // 1: clips leave it whole
    spared: u32,
}

struct Features {
    // 0: there are none, and no image that says which voxels are whose
    count: u32,
    // 1: clips leave one whole that shows
    any_spared: u32,
    // value = texel * scale + bias, of the volume that they are parts of
    scale: f32,
    bias: f32,
    each: array<Feature, MOST_FEATURES + 1u>,
}
