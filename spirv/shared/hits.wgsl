struct Hits {
    // for each pixel the triangle that is seen, NO_TRIANGLE where none is, and where on it: weights of the second and the third
    // corner, 16 bits each; or ON_CAP, and of the mesh that is cut any triangle
    pixel: array<vec2<u32>>,
}

// No place of a triangle: its weights are 1 each.
const ON_CAP = 0xffffffffu;
