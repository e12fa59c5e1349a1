//! What a view's pixels show of a world: the first hit of the ray through the middle of each.

use super::ray::{Hit, first_hit};
use cao_model::clip::Clip;
use cao_model::surface::World;
use cao_model::view::View;
use glam::{DVec3, Vec2};

/// What a pixel shows.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// Where.
    pub hit: Hit,
    /// World position in mm.
    pub place: DVec3,
    /// Unit normal of the triangle, towards the eye.
    pub normal: DVec3,
}

/// Rows from the top; `None` where nothing is.
pub fn gbuffer(world: &World, clips: &[Clip], view: &View, [width, height]: [u32; 2]) -> Vec<Option<Shown>> {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
    pixels
        .map(|[x, y]| {
            let uv = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            let (origin, direction) = view.ray(uv);
            let (origin, direction) = (origin.as_dvec3(), direction.as_dvec3());
            let hit =
                first_hit(world, clips, origin, direction, f64::from(view.near_mm), f64::from(view.far_mm))?;
            let [a, b, c] = world.triangles[hit.triangle].corners.map(|corner| corner.as_dvec3());
            let across = (b - a).cross(c - a).normalize();
            let normal = if across.dot(direction) > 0.0 { -across } else { across };
            Some(Shown { hit, place: origin + direction * hit.t, normal })
        })
        .collect()
}
