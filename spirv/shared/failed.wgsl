// What `upsample` writes for a pixel that no block is like: below any accessibility.
const FAILED = -1.0;
