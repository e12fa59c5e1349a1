//! How many occlusion volumes hold a place (AOV Fig. 5, §6): the triangles whose g is above 0 there.

use crate::mesh::occluder::{Volume, holds};
use cao_model::surface::World;
use glam::DVec3;

/// At a place.
pub fn overdraw(world: &World, place: DVec3, volume: Volume) -> usize {
    let two_sided = |material: u32| world.materials[material as usize].two_sided;
    world.triangles.iter().filter(|t| holds(t, two_sided(t.material), place, volume)).count()
}
