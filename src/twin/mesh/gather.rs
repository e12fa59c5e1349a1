//! Ambient occlusion volumes (AOV §5): `AO(x) = Σ_P g_P(x)·AO_P(x)` over all triangles, before it is cut off at 1.

use super::occluder::{Volume, contribution};
use cao_model::surface::World;
use glam::DVec3;

/// At a place of a surface with this normal, within `delta` mm.
pub fn gathered(world: &World, place: DVec3, normal: DVec3, delta: f64) -> f64 {
    gathered_in(world, place, normal, Volume { delta, clamped: false })
}

/// The same, by volumes of a kind.
pub fn gathered_in(world: &World, place: DVec3, normal: DVec3, volume: Volume) -> f64 {
    let two_sided = |material: u32| world.materials[material as usize].two_sided;
    let all = world.triangles.iter();
    all.map(|triangle| contribution(triangle, two_sided(triangle.material), place, normal, volume)).sum()
}
