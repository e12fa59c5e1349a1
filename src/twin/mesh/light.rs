//! What a surface sends towards the eye: `L = A k_a c + A' (k_d c d + k_s s)`, with `A = min(gain·(1 − AO)/2, 1)` where it is shown.

use super::gbuffer::Shown;
use cao_model::look::{Look, Occluded};
use cao_model::surface::World;
use glam::{DVec3, Vec2};

/// Linear red, green, blue towards `eye`, with the light from the direction `light`.
/// `open` is the accessibility times the volume's factor there.
pub fn lit(world: &World, shown: &Shown, open: f64, look: &Look, light: DVec3, eye: DVec3) -> [f64; 3] {
    let triangle = &world.triangles[shown.hit.triangle];
    let [u, v] = shown.hit.at;
    let weights = [1.0 - u - v, u, v];
    let uv: Vec2 = triangle.uvs.iter().zip(weights).map(|(uv, weight)| *uv * weight as f32).sum();
    let mean: DVec3 = triangle.normals.iter().zip(weights).map(|(n, weight)| n.as_dvec3() * weight).sum();
    let normal = match shown.cap {
        true => shown.normal,
        false if mean.dot(shown.normal) < 0.0 => -mean.normalize(),
        false => mean.normalize(),
    };
    let material = &world.materials[triangle.material as usize];
    let coded = material.texture.as_ref().map_or([1.0; 4], |texture| texture.at(uv));
    let towards_eye = (eye - shown.place).normalize();
    let diffuse = normal.dot(light).max(0.0);
    let half_way = (light + towards_eye).normalize();
    let specular = diffuse * normal.dot(half_way).max(0.0).powf(f64::from(look.shininess));
    let gained = (f64::from(look.gain) * 0.5 * open).min(1.0);
    let ambient_open = if look.shading.occluded() { gained } else { 1.0 };
    let rest_open = if look.occluded == Occluded::All { ambient_open } else { 1.0 };
    let [k_a, k_d, k_s] = look.parts().map(f64::from);
    std::array::from_fn(|i| {
        let coded = f64::from(coded[i]);
        let linear = if coded <= 0.04045 { coded / 12.92 } else { ((coded + 0.055) / 1.055).powf(2.4) };
        let colour = match material.cap.filter(|_| shown.cap) {
            Some(cap) => f64::from(cap[i]),
            None => f64::from(material.colour[i]) * linear,
        };
        ambient_open * k_a * colour + rest_open * (k_d * colour * diffuse + k_s * specular)
    })
}
