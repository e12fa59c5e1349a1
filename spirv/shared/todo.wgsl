// What is said of a brick in a word of Todo.

#include "shared/words.wgsl"

// Its values are to be computed.
const TODO = 1u;
// It has values; the voxels of a brick that has none hold 1.
const VALUED = 2u;
