// Directions of the largest ray set.
const MOST_RAYS = 254u;
