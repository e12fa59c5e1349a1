// Look-ups in the volumes of means (pyramid/level.wgsl). Needs the bindings `opacity`, `field`, `table` and `level_1` ... `level_9`, and
// `params.exponent`.

// How a level is looked up, all along x, y, z.
struct Level {
    // texture coordinates of a place in voxels from the volume's corner: place * scale + bias
    scale: vec3<f32>,
    // voxels of its cube / those of the shell between it and the cube before
    outer: f32,
    bias: vec3<f32>,
    // voxels of the cube before / those of that shell
    inner: f32,
    // how far in voxels a normal of length 1 moves its cube out
    lift: vec3<f32>,
}

// Level 0 is V_o.
struct Levels {
    level: array<Level, LEVELS>,
}

// Level 0 and the most there are.
const LEVELS = 10u;

// Mean over the cube of a level around a place in voxels from the volume's corner.
fn mean_around(l: u32, place: vec3<f32>) -> f32 {
    let at = place * table.level[l].scale + table.level[l].bias;
    switch l {
        case 0u: {
            return of_voxel(textureSampleLevel(opacity, field, at, 0.0).r, params.exponent);
        }
        case 1u: {
            return textureSampleLevel(level_1, field, at, 0.0).r;
        }
        case 2u: {
            return textureSampleLevel(level_2, field, at, 0.0).r;
        }
        case 3u: {
            return textureSampleLevel(level_3, field, at, 0.0).r;
        }
        case 4u: {
            return textureSampleLevel(level_4, field, at, 0.0).r;
        }
        case 5u: {
            return textureSampleLevel(level_5, field, at, 0.0).r;
        }
        case 6u: {
            return textureSampleLevel(level_6, field, at, 0.0).r;
        }
        case 7u: {
            return textureSampleLevel(level_7, field, at, 0.0).r;
        }
        case 8u: {
            return textureSampleLevel(level_8, field, at, 0.0).r;
        }
        default: {
            return textureSampleLevel(level_9, field, at, 0.0).r;
        }
    }
}
