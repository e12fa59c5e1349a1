// Tensors of a network (docs/dvao.md): channels in blocks of 8; of each block all voxels, x fastest; of each voxel 8 numbers of 16 bits, two a
// word: C/8 x D x H x W x 8. What is beyond the channels of the last block is 0. What is stored has gone through Mish.

// Channels of a block.
const CHANNELS = 8u;

struct Tensor {
    all: array<vec4<u32>>,
}

// The channels of a voxel.
struct Eight {
    low: vec4<f32>,
    high: vec4<f32>,
}

fn unpacked(words: vec4<u32>) -> Eight {
    return Eight(
        vec4(unpack2x16float(words.x), unpack2x16float(words.y)),
        vec4(unpack2x16float(words.z), unpack2x16float(words.w)),
    );
}

fn packed(eight: Eight) -> vec4<u32> {
    return vec4(
        pack2x16float(eight.low.xy),
        pack2x16float(eight.low.zw),
        pack2x16float(eight.high.xy),
        pack2x16float(eight.high.zw),
    );
}

// A voxel of a block, in voxels of a grid.
fn voxel_at(place: vec3<u32>, dims: vec3<u32>) -> u32 {
    return (place.z * dims.y + place.y) * dims.x + place.x;
}

fn place_at(voxel: u32, dims: vec3<u32>) -> vec3<u32> {
    return vec3(voxel % dims.x, voxel / dims.x % dims.y, voxel / (dims.x * dims.y));
}
