//! What [`super::meshes`] measures: scenes that the program makes, and scans that are put on a ground.

use crate::Result;
use cao_formats::surface::{load, moved};
use cao_model::clip::Pose;
use cao_model::pixel_occlusion::PixelOcclusion;
use cao_model::scenes::BuiltScene;
use cao_model::surface::{Instance, Material, Surface, World};
use cao_model::view::StereoRig;
use glam::Vec3;
use std::path::Path;
use std::sync::Arc;

/// What is known of a scene beside its triangles.
#[derive(Clone, Debug)]
pub struct About {
    /// Name in tables.
    pub name: String,
    /// Name in full.
    pub title: String,
    /// What it is there for.
    pub what: String,
    /// Eyes that see its point.
    pub eye: StereoRig,
    /// How far obscurance reaches, δ in mm.
    pub delta_mm: f32,
    /// Whether the program makes it, and it stands for one of the paper's.
    pub is_built: bool,
}

impl About {
    /// Of one that the program makes.
    pub(super) fn built(scene: &BuiltScene) -> Self {
        Self {
            name: scene.name.into(),
            title: scene.title.into(),
            what: scene.what.into(),
            eye: scene.eye,
            delta_mm: scene.delta_mm,
            is_built: true,
        }
    }
}

/// A scene.
pub struct MeshScene {
    /// What is known of it.
    pub about: About,
    /// Its surfaces at their places.
    pub instances: Vec<Instance>,
}

/// Edge in mm that a scan's longest becomes: as much as there is in the middle of the scenes that the program makes.
const EDGE: f32 = 600.0;

/// Edge of the ground under a scan, of the scan's longest.
const GROUND: f32 = 4.0;

/// Whence a scan is seen, degrees: azimuth and elevation.
const SEEN: [f32; 2] = [30.0, 25.0];

impl MeshScene {
    /// One that the program makes.
    pub fn built(scene: &BuiltScene, detail: u32) -> Self {
        Self { about: About::built(scene), instances: (scene.make)(detail) }
    }

    /// A file of surfaces on a ground, which it occludes as the ground occludes it. Its longest edge becomes 600 mm; it stands on the middle of a square
    /// that is four times as wide. δ is a tenth of its half diagonal, as where nobody names one; both eyes see all of it, 30° from its front and 25° from above.
    /// What has no upward axis of its own (OBJ) stands along y.
    ///
    /// # Errors
    /// Those of the file; a scan without extent.
    pub fn scan(path: &Path) -> Result<Self> {
        let is_obj = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("obj"));
        let turn = Pose { rotate_deg: Vec3::X * if is_obj { 90.0 } else { 0.0 }, ..Pose::default() };
        let turned: Vec<Instance> = load(path)?.into_iter().map(|instance| moved(instance, &turn)).collect();
        let (low, high) = World::new(&turned)?.bounds();
        let scale = EDGE / (high - low).max_element();
        let stand = Vec3::new(0.5 * (low.x + high.x), 0.5 * (low.y + high.y), low.z);
        let pose = Pose { translate_mm: -scale * stand, scale: Vec3::splat(scale), ..Pose::default() };
        let mut instances: Vec<Instance> =
            turned.into_iter().map(|instance| moved(instance, &pose)).collect();
        instances.push(ground(0.5 * GROUND * EDGE));
        let size = scale * (high - low);
        let framed = StereoRig::framing(size.to_array().map(f64::from), SEEN[0], SEEN[1]);
        let middle = Vec3::Z * (0.5 * size.z);
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let about = About {
            title: format!("Scan {name}"),
            what: "a scan on a ground, which has no printed numbers and counts for no claim".into(),
            eye: StereoRig { position: framed.position + middle, target: framed.target + middle, ..framed },
            delta_mm: PixelOcclusion::SHARE * 0.5 * size.length(),
            is_built: false,
            name,
        };
        Ok(Self { about, instances })
    }
}

/// A square at z = 0 that faces up.
fn ground(half: f32) -> Instance {
    let surface = Surface {
        name: "ground".into(),
        positions: [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| Vec3::new(half * x, half * y, 0.0))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material_of: vec![0; 2],
        materials: vec![Material::default()],
        ..Surface::default()
    };
    Instance { surface: Arc::new(surface), pose: Pose::default() }
}
