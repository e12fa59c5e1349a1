// Which bricks can show anything: the largest opacity that the transfer function gives to any value
// between the smallest and the largest of the brick's voxels and their neighbours. Samples interpolate between voxels,
// so their value stays in that range, and a brick without opacity there can be skipped without changing the picture.

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

// One invocation a brick.
@compute @workgroup_size(LANES)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = item_of(id, groups);
    if index >= brick_count(params.bricks) {
        return;
    }
    let corner = vec3<i32>(brick_at(index, params.bricks) * BRICK);
    let first = max(corner - 1, vec3(0));
    let last = min(corner + i32(BRICK), vec3<i32>(params.dims) - 1);
    var low = 3.4e38;
    var high = -3.4e38;
    for (var z = first.z; z <= last.z; z++) {
        for (var y = first.y; y <= last.y; y++) {
            for (var x = first.x; x <= last.x; x++) {
                let value = textureLoad(volume, vec3(x, y, z), 0).r * params.scale + params.bias;
                low = min(low, value);
                high = max(high, value);
            }
        }
    }
    // Filtering rounds; one part in 2^16 of the texel range is more than it can move a value.
    let slack = abs(params.scale) * 1.6e-5;
    occupancy.visible[index] = select(0u, 1u, largest_opacity(low - slack, high + slack) > 0.0);
}
