//! Built-in scenes of meshes: procedural, without files, each the same at every call.
//!
//! They stand for the scenes of AOV figures 9 to 11, whose models are not ours: each keeps what one of them is there for. A scene is about
//! 1000 mm across, z is up, its ground near z = 0. What is a solid is closed and faces outwards. `detail` divides the same shapes more finely
//! (or, of leaves, has more of them), so that a test takes few triangles and a chart many; triangles grow with its square. Sines come from
//! the system's library: another one may change the last digit of a coordinate.

mod colonnade;
mod fence;
mod house;
mod level;
mod parts;
mod relief;
mod suburb;
mod trees;

use glam::Vec3;

use crate::error::quoted;
use crate::surface::Instance;
use crate::view::StereoRig;
use crate::{Error, Result};

/// A scene that the program makes.
#[derive(Debug)]
pub struct BuiltScene {
    /// Name in scene files, on the command line and in charts.
    pub name: &'static str,
    /// Name in full.
    pub title: &'static str,
    /// What it is there for.
    pub what: &'static str,
    /// Makes it, the finer the larger the detail, which is 1 … [`BuiltScene::MOST_DETAIL`].
    pub make: fn(u32) -> Vec<Instance>,
    /// The detail of charts.
    pub detail: u32,
    /// Eyes that see its point, in pictures of 16:9.
    pub eye: StereoRig,
    /// How far obscurance reaches, δ in mm: what one would choose for it.
    pub delta_mm: f32,
}

/// Every built-in scene, in the order of AOV figure 9 as far as there is one.
pub static SCENES: &[BuiltScene] = &[
    BuiltScene {
        name: "colonnade",
        title: "Colonnade",
        what: "columns, beams and galleries of one hall, near and far, as Sponza has them",
        make: colonnade::make,
        detail: 4,
        eye: eye([-555.0, -60.0, 130.0], [200.0, 40.0, 150.0], 55.0),
        delta_mm: 90.0,
    },
    BuiltScene {
        name: "fence",
        title: "Chain-link fence",
        what: "a fence of few triangles whose mask has the wires, over a ground that it occludes a little",
        make: fence::make,
        detail: 4,
        eye: eye([-330.0, -620.0, 260.0], [20.0, 30.0, 90.0], 40.0),
        delta_mm: 80.0,
    },
    BuiltScene {
        name: "house",
        title: "House",
        what: "stairs, windows and a porch: steps of depth that are small beside the distance",
        make: house::make,
        detail: 4,
        eye: eye([-420.0, -780.0, 330.0], [0.0, -40.0, 190.0], 42.0),
        delta_mm: 60.0,
    },
    BuiltScene {
        name: "trees",
        title: "Trees",
        what: "very many masked leaves behind one another, over uneven ground",
        make: trees::make,
        detail: 4,
        eye: eye([-50.0, -720.0, 210.0], [0.0, 20.0, 150.0], 40.0),
        delta_mm: 70.0,
    },
    BuiltScene {
        name: "relief",
        title: "Relief",
        what: "an ornament of braids, rosettes and masonry, of triangles as small as pixels",
        make: relief::make,
        detail: 6,
        eye: eye([-170.0, -860.0, 420.0], [0.0, 0.0, 330.0], 42.0),
        delta_mm: 40.0,
    },
    BuiltScene {
        name: "level",
        title: "Level of boxes",
        what: "a level of 10⁵ triangles (detail 3) to 10⁶ (detail 9): crates, pillars, catwalks, pipes",
        make: level::make,
        detail: 3,
        eye: eye([-430.0, -560.0, 330.0], [30.0, 20.0, 20.0], 42.0),
        delta_mm: 40.0,
    },
    BuiltScene {
        name: "suburb",
        title: "Suburb",
        what: "all that methods fail at: layers close to one another, slopes, poles before a distance, a large occluder beside the picture",
        make: suburb::make,
        detail: 4,
        eye: eye([-40.0, -560.0, 95.0], [10.0, 100.0, 70.0], 48.0),
        delta_mm: 70.0,
    },
];

impl BuiltScene {
    /// Most detail: of `level` that is 3.6 million triangles.
    pub const MOST_DETAIL: u32 = 16;

