// Instance normalisation (DVAO eq. (2), without scale and shift): of the channels of a block mean and 1 / standard deviation.
struct Norm {
    mean_low: vec4<f32>,
    mean_high: vec4<f32>,
    by_low: vec4<f32>,
    by_high: vec4<f32>,
}

struct Norms {
    all: array<Norm>,
}
