//! The first triangle that a ray hits, of all of them one after the other.

use super::caps::winding;
use cao_model::clip::{Clip, Mode, Shape};
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

/// Where a line crosses these triangles, from either side, in their order.
pub fn crossings(
    world: &World,
    among: impl Iterator<Item = usize>,
    origin: DVec3,
    direction: DVec3,
) -> Vec<Hit> {
    let crossed = |triangle: usize| {
        let [a, b, c] = world.triangles[triangle].corners.map(|corner| corner.as_dvec3());
        let (ab, ac) = (b - a, c - a);
        let across = direction.cross(ac);
        let volume = ab.dot(across);
        if volume == 0.0 {
            return None;
        }
        let away = origin - a;
        let turned = away.cross(ab);
        let (u, v, t) = (away.dot(across) / volume, direction.dot(turned) / volume, ac.dot(turned) / volume);
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(Hit { t, triangle, at: [u, v] })
    };
    among.filter_map(crossed).collect()
}

/// Whether a clip hides a place; a mesh by the solid angles of its faces.
pub fn hides(clip: &Clip, place: DVec3) -> bool {
    let Shape::Mesh(mesh) = &clip.shape else {
        return clip.hides(place.as_vec3()) == Some(true);
    };
    let local = (clip.pose.to_rigid(place.as_vec3()) / clip.pose.scale).as_dvec3();
    let corners = mesh.triangles.iter().map(|t| t.map(|v| mesh.vertices[v as usize].as_dvec3()));
    (winding(corners, local).abs() > 0.5) == (clip.mode == Mode::Remove)
}

/// The first hit between `begin` and `end`, where masks and these clips leave something.
pub fn first_hit(
    world: &World,
    clips: &[Clip],
    origin: DVec3,
    direction: DVec3,
    begin: f64,
    end: f64,
) -> Option<Hit> {
    let mut first: Option<Hit> = None;
    for hit in crossings(world, 0..world.triangles.len(), origin, direction) {
        if hit.t <= begin || hit.t >= first.map_or(end, |hit| hit.t) {
            continue;
        }
        let triangle = &world.triangles[hit.triangle];
        let [u, v] = hit.at;
        let weights = [1.0 - u - v, u, v].map(|weight| weight as f32);
        let uv: Vec2 = triangle.uvs.iter().zip(weights).map(|(uv, weight)| *uv * weight).sum();
        let material = &world.materials[triangle.material as usize];
        let hidden = !material.spared && clips.iter().any(|clip| hides(clip, origin + direction * hit.t));
        if !hidden && material.is_there(uv) {
            first = Some(hit);
        }
    }
    first
}
