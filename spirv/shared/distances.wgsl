// How far a ray may leap.

// A word a brick, x fastest: the distance in bricks to the nearest that has opacity and is not wholly hidden by the clips, and a bit for
// each clip that may hide some of it.
struct Distances {
    word: array<u32>,
}

// Bits of a distance; the largest there is.
const DISTANCE_BITS = 24u;
const FAR = (1u << DISTANCE_BITS) - 1u;

fn distance_in(word: u32) -> u32 {
    return word & FAR;
}

fn word_of(distance: u32, asked: u32) -> u32 {
    return distance | asked << DISTANCE_BITS;
}

// The clips that may hide some of the brick.
fn asked_in(word: u32) -> u32 {
    return word >> DISTANCE_BITS;
}
