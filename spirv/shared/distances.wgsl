// How far a ray may leap.

// A word a brick, x fastest: two distances in bricks, to the nearest brick with opacity and to the nearest that is not wholly
// hidden by the clips either, and a bit for each clip that may hide some of it.
struct Distances {
    word: array<u32>,
}

// Bits of a distance; the largest there is.
const DISTANCE_BITS = 12u;
const FAR = (1u << DISTANCE_BITS) - 1u;
const ASKED_AT = 2u * DISTANCE_BITS;

fn distances_of(word: u32) -> vec2<u32> {
    return vec2(word & FAR, word >> DISTANCE_BITS & FAR);
}

fn word_of(distance: vec2<u32>, asked: u32) -> u32 {
    return distance.x | distance.y << DISTANCE_BITS | asked << ASKED_AT;
}

// The clips that may hide some of the brick.
fn asked_in(word: u32) -> u32 {
    return word >> ASKED_AT;
}
