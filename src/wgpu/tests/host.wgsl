// A host's own drawing: spheres with their depth, and a plane that is compared with it.

struct Eye {
    origin: vec4f,
    // A pixel's ray is corner + x right + y down; its parameter is the distance along the axis, in mm.
    corner: vec4f,
    right: vec4f,
    down: vec4f,
    // The depth of what is t away is x + y/t; the plane's is z.
    depth: vec4f,
    // Centre and radius.
    spheres: array<vec4f, 3>,
}

@group(0) @binding(0) var<uniform> eye: Eye;

@vertex
fn everywhere(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

struct Texel {
    @location(0) colour: vec4f,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn spheres(@builtin(position) at: vec4f) -> Texel {
    let along = eye.corner.xyz + at.x * eye.right.xyz + at.y * eye.down.xyz;
    var nearest = 1e9;
    var texel = Texel(vec4f(0.0), 0.0);
    for (var i = 0u; i < 3u; i++) {
        let o = eye.origin.xyz - eye.spheres[i].xyz;
        let a = dot(along, along);
        let half_b = dot(o, along);
        let root = half_b * half_b - a * (dot(o, o) - eye.spheres[i].w * eye.spheres[i].w);
        let t = (-half_b - sqrt(max(root, 0.0))) / a;
        if root > 0.0 && t < nearest {
            nearest = t;
            texel.colour = vec4f(select(0.1, 0.8, i == 0u), select(0.1, 0.8, i == 1u), select(0.1, 0.8, i == 2u), 1.0);
        }
    }
    if nearest == 1e9 {
        discard;
    }
    texel.depth = eye.depth.x + eye.depth.y / nearest;
    return texel;
}

@fragment
fn plane() -> Texel {
    return Texel(vec4f(1.0), eye.depth.z);
}
