// A ray of rays by brick (method.md section 4): what its cells leave of the light, by a rule. Needs the bindings `opacity`, `field`, linear and
// transparent outside the volume, and `directions`, and `params.dims`, `params.cells`, `params.exponent`, `params.shift`.
// What a rule is stands in rays.wgsl.

#include "shared/whole_rays.wgsl"

// T in WHOLEths, and its integral in WHOLEths of half a step.
struct Ray {
    through: u32,
    sum: u32,
}

// One cell of opacity `a`; `halves` is what it counts.
fn pass_cell(ray: Ray, a: u32, halves: u32) -> Ray {
    // WHOLEths to WHOLE + 1ths, so that 0 leaves all and WHOLE nothing.
    let after = (ray.through * (65536u - a - (a >> 15u)) + 32768u) >> 16u;
    let mean = (ray.through * cell_means[(a + 128u) >> 8u] + 32768u) >> 16u;
    return Ray(after, ray.sum + halves * mean);
}

// Opacity of the voxel at a place.
fn met(at: vec3<i32>, interior: bool) -> f32 {
    let voxel = at >> vec3(UNIT_BITS);
    if interior || all(vec3<u32>(voxel) < params.dims) {
        return textureLoad(opacity, voxel, 0).r;
    }
    return 0.0;
}

// Cells behind `near` ones, by nearest voxels, in groups of MANY if `many`, of FEW else: loads come before the steps that use them.
fn far_cells(start: Ray, voxel: vec3<u32>, interior: bool, k: u32, near: u32, many: bool) -> Ray {
    var ray = start;
    if ray.through < DARK {
        return ray;
    }
    let group = select(FEW, MANY, many);
    let step = directions.all[k].step;
    let first = vec3<i32>(round(params.shift * vec3<f32>(step)));
    var at = vec3<i32>(voxel) * UNIT + UNIT / 2 + first + step * i32(near);
    var m = near;
    while m + group < params.cells {
        var a = vec4(met(at + step, interior), met(at + 2 * step, interior), 0.0, 0.0);
        if many {
            a.z = met(at + 3 * step, interior);
            a.w = met(at + 4 * step, interior);
        }
        at += step * i32(group);
        m += group;
        if a.x + a.y + a.z + a.w == 0.0 {
            ray.sum += 2u * group * ray.through;
        } else {
            let of_step = in_steps(a);
            ray = pass_cell(ray, of_step.x, 2u);
            ray = pass_cell(ray, of_step.y, 2u);
            if many {
                ray = pass_cell(ray, of_step.z, 2u);
                ray = pass_cell(ray, of_step.w, 2u);
            }
            if ray.through < DARK {
                return ray;
            }
        }
        if !interior && any(vec3<u32>(at >> vec3(UNIT_BITS)) >= params.dims) {
            // Nothing beyond the border.
            ray.sum += ray.through * (2u * (params.cells - m) - 1u);
            return ray;
        }
    }
    for (; m < params.cells; m++) {
        at += step;
        ray = pass_cell(ray, in_step(met(at, interior)), select(2u, 1u, m + 1u == params.cells));
    }
    return ray;
}

// The filter's opacity at so many half steps on a ray that begins half a step out.
fn filtered(voxel: vec3<u32>, k: u32, half_steps: f32) -> f32 {
    let at = vec3<f32>(voxel) + 0.5 + (half_steps + 2.0 * params.shift) * directions.all[k].half_step;
    return textureSampleLevel(opacity, field, at * (1.0 / vec3<f32>(params.dims)), 0.0).r;
}

fn traced(voxel: vec3<u32>, interior: bool, k: u32, rule: u32) -> Ray {
    var ray = Ray(WHOLE, 0u);
    if rule == NEAREST {
        return far_cells(ray, voxel, interior, k, 0u, true);
    }
    var a = vec4(filtered(voxel, k, 1.5), filtered(voxel, k, 2.5), 0.0, 0.0);
    if rule == HYBRID {
        a.z = filtered(voxel, k, 4.0);
        a.w = filtered(voxel, k, 6.0);
    }
    let halves = 1.0 - sqrt(clear(a));
    let near = in_steps(vec4(halves.xy, a.zw));
    ray = pass_cell(ray, near.x, 1u);
    if rule == HYBRID {
        ray = pass_cell(ray, near.y, 1u);
        ray = pass_cell(pass_cell(ray, near.z, 2u), near.w, 2u);
        return far_cells(ray, voxel, interior, k, NEAR, false);
    }
    if params.cells > 1u {
        ray = pass_cell(ray, near.y, 1u);
    }
    for (var m = 2u; m <= params.cells && ray.through >= DARK; m++) {
        let of_step = in_step(filtered(voxel, k, f32(2u * m)));
        ray = pass_cell(ray, of_step, select(2u, 1u, m == params.cells));
    }
    return ray;
}
