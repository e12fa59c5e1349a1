// k-means of histograms in whole numbers, from a fixed seed: the same clusters to the bit on every device. `seed` takes one sample of each
// of equal parts of all; a round is `label`, the nearest cluster of each sample, `collect`, their sums, and `centre`, the means. A cluster
// without samples takes one at random.

struct ClustersParams {
    rows: u32,
    clusters: u32,
    round: u32,
}

// Sums of at most 131,072 samples: 2^17 WHOLE_SHAREs are less than 2^32.
struct Sums {
    // BINS sums and a count for each cluster
    all: array<atomic<u32>>,
}

#include "shared/bricks.wgsl"
#include "shared/nearest.wgsl"

var<immediate> params: ClustersParams;
// word w of row r at rows w + r
@group(0) @binding(0) var<storage, read> sampled: Words;
@group(0) @binding(1) var<storage, read_write> labels: Words;
@group(0) @binding(3) var<storage, read_write> sums: Sums;

// Numbers of a cluster in `Sums`.
const SUMS = BINS + 1u;
// Most samples.
const MOST_ROWS = 131072u;

// The first sample of a part, and how many it has.
fn part_of(cluster: u32) -> vec2<u32> {
    let size = params.rows / params.clusters;
    return vec2(cluster * size, size);
}

fn take_row(cluster: u32, row: u32) {
    for (var w = 0u; w < WORDS; w++) {
        centres.all[WORDS * cluster + w] = sampled.all[params.rows * w + row];
    }
}

// One invocation a cluster.
@compute @workgroup_size(EACH)
fn seed(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.clusters {
        let part = part_of(id.x);
        take_row(id.x, part.x + mixed(id.x) % part.y);
        for (var j = 0u; j < SUMS; j++) {
            atomicStore(&sums.all[SUMS * id.x + j], 0u);
        }
    }
}

// One invocation a sample.
@compute @workgroup_size(EACH)
fn label(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if id.x >= params.rows {
        return;
    }
    for (var w = 0u; w < WORDS; w++) {
        let word = sampled.all[params.rows * w + id.x];
        bins[EACH * 2u * w + lane] = word & 0xffffu;
        bins[EACH * (2u * w + 1u) + lane] = word >> 16u;
    }
    labels.all[id.x] = nearest_of(lane, params.clusters);
}

// One invocation a sample.
@compute @workgroup_size(EACH)
fn collect(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.rows {
        return;
    }
    let to = SUMS * labels.all[id.x];
    for (var w = 0u; w < WORDS; w++) {
        let word = sampled.all[params.rows * w + id.x];
        // Most are 0.
        if (word & 0xffffu) != 0u {
            atomicAdd(&sums.all[to + 2u * w], word & 0xffffu);
        }
        if word >> 16u != 0u {
            atomicAdd(&sums.all[to + 2u * w + 1u], word >> 16u);
        }
    }
    atomicAdd(&sums.all[to + BINS], 1u);
}

// One invocation a cluster. Sums are 0 again afterwards.
@compute @workgroup_size(EACH)
fn centre(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.clusters {
        return;
    }
    let first = SUMS * id.x;
    let count = atomicExchange(&sums.all[first + BINS], 0u);
    if count == 0u {
        take_row(id.x, mixed(id.x + params.clusters * (params.round + 1u)) % params.rows);
        return;
    }
    for (var w = 0u; w < WORDS; w++) {
        let low = atomicExchange(&sums.all[first + 2u * w], 0u) / count;
        let high = atomicExchange(&sums.all[first + 2u * w + 1u], 0u) / count;
        centres.all[WORDS * id.x + w] = low | (high << 16u);
    }
}
