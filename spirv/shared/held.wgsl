// Whether each brick holds matter of each feature, 1 or 0: bricks of the first, then those of the second, and so on.

struct Held {
    bricks: array<u32>,
}
