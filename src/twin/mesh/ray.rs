//! The first triangle that a ray hits, of all of them one after the other.

use cao_model::clip::Clip;
use cao_model::surface::World;
use glam::{DVec3, Vec2};

/// A hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Way in the direction's lengths.
    pub t: f64,
    /// Which triangle of the world.
    pub triangle: usize,
    /// Weights of its second and third corner.
    pub at: [f64; 2],
}

/// The first hit between `begin` and `end`, where masks and these clips, which are no meshes, leave something.
pub fn first_hit(
    world: &World,
    clips: &[Clip],
    origin: DVec3,
    direction: DVec3,
    begin: f64,
    end: f64,
) -> Option<Hit> {
    let mut first: Option<Hit> = None;
    for (index, triangle) in world.triangles.iter().enumerate() {
        let [a, b, c] = triangle.corners.map(|corner| corner.as_dvec3());
        let (ab, ac) = (b - a, c - a);
        let across = direction.cross(ac);
        let volume = ab.dot(across);
        if volume == 0.0 {
            continue;
        }
        let away = origin - a;
        let turned = away.cross(ab);
        let (u, v, t) = (away.dot(across) / volume, direction.dot(turned) / volume, ac.dot(turned) / volume);
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        if !inside || t <= begin || t >= first.map_or(end, |hit| hit.t) {
            continue;
        }
        let weights = [1.0 - u - v, u, v].map(|weight| weight as f32);
        let uv: Vec2 = triangle.uvs.iter().zip(weights).map(|(uv, weight)| *uv * weight).sum();
        let place = (origin + direction * t).as_vec3();
        let material = &world.materials[triangle.material as usize];
        let hidden = !material.spared && clips.iter().any(|clip| clip.hides(place) == Some(true));
        if !hidden && material.is_there(uv) {
            first = Some(Hit { t, triangle: index, at: [u, v] });
        }
    }
    first
}
