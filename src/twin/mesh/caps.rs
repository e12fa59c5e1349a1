//! Caps: where a ray, inside closed meshes that ask for it, comes out of what clips hide. By short steps along the ray, halved at the change, and by solid angles:
//! neither of shapes nor of crossings of rays does this rule know anything.

use super::ray::{crossings, hides};
use cao_model::clip::Clip;
use cao_model::mesh::bounds_of;
use cao_model::surface::World;
use glam::DVec3;
use std::f64::consts::PI;

/// Steps along a ray, in mm: what is hidden, or shows between, for less is left out.
pub const STEP: f64 = 0.1;

/// Halvings of a step.
const HALVINGS: u32 = 40;

/// A place of a cut.
#[derive(Clone, Copy, Debug)]
pub struct Cap {
    /// Way in the direction's lengths.
    pub t: f64,
    /// A triangle of the mesh that is cut.
    pub triangle: usize,
    /// The clip that cuts it there.
    pub clip: usize,
}

/// How often the surface of these triangles goes around a place (Van Oosterom and Strackee 1983).
pub fn winding(triangles: impl Iterator<Item = [DVec3; 3]>, place: DVec3) -> f64 {
    let angle = |corners: [DVec3; 3]| {
        let [a, b, c] = corners.map(|corner| corner - place);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * a.dot(b.cross(c)).atan2(below)
    };
    triangles.map(angle).sum::<f64>() / (4.0 * PI)
}

/// The first cap between `begin` and `end`.
pub fn first_cap(
    world: &World,
    clips: &[Clip],
    origin: DVec3,
    direction: DVec3,
    begin: f64,
    end: f64,
) -> Option<Cap> {
    let capped = |&index: &usize| world.materials[world.triangles[index].material as usize].cap.is_some();
    let faces: Vec<usize> = (0..world.triangles.len()).filter(capped).collect();
    if faces.is_empty() || clips.is_empty() {
        return None;
    }
    let (low, high) = bounds_of(faces.iter().flat_map(|index| world.triangles[*index].corners));
    let ways = [(low.as_dvec3() - origin) / direction, (high.as_dvec3() - origin) / direction];
    let near = ways[0].min(ways[1]).max_element().max(begin);
    let far = ways[0].max(ways[1]).min_element().min(end);
    if near >= far {
        return None;
    }
    let step = STEP / direction.length();
    let hidden = |t: f64| clips.iter().position(|clip| hides(clip, origin + direction * t));
    let mut was = hidden(near);
    for i in 1.. {
        let t = (near + f64::from(i) * step).min(far);
        let is = hidden(t);
        if was.is_some() && is.is_none() {
            let (mut before, mut behind) = (near + f64::from(i - 1) * step, t);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (before + behind);
                if hidden(middle).is_some() { before = middle } else { behind = middle }
            }
            if let Some(triangle) = around(world, &faces, origin, direction, behind) {
                return Some(Cap { t: behind, triangle, clip: hidden(before).expect("a clip hides it") });
            }
        }
        if t >= far {
            return None;
        }
        was = is;
    }
    None
}

/// Of the meshes around a place, a triangle by which the ray leaves the first of them.
fn around(world: &World, faces: &[usize], origin: DVec3, direction: DVec3, t: f64) -> Option<usize> {
    let instance = |index: usize| world.instance_of[world.triangles[index].material as usize];
    let mut bodies: Vec<u32> = faces.iter().map(|index| instance(*index)).collect();
    bodies.dedup();
    let place = origin + direction * t;
    let leaves = |body: u32| {
        let of_it = faces.iter().copied().filter(|index| instance(*index) == body);
        let corners =
            of_it.clone().map(|index| world.triangles[index].corners.map(|corner| corner.as_dvec3()));
        if winding(corners, place) < 0.5 {
            return None;
        }
        let behind = crossings(world, of_it, origin, direction).into_iter().filter(|hit| hit.t > t);
        behind.min_by(|a, b| a.t.total_cmp(&b.t))
    };
    let first = bodies.into_iter().filter_map(leaves).min_by(|a, b| a.t.total_cmp(&b.t));
    first.map(|hit| hit.triangle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ray::first_hit;
    use cao_model::clip::{Pose, Shape};
    use cao_model::mesh::TriangleMesh;
    use cao_model::surface::{Instance, Material, Surface};
    use glam::Vec3;
    use std::sync::Arc;

    /// A cube from -10 to 10 with one from -4 to 4 in it, of which a plane leaves what is below 3.
    #[test]
    fn a_cut_is_in_the_plane_and_of_the_innermost() {
        let cube = |scale: f32| {
            let mesh = TriangleMesh::cuboid();
            let material = Material { cap: Some([scale; 3]), ..Material::default() };
            let surface = Surface {
                positions: mesh.vertices,
                material_of: vec![0; 12],
                triangles: mesh.triangles,
                materials: vec![material],
                ..Surface::default()
            };
            Instance {
                surface: Arc::new(surface),
                pose: Pose { scale: Vec3::splat(scale), ..Pose::default() },
            }
        };
        let world = World::new(&[cube(10.0), cube(4.0)]).unwrap();
        let at = |z: f32| Pose { translate_mm: Vec3::Z * z, ..Pose::default() };
        let above = [Clip { pose: at(3.0), ..Clip::remove(Shape::Plane) }];
        let down = |x: f64, z: f64, clips: &[Clip]| {
            let (origin, direction) = (DVec3::new(x, 0.3, z), DVec3::NEG_Z * 2.0);
            let end = first_hit(&world, clips, origin, direction, 0.0, 50.0).map_or(50.0, |hit| hit.t);
            first_cap(&world, clips, origin, direction, 0.0, end)
                .map(|cap| (cap.t, world.triangles[cap.triangle].material, cap.clip))
        };
        let near = |found: Option<(f64, u32, usize)>, t: f64, material: u32, clip: usize| {
            let (is, of, by) = found.expect("a cap");
            assert!((is - t).abs() < 1e-5 && (of, by) == (material, clip), "{is} of {of} by {by}, not {t}");
        };
        near(down(0.2, 30.0, &above), 13.5, 1, 0);
        near(down(7.0, 30.0, &above), 13.5, 0, 0);
        // From within what is hidden; from below it nothing is cut.
        near(down(7.0, 5.0, &above), 1.0, 0, 0);
        assert!(down(7.0, 2.0, &above).is_none() && down(12.0, 30.0, &above).is_none());
        assert!(down(7.0, 30.0, &[]).is_none());
        // On through what hides together; and of what is between two clips the first.
        let slab = |z: f32, half: f32| Clip {
            pose: Pose { scale: Vec3::new(50.0, 50.0, half), ..at(z) },
            ..Clip::remove(Shape::Box)
        };
        near(down(7.0, 30.0, &[slab(1.0, 3.0), slab(6.0, 5.0)]), 16.0, 0, 0);
        // That between them is a surface of the mesh first, from inside.
        near(down(7.0, 8.0, &[slab(5.0, 1.0), slab(0.0, 1.0)]), 2.0, 0, 0);
    }
}
