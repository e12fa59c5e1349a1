// What kernels of rays in whole numbers share (method.md section 4): directions, the table of cells' means, opacities of steps. Needs
// the immediate `params` with `exponent`, step / reference length of the opacity.

#include "shared/opaque.wgsl"
#include "shared/parts.wgsl"

struct Direction {
    // in UNITths of a voxel
    step: vec3<i32>,
    // what a lost half cell adds to a sum
    factor: f32,
    // in voxels
    half_step: vec3<f32>,
}

struct Directions {
    all: array<Direction>,
}

struct Cells {
    // a / -ln(1 - a) in WHOLE + 1ths, at a = multiples of 256 / WHOLE
    mean: array<u32, MEANS>,
}

// PARTS as a whole number: T of a ray that met nothing.
const WHOLE = 65535u;
// Parts of a voxel that far cells are found in.
const UNIT = 65536;
const UNIT_BITS = 16u;
// Parts of a WHOLEth that a voxel's sum is in.
const FINE = 16384u;
const FINE_BITS = 14u;
// Entries of a table of cells' means, 256 opacities from one to the next.
const MEANS = 257u;
// A ray with less than 2^-10 is at its end: looked at after the near cells of `hybrid`, each cell of `linear`, each group of far ones.
const DARK = 64u;
// Cells of `hybrid` that have the filter's opacity.
const NEAR = 3u;
// Far cells that are looked up together: behind near cells, and without them.
const FEW = 2u;
const MANY = 4u;

const NEAREST = 0u;
const HYBRID = 1u;
const LINEAR = 2u;

var<workgroup> cell_means: array<u32, MEANS>;

// 1 - a; a filter of opaque matter is opaque, whatever it rounds.
fn clear(a: vec4<f32>) -> vec4<f32> {
    let q = 1.0 - a;
    return select(q, vec4(0.0), q < vec4(OPAQUE));
}

// In WHOLEths, of one step. Four at once: one branch, which all take alike.
fn in_steps(a: vec4<f32>) -> vec4<u32> {
    var of_step = a;
    if params.exponent != 1.0 {
        of_step = select(1.0 - pow(clear(a), vec4(params.exponent)), vec4(0.0), a == vec4(0.0));
    }
    // 2^23 is where whole numbers are all that f32 has.
    return bitcast<vec4<u32>>(of_step * PARTS + 8388608.0) & vec4(0xffffu);
}

fn in_step(a: f32) -> u32 {
    return in_steps(vec4(a, 0.0, 0.0, 0.0)).x;
}
