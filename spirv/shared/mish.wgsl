// Mish(x) = x tanh(softplus(x)) (Misra 2020, DVAO [33]): with e = exp(x), x (e² + 2 e) / (e² + 2 e + 2). Above 20 it is x to the last bit.
fn mish(x: vec4<f32>) -> vec4<f32> {
    let e = exp(min(x, vec4(20.0)));
    let n = e * (e + 2.0);
    return x * (n / (n + 2.0));
}
