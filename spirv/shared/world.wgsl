// The triangles of a world, in a tree whose nodes lie depth first, each with the node to go on with where it is missed: whoever walks needs
// no stack. The tree's boxes are those of the triangles, or of what each may occlude.

struct TreeNode {
    low: vec3<f32>,
    // the next node for who has missed this one
    skip: u32,
    high: vec3<f32>,
    // eight times a leaf's first triangle, and how many it has; none: the next node is a child
    leaf: u32,
}

struct Tree {
    node: array<TreeNode>,
}

// In the order of the tree's leaves. Corners are counter-clockwise seen from the front, in mm.
struct WorldTriangle {
    // a corner; the share of the triangle that its mask leaves
    a: vec4<f32>,
    // a corner; the number of its material
    b: vec4<f32>,
    // a corner; MASKED, TWO_SIDED, SLIVER, SPARED, CAPPED
    c: vec4<f32>,
}

// What a mask is to be asked of.
const MASKED = 1u;
// Whose back is a surface too.
const TWO_SIDED = 2u;
// Whose volume is cut by the box of the triangle: corners are so sharp that it would reach far.
const SLIVER = 4u;
// Which clips leave whole.
const SPARED = 8u;
// Of a mesh whose cuts are closed.
const CAPPED = 16u;

// What is left of each triangle, of its area: what neither its mask nor a clip takes.
struct Shares {
    triangle: array<f32>,
}

struct Triangles {
    triangle: array<WorldTriangle>,
}

// For light: texture coordinates, and unit normals, packed octahedra.
struct Look {
    uv_a: vec2<f32>,
    uv_b: vec2<f32>,
    uv_c: vec2<f32>,
    normal_a: u32,
    normal_b: u32,
    normal_c: u32,
}

struct Looks {
    triangle: array<Look>,
}

struct SurfaceMaterial {
    // linear, and opacity
    colour: vec4<f32>,
    // its first texel, pixels across and down; 0 across: no texture
    texture_at: u32,
    width: u32,
    height: u32,
    // there is a surface where opacity is at least this
    cutoff: f32,
    // of a capped mesh: the linear colour of its cuts, and which of all it is
    cap: vec3<f32>,
    body: u32,
}

struct Materials {
    material: array<SurfaceMaterial>,
}

// Red, green, blue as sRGB codes them, and opacity, in bytes from the lowest.
struct Texels {
    texel: array<u32>,
}

const NO_TRIANGLE = 0xffffffffu;

fn leaf_count(node: TreeNode) -> u32 {
    return node.leaf & 7u;
}

fn leaf_first(node: TreeNode) -> u32 {
    return node.leaf >> 3u;
}
