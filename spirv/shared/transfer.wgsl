// Transfer function: piecewise linear between control points, constant beyond the first and the last. Two points of equal
// value make a step; at the value itself the second holds.

// Control points of an opacity or a colour.
const MOST_POINTS = 64u;

struct Transfer {
    opacity_points: u32,
    colour_points: u32,
    // values up to the one and from the other on have no opacity
    least: f32,
    most: f32,
    // value, opacity per reference length, slope towards the next point, unused
    opacity: array<vec4<f32>, MOST_POINTS>,
    // value, linear red, green, blue
    colour: array<vec4<f32>, MOST_POINTS>,
}

@group(0) @binding(1) var<storage, read> transfer: Transfer;

// Number of the opacity's control points up to a value, found by halving: the piece before the first point is 0. Of two equal points the
// second counts.
fn piece_of(value: f32) -> u32 {
    var low = 0u;
    var high = transfer.opacity_points;
    while low < high {
        let middle = (low + high) / 2u;
        if value < transfer.opacity[middle].x {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

// The opacity of a value in its piece. Kept between its ends: rounding must not leave 0 ... 1 or exceed what `largest_opacity` promises.
fn opacity_in(piece: u32, value: f32) -> f32 {
    let point = transfer.opacity[max(piece, 1u) - 1u];
    if piece == 0u || piece == transfer.opacity_points {
        return point.y;
    }
    let end = transfer.opacity[piece].y;
    return clamp(point.y + (value - point.x) * point.z, min(point.y, end), max(point.y, end));
}

fn opacity_of(value: f32) -> f32 {
    return opacity_in(piece_of(value), value);
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
