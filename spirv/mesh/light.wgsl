// The picture of a world: what each pixel's surface sends towards the eye, and its depth.
//
//   L = A k_a c + A' (k_d c d + k_s s)     A = min(gain/2 accessibility V_AO, 1) where it is shown, else 1; the rest as in shading.wgsl
//
// V_AO is the volume's ambient factor a voxel in front of the surface, of what it is in the open: 1, or one half where the volume's opacities know
// the surface as a solid; 1 outside the volume and without one. What hides some of all directions is taken for what it hides of those in front.
//
// Half the accessibility is the share of all directions that is open, which the gain of volumes is for: a flat wall's is 1/2 there too.
// `ends` is for a volume's rays, which end at the surface; `over` lays what they gave over it.

#include "shared/geometry.wgsl"
#include "shared/surface.wgsl"
#include "shared/accessibility.wgsl"
#include "shared/hits.wgsl"

struct LightParams {
    size: vec2<u32>,
    // parts of the light, and the exponent of the highlight
    ambient: f32,
    diffuse: f32,
    specular: f32,
    shininess: f32,
    // 1: accessibility multiplies the ambient part; the other parts
    occluded: f32,
    occluded_rest: f32,
    gain: f32,
    // unit vector towards the light
    light_x: f32,
    light_y: f32,
    light_z: f32,
    // voxels of the volume and their size in mm; what its ambient texels hold
    dims_x: f32,
    dims_y: f32,
    dims_z: f32,
    spacing_x: f32,
    spacing_y: f32,
    spacing_z: f32,
    texels: u32,
    // V_AO in the open
    open: f32,
}

// One factor; red, green, blue; the factors of four parts, of which the least counts.
const GREY = 0u;
const COLOURED = 1u;
const PARTS_OF_FOUR = 2u;

var<immediate> params: LightParams;
@group(0) @binding(0) var<uniform> eyes: Eyes;
@group(0) @binding(1) var<storage, read> looks: Looks;
@group(0) @binding(2) var<storage, read> triangles: Triangles;
@group(0) @binding(3) var<storage, read> materials: Materials;
@group(0) @binding(4) var<storage, read> texels: Texels;
@group(0) @binding(5) var<storage, read> geometry: Geometry;
@group(0) @binding(6) var<storage, read> hits: Hits;
@group(0) @binding(7) var<storage, read> accessibility: Accessibility;
@group(0) @binding(8) var colours: texture_storage_2d_array<rgba32float, read_write>;
@group(0) @binding(9) var depths: texture_storage_2d_array<r32float, read_write>;
@group(0) @binding(10) var ambient: texture_3d<f32>;
@group(0) @binding(11) var edge: sampler;

// Farther than anything.
const NOWHERE = 3e38;

fn linear_of(coded: vec3<f32>) -> vec3<f32> {
    return select(pow((coded + 0.055) / 1.055, vec3(2.4)), coded / 12.92, coded <= vec3(0.04045));
}

// V_AO in front of what a pixel shows.
fn volume_factor(index: u32, eye: Eye, pixel: vec2<u32>) -> vec3<f32> {
    let here = geometry.pixel[index];
    let dims = vec3(params.dims_x, params.dims_y, params.dims_z);
    let spacing = vec3(params.spacing_x, params.spacing_y, params.spacing_z);
    let voxel = min(spacing.x, min(spacing.y, spacing.z));
    let place = (position_of(eye, params.size, pixel, here.w) + voxel * here.xyz) / (spacing * dims) + 0.5;
    if any(place < vec3(0.0)) || any(place > vec3(1.0)) {
        return vec3(1.0);
    }
    let texel = min(textureSampleLevel(ambient, edge, place, 0.0) / params.open, vec4(1.0));
    switch params.texels {
        case COLOURED: {
            return texel.rgb;
        }
        case PARTS_OF_FOUR: {
            return vec3(min(min(texel.r, texel.g), min(texel.b, texel.a)));
        }
        default: {
            return vec3(texel.r);
        }
    }
}

fn light_at(index: u32, eye: Eye, pixel: vec2<u32>, factor: vec3<f32>) -> vec3<f32> {
    let hit = hits.pixel[index];
    let at = unpack2x16unorm(hit.y);
    let look = looks.triangle[hit.x];
    let material = materials.material[u32(triangles.triangle[hit.x].b.w)];
    let own = geometry.pixel[index].xyz;
    var colour = material.cap;
    var normal = own;
    if hit.y != ON_CAP {
        colour = material.colour.rgb * linear_of(texture_at(material, uv_at(look, at)).rgb);
        normal = normalize(
            normal_of(look.normal_a) * (1.0 - at.x - at.y) + normal_of(look.normal_b) * at.x + normal_of(look.normal_c) * at.y
        );
        // Of the side that is seen.
        normal = select(normal, -normal, dot(normal, own) < 0.0);
    }
    let light = vec3(params.light_x, params.light_y, params.light_z);
    let towards_eye = -normalize(direction_through(eye, params.size, vec2<f32>(pixel) + 0.5));
    let slope = max(dot(normal, light), 0.0);
    let half_way = light + towards_eye;
    let mirrored = min(max(dot(normal, half_way), 0.0) / max(length(half_way), 1e-6), 1.0);
    let highlight = slope * pow(mirrored, params.shininess);
    let shown = min(0.5 * params.gain * accessibility.pixel[index] * factor, vec3(1.0));
    let open = mix(vec3(1.0), shown, params.occluded);
    let open_rest = mix(vec3(1.0), open, params.occluded_rest);
    let matt = open * params.ambient + open_rest * params.diffuse * slope;
    return matt * colour + open_rest * params.specular * highlight;
}

// Colour and depth of the world alone.
@compute @workgroup_size(8, 8)
fn alone(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let index = pixel_index(params.size, id.z, id.xy);
    let eye = eyes.eye[id.z];
    let depth = geometry.pixel[index].w;
    if depth == 0.0 {
        textureStore(colours, id.xy, id.z, vec4(0.0));
        textureStore(depths, id.xy, id.z, vec4(eye.depth.x + eye.depth.y / eye.depth.w, 0.0, 0.0, 0.0));
        return;
    }
    textureStore(colours, id.xy, id.z, vec4(light_at(index, eye, id.xy, vec3(1.0)), 1.0));
    textureStore(depths, id.xy, id.z, vec4(eye.depth.x + eye.depth.y / depth, 0.0, 0.0, 0.0));
}

// Where the rays of a volume end: view depths in mm.
@compute @workgroup_size(8, 8)
fn ends(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id.xy < params.size) {
        let depth = geometry.pixel[pixel_index(params.size, id.z, id.xy)].w;
        textureStore(depths, id.xy, id.z, vec4(select(NOWHERE, depth, depth > 0.0), 0.0, 0.0, 0.0));
    }
}

// Behind a picture of a volume whose rays ended there. Its depth stays where the volume's opacity passes one half.
@compute @workgroup_size(8, 8)
fn over(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let index = pixel_index(params.size, id.z, id.xy);
    let depth = geometry.pixel[index].w;
    if depth == 0.0 {
        return;
    }
    let eye = eyes.eye[id.z];
    let front = textureLoad(colours, id.xy, id.z);
    let behind = light_at(index, eye, id.xy, volume_factor(index, eye, id.xy));
    textureStore(colours, id.xy, id.z, vec4(front.rgb + (1.0 - front.a) * behind, 1.0));
    if front.a < 0.5 {
        textureStore(depths, id.xy, id.z, vec4(eye.depth.x + eye.depth.y / depth, 0.0, 0.0, 0.0));
    }
}
