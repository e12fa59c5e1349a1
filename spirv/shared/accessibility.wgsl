struct Accessibility {
    // one a pixel, in the order of the geometry: 1 - AO, 1 = open; 1 where nothing is
    pixel: array<f32>,
}
