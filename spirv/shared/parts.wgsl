// Texels of r16unorm are whole numbers of parts: opacities of rays by brick, and their values.

// Parts of 1.
const PARTS = 65535.0;