    /// The scene called `name`.
    ///
    /// # Errors
    /// [`Error::Config`] with the names that there are.
    pub fn parse(name: &str) -> Result<&'static Self> {
        SCENES.iter().find(|scene| scene.name == name).ok_or_else(|| {
            let names: Vec<_> = SCENES.iter().map(|scene| scene.name).collect();
            Error::refused("builtin", format!("{}: expected {}", quoted(name), names.join(", ")))
        })
    }

    /// The scene in its own detail.
    pub fn instances(&self) -> Vec<Instance> {
        (self.make)(self.detail)
    }
}

/// Eyes a hand's breadth apart in a world as large as a model.
const fn eye(position: [f32; 3], target: [f32; 3], fov_deg: f32) -> StereoRig {
    StereoRig {
        position: Vec3::from_array(position),
        target: Vec3::from_array(target),
        up: Vec3::Z,
        ipd_mm: 30.0,
        fov_deg,
        screen_mm: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Bvh;
    use crate::mesh::TriangleMesh;
    use crate::surface::{Triangle, World};

    /// Pixels of the pictures that tests look at.
    const SIZE: [u32; 2] = [48, 27];

    /// The nearest triangle that a ray meets, masks read, and how far away.
    fn hit(world: &World, bvh: &Bvh, from: Vec3, towards: Vec3) -> Option<(f32, Triangle)> {
        let (mut nearest, mut node) = (None::<(f32, Triangle)>, 0);
        while let Some(n) = bvh.nodes.get(node) {
            let (a, b) = ((n.low - from) / towards, (n.high - from) / towards);
            let (begin, end) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
            if begin > end || nearest.is_some_and(|(t, _)| begin > t) {
                node = n.skip as usize;
                continue;
            }
            for &item in &bvh.order[n.first as usize..(n.first + n.count) as usize] {
                let triangle = world.triangles[item as usize];
                let [a, b, c] = triangle.corners;
                let (ab, ac) = (b - a, c - a);
                let p = towards.cross(ac);
                let inverse = 1.0 / ab.dot(p);
                let s = (from - a).dot(p) * inverse;
                let q = (from - a).cross(ab);
                let (t, u) = (ac.dot(q) * inverse, towards.dot(q) * inverse);
                if s >= 0.0 && u >= 0.0 && s + u <= 1.0 && t > 0.0 && nearest.is_none_or(|(best, _)| t < best)
                {
                    let uv = triangle.uvs[0] * (1.0 - s - u) + triangle.uvs[1] * s + triangle.uvs[2] * u;
                    if world.materials[triangle.material as usize].is_there(uv) {
                        nearest = Some((t, triangle));
                    }
                }
            }
            node += 1;
        }
        nearest
    }

    /// What occludes and is not in the picture.
    const OFF_SCREEN: &str = "off screen";

    fn tree(world: &World) -> Bvh {
        let bounds = |t: &Triangle| crate::mesh::bounds_of(t.corners);
        Bvh::new(&world.triangles.iter().map(bounds).collect::<Vec<_>>())
    }

    #[test]
    fn scenes_are_found_by_name_and_are_the_same_every_time() {
        assert_eq!(SCENES.len(), 7);
        for scene in SCENES {
            assert_eq!(BuiltScene::parse(scene.name).unwrap().title, scene.title);
            let [one, other] = [(); 2].map(|()| World::new(&(scene.make)(1)).unwrap());
            assert_eq!(one.triangles, other.triangles, "{}", scene.name);
        }
        let refusal = BuiltScene::parse("sponza").unwrap_err().to_string();
        assert!(refusal.starts_with("builtin: \"sponza\": expected colonnade, fence, house"), "{refusal}");
    }

    /// As docs/formats.md states them.
    #[test]
    fn scenes_have_as_many_triangles_as_stated() {
        for (name, low, high) in [
            ("colonnade", 6912, 50_688),
            ("fence", 728, 8360),
            ("house", 1928, 28_928),
            ("trees", 6896, 23_900),
            ("relief", 4644, 154_344),
            ("level", 15_940, 131_012),
            ("suburb", 6780, 104_832),
        ] {
            let scene = BuiltScene::parse(name).unwrap();
            for (detail, expected) in [(1, low), (scene.detail, high)] {
                let world = World::new(&(scene.make)(detail)).unwrap();
                assert_eq!((world.triangles.len(), world.degenerate), (expected, 0), "{name}, {detail}");
                let (low, high) = world.bounds();
                assert!((high - low).max_element() <= 1300.0, "{name}: {low} {high}");
            }
        }
    }

    /// What is no sheet is closed and faces outwards.
    #[test]
    fn solids_are_solids() {
        for scene in SCENES {
            for instance in (scene.make)(2) {
                let surface = &instance.surface;
                let one_sided = surface.triangles.iter().zip(&surface.material_of);
                let one_sided = one_sided.filter(|(_, m)| !surface.materials[**m as usize].two_sided);
                let solid: Vec<_> = one_sided.map(|(corners, _)| *corners).collect();
                // A height field of ground is the one surface that is open.
                if solid.is_empty() || surface.name == "trees meadow" {
                    continue;
                }
                let mesh = TriangleMesh::new(&surface.name, &surface.positions, &solid).unwrap();
                mesh.check_solid().unwrap();
                assert!(mesh.signed_volume() > 0.0, "{}", surface.name);
            }
        }
    }

    #[test]
    fn eyes_see_the_scene_from_its_outside() {
        for scene in SCENES {
            let world = World::new(&(scene.make)(1)).unwrap();
            let bvh = tree(&world);
            let (mut seen, mut nearest, mut beside) = (0, f32::INFINITY, 0);
            for view in scene.eye.views(16.0 / 9.0, 1.0, 1e5).unwrap() {
                for pixel in 0..SIZE[0] * SIZE[1] {
                    let at = |i: u32, n: u32| (i as f32 + 0.5) / n as f32;
                    let uv = glam::Vec2::new(at(pixel % SIZE[0], SIZE[0]), at(pixel / SIZE[0], SIZE[1]));
                    let (from, towards) = view.ray(uv);
                    let Some((t, triangle)) = hit(&world, &bvh, from, towards) else { continue };
                    assert_ne!(
                        world.materials[triangle.material as usize].name, OFF_SCREEN,
                        "{}",
                        scene.name
                    );
                    beside += u32::from(hit(&world, &bvh, from + 0.999 * t * towards, -Vec3::X).is_some_and(
                        |(d, other)| {
                            d < scene.delta_mm && world.materials[other.material as usize].name == OFF_SCREEN
                        },
                    ));
                    let [a, b, c] = triangle.corners;
                    let front = (b - a).cross(c - a).dot(towards) < 0.0;
                    assert!(
                        front || world.materials[triangle.material as usize].two_sided,
                        "{}: the back of a solid at {}",
                        scene.name,
                        from + t * towards
                    );
                    (seen, nearest) = (seen + 1, f32::min(nearest, t));
                }
            }
            let share = seen as f32 / (2 * SIZE[0] * SIZE[1]) as f32;
            assert!(share > 0.6 && nearest > 20.0, "{}: {share}, from {nearest} mm on", scene.name);
            assert_eq!(
                beside > 9,
                scene.name == "suburb",
                "{}: {beside} places beside what is not seen",
                scene.name
            );
        }
    }

    /// The fence's few triangles let through what its mask does; leaves are many, masked, and have two sides.
    #[test]
    fn masks_are_where_they_belong() {
        for scene in SCENES {
            let masked = |t: &&Triangle| t.opacity < 1.0;
            let world = World::new(&(scene.make)(scene.detail.min(4))).unwrap();
            let sheets: Vec<_> = world.triangles.iter().filter(masked).collect();
            match scene.name {
                "fence" => {
                    assert_eq!(sheets.len(), 4);
                    // Two bands of 4·WIRE each, of which a product is common.
                    let expected = 1.0 - (1.0 - 4.0 * 0.055_f32).powi(2);
                    for sheet in sheets {
                        assert!((sheet.opacity - expected).abs() < 0.05, "{} {expected}", sheet.opacity);
                    }
                }
                "trees" => {
                    assert!(sheets.len() * 2 > world.triangles.len());
                    assert!(sheets.iter().all(|sheet| sheet.opacity > 0.1 && sheet.opacity < 0.6));
                }
                _ => assert_eq!(sheets.len(), 0, "{}", scene.name),
            }
            let two_sided = world.materials.iter().filter(|m| m.two_sided == m.cutoff.is_none()).count();
            assert_eq!(two_sided, 0, "{}: sheets, and they alone, have two sides", scene.name);
        }
    }
}
