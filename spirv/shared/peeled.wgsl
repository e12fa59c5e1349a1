// What peeling found of one mesh. All but the first two are 0 before, `pairs` 1.

struct Peeled {
    // Group counts of a kernel over the cells of the dilation maps, and over the layer pairs that hold anything, at least 1.
    across: u32,
    down: u32,
    pairs: u32,
    // Passes that drew anything; pixels at which the last one did.
    surfaces: u32,
    seen: u32,
    // Most pairs of a pixel that have ended, and pixels with more than are kept.
    most: u32,
    beyond: u32,
    // Pixels at which fronts and backs differ in number; pixels from the first of them to the map's end.
    open: u32,
    from_first: u32,
}
