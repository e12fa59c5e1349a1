//! Ambient occlusion by rays (AOV §6): `AO = (1/π) ∫ max(0, 1 − t(ω)/δ) (ω·n) dω` over the half sphere, by the midpoints of a grid over the unit
//! square, `r² = u`, `φ = 2πv`: another rule than the kernel's sequence, which converges to the same.

use super::caps::first_cap;
use super::ray::first_hit;
use cao_model::clip::Clip;
use cao_model::surface::World;
use glam::DVec3;
use std::f64::consts::TAU;

/// How far over the surface rays begin, in mm: places come from rays in f32.
const START: f64 = 1e-3;

/// At a place with this normal, by `edge`² rays.
pub fn traced(world: &World, clips: &[Clip], place: DVec3, normal: DVec3, delta: f64, edge: u32) -> f64 {
    let tangent = normal.any_orthonormal_vector();
    let bitangent = normal.cross(tangent);
    let origin = place + normal * START;
    let mut sum = 0.0;
    for i in 0..edge {
        for j in 0..edge {
            let at = |k: u32| (f64::from(k) + 0.5) / f64::from(edge);
            let (u, angle) = (at(i), TAU * at(j));
            let ring = u.sqrt();
            let direction =
                tangent * (ring * angle.cos()) + bitangent * (ring * angle.sin()) + normal * (1.0 - u).sqrt();
            let hit = first_hit(world, clips, origin, direction, 0.0, delta).map_or(delta, |hit| hit.t);
            let t = first_cap(world, clips, origin, direction, 0.0, hit).map_or(hit, |cap| cap.t);
            sum += 1.0 - t / delta;
        }
    }
    sum / f64::from(edge).powi(2)
}
