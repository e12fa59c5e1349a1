// Categories of voxels (CAO section 3.3), as the mask has them.

// a: no sample of the voxel is visible.
const CLIPPED = 0u;
// b: visible, but its neighbourhood changed.
const AFFECTED = 1u;
// c: its neighbourhood is as it was.
const UNTOUCHED = 2u;

// How many there are.
const CATEGORIES = 3u;
