// A summed-area table of opacities or extinctions, in whole numbers modulo 2^32: table(x, y, z) is the sum over all voxels below x, y and
// z. Sums of boxes that are less than 2^32 are exact, whatever the table's own sums lost. Three passes, the last two in place.

struct SumsParams {
    dims: vec3<u32>,
    // that a pass of `onward` sums along, 1 or 2
    axis: u32,
    // parts of 1, or of MOST_EXTINCTION, that are added up: 2^bits - 1
    levels: u32,
    // 1: extinctions, 0: opacities
    extinction: u32,
}

#include "shared/opaque.wgsl"
#include "shared/parts.wgsl"

var<immediate> params: SumsParams;
@group(0) @binding(0) var opacity: texture_3d<f32>;
// one texel more than the volume along each axis; 0 at the low sides
@group(0) @binding(1) var table: texture_storage_3d<r32uint, read_write>;

// -ln(1 - a) of a reference length that lets less than 2^-16 through.
const MOST_EXTINCTION = 11.09;

fn in_levels(voxel: vec3<u32>) -> u32 {
    let a = textureLoad(opacity, voxel, 0).r;
    if params.extinction == 1u {
        let whole = f32(params.levels);
        return u32(round(min(-log(max(1.0 - a, OPAQUE)), MOST_EXTINCTION) * (whole / MOST_EXTINCTION)));
    }
    // At most 65535² + 32767, which 32 bits hold.
    return (u32(round(a * PARTS)) * params.levels + 32767u) / 65535u;
}

// One invocation a row of the table along x.
@compute @workgroup_size(8, 8)
fn begin(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy > params.dims.yz) {
        return;
    }
    let border = any(id.xy == vec2(0u));
    var sum = 0u;
    textureStore(table, vec3(0u, id.xy), vec4(0u));
    for (var x = 0u; x < params.dims.x; x++) {
        if !border {
            sum += in_levels(vec3(x, id.xy - 1u));
        }
        textureStore(table, vec3(x + 1u, id.xy), vec4(sum, 0u, 0u, 0u));
    }
}

// One invocation a row of the table along y or z.
@compute @workgroup_size(8, 8)
fn onward(@builtin(global_invocation_id) id: vec3<u32>) {
    let along_y = params.axis == 1u;
    let across = select(params.dims.xy, params.dims.xz, along_y);
    if any(id.xy > across) {
        return;
    }
    var sum = 0u;
    for (var i = 1u; i <= params.dims[params.axis]; i++) {
        let at = select(vec3(id.xy, i), vec3(id.x, i, id.y), along_y);
        sum += textureLoad(table, at).r;
        textureStore(table, at, vec4(sum, 0u, 0u, 0u));
    }
}
