// Exact segment rule (method.md section 3): transmittance q = 1 - a linear between the two ends of a segment.

#include "shared/opaque.wgsl"

// ln q, of 0 a large negative number: q ln q goes to 0 with q.
fn logarithm(q: f32) -> f32 {
    return log(max(q, 1e-30));
}

// Mean of -ln q for q linear from q0 to q1; l = logarithm(q). With h = (l1 - l0) / 2 and g the geometric mean of q0 and q1 it
// is -ln g + 1 - h coth h, whose series takes over where the quotient would cancel; its next term is 2 h^10 / 93555, 2e-8.
fn mean_extinction(q0: f32, l0: f32, q1: f32, l1: f32) -> f32 {
    let h = 0.5 * (l1 - l0);
    let h2 = h * h;
    let series = h2 * (h2 * (h2 * (h2 * (1.0 / 4725.0) - 2.0 / 945.0) + 1.0 / 45.0) - 1.0 / 3.0) - 0.5 * (l0 + l1);
    return select(1.0 - (q1 * l1 - q0 * l0) / (q1 - q0), series, h2 < 0.25);
}

// (1 - b) / x for b = exp(-x); below 1/8 its series, whose next term is x^5 / 720, 4e-8.
fn mean_transmittance(x: f32, b: f32) -> f32 {
    let series = 1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0))));
    return select((1.0 - b) / x, series, x < 0.125);
}
