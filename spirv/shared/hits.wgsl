struct Hits {
    // for each pixel the triangle that is seen, NO_TRIANGLE where none is, and where on it: weights of the second and the third
    // corner, 16 bits each
    pixel: array<vec2<u32>>,
}
