// Transfer function: piecewise linear between control points, constant beyond the first and the last. Two points of equal
// value make a step; at the value itself the second holds.

// Control points of an opacity or a colour.
const MOST_POINTS = 64u;

struct Transfer {
    opacity_points: u32,
    colour_points: u32,
    // value, opacity per reference length, slope towards the next point, unused
    opacity: array<vec4<f32>, MOST_POINTS>,
    // value, linear red, green, blue
    colour: array<vec4<f32>, MOST_POINTS>,
}

@group(0) @binding(1) var<storage, read> transfer: Transfer;

// Kept between its ends: rounding must not leave 0 ... 1 or exceed what `largest_opacity` promises.
fn opacity_of(value: f32) -> f32 {
    if value < transfer.opacity[0].x {
        return transfer.opacity[0].y;
    }
    // The first point above the value, by halving: of two equal points the second holds.
    var low = 1u;
    var high = transfer.opacity_points;
    while low < high {
        let middle = (low + high) / 2u;
        if value < transfer.opacity[middle].x {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    let point = transfer.opacity[low - 1u];
    if low == transfer.opacity_points {
        return point.y;
    }
    let end = transfer.opacity[low].y;
    return clamp(point.y + (value - point.x) * point.z, min(point.y, end), max(point.y, end));
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
    if value < transfer.colour[0].x {
        return transfer.colour[0].yzw;
    }
    var low = 1u;
    var high = transfer.colour_points;
    while low < high {
        let middle = (low + high) / 2u;
        if value < transfer.colour[middle].x {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    let point = transfer.colour[low - 1u];
    if low == transfer.colour_points {
        return point.yzw;
    }
    let next = transfer.colour[low];
    return mix(point.yzw, next.yzw, (value - point.x) / (next.x - point.x));
}
