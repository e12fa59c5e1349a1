// Squared distance in mm from each brick to the nearest changed one.
struct Change {
    distance: array<f32>,
}
