// Numbers of a grid, x fastest.
struct Grid {
    all: array<f32>,
}
