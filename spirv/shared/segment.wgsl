// Exact segment rule (method.md section 3): transmittance q = 1 - a linear between the two ends of a segment.

// q ln q, which goes to 0 with q.
fn entropy(q: f32) -> f32 {
    return select(q * log(q), 0.0, q <= 0.0);
}

// Mean of -ln q for q linear from q0 to q1; e = entropy(q). The series takes over where the difference of the closed form
// would cancel; at a tenth of the mean its next term is 3e-7.
fn mean_extinction(q0: f32, e0: f32, q1: f32, e1: f32) -> f32 {
    let mean = 0.5 * (q0 + q1);
    let difference = q1 - q0;
    let relative = difference / mean;
    let series = relative * relative / 24.0 - log(mean);
    return select(1.0 - (e1 - e0) / difference, series, abs(difference) <= 0.1 * mean);
}

// (1 - exp(-x)) / x; below 0.01 its series, whose next term is 4e-8.
fn mean_transmittance(x: f32) -> f32 {
    return select((1.0 - exp(-x)) / x, 1.0 - x * (0.5 - x / 6.0), x < 0.01);
}
