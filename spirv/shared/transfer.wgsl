// Transfer function: piecewise linear between control points, constant beyond the first and the last. Two points of equal
// value make a step; at the value itself the second holds.

struct Transfer {
    opacity_points: u32,
    colour_points: u32,
    pad0: u32,
    pad1: u32,
    // value, opacity per reference length, slope towards the next point, unused
    opacity: array<vec4<f32>, 64>,
    // value, linear red, green, blue
    colour: array<vec4<f32>, 64>,
}

@group(0) @binding(1) var<storage, read> transfer: Transfer;

fn opacity_of(value: f32) -> f32 {
    var point = transfer.opacity[0];
    if value < point.x {
        return point.y;
    }
    for (var i = 1u; i < transfer.opacity_points; i++) {
        let next = transfer.opacity[i];
        if value < next.x {
            // Kept between its ends: rounding must not leave 0 ... 1 or exceed what `largest_opacity` promises.
            return clamp(point.y + (value - point.x) * point.z, min(point.y, next.y), max(point.y, next.y));
        }
        point = next;
    }
    return point.y;
}

// Largest opacity of any value in [low, high]: at one of the ends or at a control point between them.
fn largest_opacity(low: f32, high: f32) -> f32 {
    var largest = max(opacity_of(low), opacity_of(high));
    for (var i = 0u; i < transfer.opacity_points; i++) {
        let point = transfer.opacity[i];
        if point.x >= low && point.x <= high {
            largest = max(largest, point.y);
        }
    }
    return largest;
}

fn colour_of(value: f32) -> vec3<f32> {
    var point = transfer.colour[0];
    if value < point.x {
        return point.yzw;
    }
    for (var i = 1u; i < transfer.colour_points; i++) {
        let next = transfer.colour[i];
        if value < next.x {
            return mix(point.yzw, next.yzw, (value - point.x) / (next.x - point.x));
        }
        point = next;
    }
    return point.yzw;
}
