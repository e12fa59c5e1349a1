// Histograms of BINS shares in WHOLE_SHAREths, and the nearest of several to one: squares of whole numbers, exact in any order.

// Values that a histogram tells apart.
const BINS = 64u;
// Shares of 1 that a histogram is in. Of two histograms, whose shares sum to 1 at most, the squared distance fits 32 bits.
const WHOLE_SHARE = 32767u;
// Two bins a word.
const WORDS = BINS / 2u;
// Invocations of a workgroup; each has a histogram of its own.
const EACH = 64u;

struct Words {
    all: array<u32>,
}

// Bin j of invocation i at EACH j + i.
var<workgroup> bins: array<u32, BINS * EACH>;

// WORDS words a cluster
@group(0) @binding(2) var<storage, read_write> centres: Words;

// Of an invocation's histogram; of equal ones the first.
fn nearest_of(lane: u32, clusters: u32) -> u32 {
    var best = 0xffffffffu;
    var found = 0u;
    for (var c = 0u; c < clusters; c++) {
        var distance = 0u;
        for (var w = 0u; w < WORDS; w++) {
            let word = centres.all[WORDS * c + w];
            let low = i32(bins[EACH * 2u * w + lane]) - i32(word & 0xffffu);
            let high = i32(bins[EACH * (2u * w + 1u) + lane]) - i32(word >> 16u);
            distance += u32(low * low) + u32(high * high);
        }
        if distance < best {
            best = distance;
            found = c;
        }
    }
    return found;
}

// A number of 32 bits that looks like chance.
fn mixed(seed: u32) -> u32 {
    let state = seed * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}
