//! What a view's pixels show of a world: the first hit of the ray through the middle of each, or a cap in front of it.

use super::caps::first_cap;
use super::ray::{Hit, first_hit};
use crate::draw::clip_normal::clip_normal;
use cao_model::clip::Clip;
use cao_model::surface::World;
use cao_model::view::View;
use glam::{DVec3, Vec2};

/// What a pixel shows.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// Where; of a cap any triangle of the mesh that is cut.
    pub hit: Hit,
    /// World position in mm.
    pub place: DVec3,
    /// Unit normal of the triangle, or of the clip that cuts, towards the eye.
    pub normal: DVec3,
    /// Whether it is a cap.
    pub cap: bool,
}

/// Rows from the top; `None` where nothing is.
pub fn gbuffer(world: &World, clips: &[Clip], view: &View, [width, height]: [u32; 2]) -> Vec<Option<Shown>> {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
    pixels
        .map(|[x, y]| {
            let uv = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            let (origin, direction) = view.ray(uv);
            let (origin, direction) = (origin.as_dvec3(), direction.as_dvec3());
            let (near, far) = (f64::from(view.near_mm), f64::from(view.far_mm));
            let hit = first_hit(world, clips, origin, direction, near, far);
            let end = hit.map_or(far, |hit| hit.t);
            if let Some(cap) = first_cap(world, clips, origin, direction, near, end) {
                let place = origin + direction * cap.t;
                let hit = Hit { t: cap.t, triangle: cap.triangle, at: [0.0; 2] };
                let normal = clip_normal(&clips[cap.clip], place, -direction);
                return Some(Shown { hit, place, normal, cap: true });
            }
            let hit = hit?;
            let [a, b, c] = world.triangles[hit.triangle].corners.map(|corner| corner.as_dvec3());
            let across = (b - a).cross(c - a).normalize();
            let normal = if across.dot(direction) > 0.0 { -across } else { across };
            Some(Shown { hit, place: origin + direction * hit.t, normal, cap: false })
        })
        .collect()
}
