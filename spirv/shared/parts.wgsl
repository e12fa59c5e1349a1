// Texels of r16unorm are whole numbers of parts. So are the opacities of a sweep, and what a ray contributes.

// Parts of 1.
const PARTS = 65535.0;
