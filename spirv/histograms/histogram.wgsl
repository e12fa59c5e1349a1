// Local histograms: the share of a voxel's neighbourhood that each of BINS values has, weighted by the inverse square of the distance. One
// invocation a histogram, its bins in workgroup memory. `extent` finds the range of all values, `sort` the bin of each voxel, `sample` the
// histograms of some voxels, `assign` those of all, each of which it replaces by the number of the nearest cluster.

struct HistogramParams {
    dims: vec3<u32>,
    // voxels along each axis that share a cluster
    block: u32,
    // voxels of the index volume
    coarse: vec3<u32>,
    offsets: u32,
    // value = stored * slope + bias; stored integers of a UNORM texel, 1: the texel is the stored value
    levels: f32,
    slope: f32,
    bias: f32,
    // WHOLE_SHARE / sum of all weights
    share: f32,
    // samples, and voxels of which each is one
    rows: u32,
    stride: u32,
    // the first voxel of the index volume to assign
    first: u32,
    clusters: u32,
}

struct Extent {
    // of values, ordered as whole numbers
    low: atomic<u32>,
    high: atomic<u32>,
}

struct Offset {
    // 128 more along each axis, 8 bits each
    place: u32,
    weight: u32,
}

struct Offsets {
    all: array<Offset>,
}

#include "shared/bricks.wgsl"
#include "shared/nearest.wgsl"

var<immediate> params: HistogramParams;
@group(0) @binding(0) var volume: texture_3d<f32>;
@group(0) @binding(1) var<storage, read_write> extent_of: Extent;
@group(0) @binding(3) var binned: texture_storage_3d<r8uint, write>;
@group(0) @binding(4) var bin_at: texture_3d<u32>;
@group(0) @binding(5) var<storage, read> offsets: Offsets;
// word w of row r at rows w + r
@group(0) @binding(6) var<storage, read_write> sampled: Words;
@group(0) @binding(7) var index: texture_storage_3d<r16uint, write>;

// Most voxels of a neighbourhood: of a ball with a radius of 12.
const MOST_OFFSETS = 7153u;
// What `Extent` holds before the first value: nothing.
const NOTHING_LOW = 0xffffffffu;

fn value_at(voxel: vec3<u32>) -> f32 {
    let texel = textureLoad(volume, voxel, 0).r;
    return select(texel, round(texel * params.levels), params.levels > 1.0) * params.slope + params.bias;
}

// Whole numbers in the order of the values.
fn ordered(value: f32) -> u32 {
    let bits = bitcast<u32>(value);
    return select(bits | 0x80000000u, ~bits, bits >> 31u == 1u);
}

fn value_of(ordered: u32) -> f32 {
    return bitcast<f32>(select(~ordered, ordered & 0x7fffffffu, ordered >> 31u == 1u));
}

// One invocation a row along x.
@compute @workgroup_size(8, 8)
fn extent(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.dims.yz) {
        return;
    }
    var low = NOTHING_LOW;
    var high = 0u;
    for (var x = 0u; x < params.dims.x; x++) {
        let here = ordered(value_at(vec3(x, id.xy)));
        low = min(low, here);
        high = max(high, here);
    }
    atomicMin(&extent_of.low, low);
    atomicMax(&extent_of.high, high);
}

// One invocation a voxel: bins are centred on equal steps from the smallest value to the largest.
@compute @workgroup_size(8, 8, 4)
fn sort(@builtin(global_invocation_id) voxel: vec3<u32>) {
    if any(voxel >= params.dims) {
        return;
    }
    let low = 0.5 * value_of(atomicLoad(&extent_of.low));
    let width = 0.5 * value_of(atomicLoad(&extent_of.high)) - low;
    var bin = 0u;
    if width > 0.0 {
        bin = min(u32(round((0.5 * value_at(voxel) - low) / width * f32(BINS - 1u))), BINS - 1u);
    }
    textureStore(binned, voxel, vec4(bin, 0u, 0u, 0u));
}

// The histogram around a voxel, in WHOLE_SHAREths; what lies outside the volume is in no bin.
fn gather(voxel: vec3<u32>, lane: u32) {
    for (var j = 0u; j < BINS; j++) {
        bins[EACH * j + lane] = 0u;
    }
    for (var i = 0u; i < params.offsets; i++) {
        let offset = offsets.all[i];
        let place = voxel + (vec3(offset.place) >> vec3(0u, 8u, 16u) & vec3(255u)) - 128u;
        // Beyond the low border it is a large number.
        if all(place < params.dims) {
            bins[EACH * textureLoad(bin_at, place, 0).r + lane] += offset.weight;
        }
    }
    for (var j = 0u; j < BINS; j++) {
        bins[EACH * j + lane] = u32(round(f32(bins[EACH * j + lane]) * params.share));
    }
}

// One invocation a sample.
@compute @workgroup_size(EACH)
fn sample(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = item_of(id, groups);
    if row >= params.rows {
        return;
    }
    let i = row * params.stride + mixed(row) % params.stride;
    gather(vec3(i % params.dims.x, i / params.dims.x % params.dims.y, i / (params.dims.x * params.dims.y)), lane);
    for (var w = 0u; w < WORDS; w++) {
        let word = bins[EACH * 2u * w + lane] | (bins[EACH * (2u * w + 1u) + lane] << 16u);
        sampled.all[params.rows * w + row] = word;
    }
}

// One invocation a voxel of the index volume.
@compute @workgroup_size(EACH)
fn assign(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = params.first + item_of(id, groups);
    let place = vec3(i % params.coarse.x, i / params.coarse.x % params.coarse.y, i / (params.coarse.x * params.coarse.y));
    if place.z >= params.coarse.z {
        return;
    }
    gather(place * params.block, lane);
    textureStore(index, place, vec4(nearest_of(lane, params.clusters), 0u, 0u, 0u));
}
