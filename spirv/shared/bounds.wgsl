// The box of the bricks that show something. Both are maxima, and 0 where none does.

struct Bounds {
    // Along each axis the bricks from the first that shows something to the volume's end, and those from its beginning to the last.
    from_first: array<u32, 3>,
    to_last: array<u32, 3>,
}
