// What is said of a brick in a word of Todo.

#include "shared/words.wgsl"

// Its values are to be computed.
const TODO = 1u;
