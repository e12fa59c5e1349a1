// Which bricks can show anything: the largest opacity that the transfer function gives to any value
// between the smallest and the largest of the brick's voxels and their neighbours. Samples interpolate between voxels,
// so their value stays in that range, and a brick without opacity there can be skipped without changing the picture.

// Of a volume with features the values are opacities, and clips leave some of them.

struct OccupancyParams {
    dims: vec3<u32>,
    scale: f32,
    bricks: vec3<u32>,
    bias: f32,
}

#include "shared/words.wgsl"
#include "shared/transfer.wgsl"

var<immediate> params: OccupancyParams;
@group(0) @binding(0) var volume: texture_3d<f32>;
@group(0) @binding(2) var<storage, read_write> occupancy: Occupancy;
@group(0) @binding(3) var<uniform> features: Features;
@group(0) @binding(4) var feature_index: texture_3d<u32>;

#include "shared/spared.wgsl"

// Bricks along x that a workgroup takes, and the voxels of their rows with one more at each end.
const TAKEN = LANES / BRICK;
const ROW = LANES + 2u;

// Smallest and largest value of the columns of voxels that these bricks and their neighbours' nearest have above a row.
var<workgroup> columns: array<vec2<f32>, ROW>;
// Whether some voxel of them has opacity that clips leave.
var<workgroup> spared: array<u32, ROW>;

fn joined(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2(min(a.x, b.x), max(a.y, b.y));
}

// Neighbouring invocations read neighbouring voxels, and neighbouring bricks share what they have in common.
@compute @workgroup_size(LANES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let first = group * vec3(TAKEN, 1u, 1u);
    let corner = vec3<i32>(first * BRICK) - 1;
    let last = vec3<i32>(params.dims) - 1;
    let low = max(corner, vec3(0));
    let high = min(corner + i32(BRICK) + 1, last);
    for (var i = lane; i < ROW; i += LANES) {
        let x = clamp(corner.x + i32(i), 0, last.x);
        var range = vec2(3.4e38, -3.4e38);
        for (var z = low.z; z <= high.z; z++) {
            for (var y = low.y; y <= high.y; y++) {
                range = joined(range, vec2(textureLoad(volume, vec3(x, y, z), 0).r * params.scale + params.bias));
            }
        }
        columns[i] = range;
        var left = 0u;
        if features.any_spared == 1u {
            for (var z = low.z; z <= high.z; z++) {
                for (var y = low.y; y <= high.y; y++) {
                    let voxel = vec3(x, y, z);
                    left |= u32(is_spared(vec3<u32>(voxel)) && textureLoad(volume, voxel, 0).r > 0.0);
                }
            }
        }
        spared[i] = left;
    }
    workgroupBarrier();
    let brick = first + vec3(lane, 0u, 0u);
    if lane >= TAKEN || brick.x >= params.bricks.x {
        return;
    }
    var range = columns[lane * BRICK];
    var left = spared[lane * BRICK];
    for (var i = 1u; i < BRICK + 2u; i++) {
        range = joined(range, columns[lane * BRICK + i]);
        left |= spared[lane * BRICK + i];
    }
    // Filtering rounds: by less than one part in 2^16 of the largest texel. Texels of 0 stay 0.
    let slack = 1.6e-5 * max(abs(range.x - params.bias), abs(range.y - params.bias));
    let opacity = largest_opacity(range.x - slack, range.y + slack);
    occupancy.visible[brick_index(brick, params.bricks)] = select(0u, SHOWS | left * SPARED, opacity > 0.0);
}
