//! What clips leave of each triangle (AOV §5.3's ᾱ): the share of a grid of points over it that none hides, times what its mask leaves.

use cao_model::clip::Clip;
use cao_model::surface::World;

/// Points along an edge of the grid.
const EDGE: u32 = 16;

/// Of each triangle, by clips that are no meshes.
pub fn shares(world: &World, clips: &[Clip]) -> Vec<f64> {
    let of = |triangle: &cao_model::surface::Triangle| {
        let [a, b, c] = triangle.corners;
        let points = (0..EDGE).flat_map(|i| (0..EDGE - i).map(move |j| [i, j]));
        let places = points.map(|point| {
            let [u, v] = point.map(|k| (k as f32 + 1.0 / 3.0) / EDGE as f32);
            a * (1.0 - u - v) + b * u + c * v
        });
        let spared = world.materials[triangle.material as usize].spared;
        let left =
            places.filter(|place| spared || !clips.iter().any(|clip| clip.hides(*place) == Some(true)));
        f64::from(triangle.opacity) * left.count() as f64 / f64::from(EDGE * (EDGE + 1) / 2)
    };
    world.triangles.iter().map(of).collect()
}
