// The opacity of one voxel's length, of opacities per reference length. Needs opaque.wgsl.

// `exponent`: length of a voxel / reference length. A filter of opaque matter is opaque, whatever it rounds.
fn of_voxel(a: f32, exponent: f32) -> f32 {
    if exponent == 1.0 || a == 0.0 {
        return a;
    }
    let q = 1.0 - a;
    return 1.0 - select(pow(q, exponent), 0.0, q < OPAQUE);
}
