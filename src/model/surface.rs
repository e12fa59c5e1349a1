//! Surfaces to be drawn: triangle meshes with normals, textures and masks, and many of them in one world.
//!
//! Not what [`mesh`](crate::mesh) holds: a clip mesh bounds a solid and needs positions alone. A surface may be open, self-intersecting, flat.
//!
//! Lengths mm at scale 1; colours linear; texture coordinates as glTF has them, (0, 0) at the upper left of the image.

use std::sync::Arc;

use glam::{Quat, Vec2, Vec3};

use crate::clip::Pose;
use crate::mesh::{TriangleMesh, bounds_of};
use crate::{Error, Result};

/// A triangle mesh as files have it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Where it came from (the file, or a generator's name); errors name it.
    pub name: String,
    /// Positions in mm at scale 1.
    pub positions: Vec<Vec3>,
    /// Unit normals for light, one a position; none: the triangles' own.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one a position; or none.
    pub uvs: Vec<Vec2>,
    /// Three indices of positions each, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// The material of each triangle.
    pub material_of: Vec<u32>,
    /// The materials.
    pub materials: Vec<Material>,
}

/// What a surface is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// As the file calls it.
    pub name: String,
    /// Linear r, g, b, 0 … 1; times that of the texture.
    pub colour: [f32; 3],
    /// Opacity, times that of the texture; it decides nothing without `cutoff`.
    pub alpha: f32,
    /// Colours and opacities over the surface.
    pub texture: Option<Arc<Texture>>,
    /// Where opacity is below this there is no surface (AOV §5.3); `None`: there is one everywhere.
    pub cutoff: Option<f32>,
    /// Whether the back is a surface of its own, as of leaves and fences, which occludes what it faces.
    pub two_sided: bool,
    /// Whether clips leave it whole, as an implant that a view is opened for.
    pub spared: bool,
    /// Linear r, g, b of the surface of the cut where clips cut a closed mesh open; `None`: its backs are seen there. All materials of a
    /// surface have the same.
    pub cap: Option<[f32; 3]>,
}

impl Default for Material {
    /// Opaque, of a light grey, with one side.
    fn default() -> Self {
        Self {
            name: "default".into(),
            colour: [0.8; 3],
            alpha: 1.0,
            texture: None,
            cutoff: None,
            two_sided: false,
            spared: false,
            cap: None,
        }
    }
}

/// An image that is repeated over a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Where it came from.
    pub name: String,
    /// Pixels across and down, each at least 1.
    pub size: [u32; 2],
    /// r, g, b as sRGB codes them, and opacity, rows from the top.
    pub texels: Vec<[u8; 4]>,
}

/// A surface at its place in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// What.
    pub surface: Arc<Surface>,
    /// Where, in mm from the world's origin, which is a volume's centre where there is one.
    pub pose: Pose,
}

/// A triangle in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Positions in mm, counter-clockwise seen from the front.
    pub corners: [Vec3; 3],
    /// Unit normals for light.
    pub normals: [Vec3; 3],
    /// Texture coordinates.
    pub uvs: [Vec2; 3],
    /// Its material in [`World::materials`].
    pub material: u32,
    /// The share of it that its mask leaves, ᾱ of AOV §5.3; 1 without one.
    pub opacity: f32,
}

/// All triangles of a scene.
#[derive(Clone, Debug, Default)]
pub struct World {
    /// The triangles, those of each instance together.
    pub triangles: Vec<Triangle>,
    /// All materials.
    pub materials: Vec<Material>,
    /// Of each material the number of its instance.
    pub instance_of: Vec<u32>,
    /// Triangles that were left out because they have no area.
    pub degenerate: usize,
}

/// Most triangles of a world: what a tree's leaf words count, and more than memory holds on most devices.
pub const MOST_TRIANGLES: usize = 1 << 26;

/// Samples along an edge of the grid over a triangle that its opacity is the mean of.
const OPACITY_SAMPLES: u32 = 16;

impl Surface {
    /// Refuses what is no surface, before anything is made of it.
    ///
    /// # Errors
    /// [`Error::Mesh`] when an index has no position or no material, a used position is not finite, normals or texture coordinates are not as
    /// many as positions, a texture does not have its texels, a mask has nothing to be read by, there is no triangle, or caps are asked for where
    /// clips leave it whole, of some of its materials, or of what bounds no solid with its front outwards.
    pub fn check(&self) -> Result<()> {
        let wrong = |problem: String| Err(Error::Mesh { name: self.name.clone(), problem });
        let count = self.positions.len();
        if self.triangles.is_empty() {
            return wrong("has no triangles; there is nothing to draw".into());
        }
        for (what, given) in [("normals", self.normals.len()), ("texture coordinates", self.uvs.len())] {
            if given != 0 && given != count {
                return wrong(format!(
                    "has {given} {what} for {count} positions; expected none, or one each"
                ));
            }
        }
        if self.material_of.len() != self.triangles.len() {
            let (given, expected) = (self.material_of.len(), self.triangles.len());
            return wrong(format!("names the material of {given} triangles of {expected}"));
        }
        for (number, corners) in self.triangles.iter().enumerate() {
            for &corner in corners {
                let Some(at) = self.positions.get(corner as usize) else {
                    return wrong(format!(
                        "triangle {number} names vertex {corner}, but there are only {count}"
                    ));
                };
                if !at.is_finite() {
                    return wrong(format!(
                        "triangle {number} has a vertex at ({}, {}, {}); coordinates must be finite",
                        at.x, at.y, at.z
                    ));
                }
            }
            let material = self.material_of[number] as usize;
            if material >= self.materials.len() {
                let there = self.materials.len();
                return wrong(format!(
                    "triangle {number} is of material {material}, but there are only {there}"
                ));
            }
        }
        for material in &self.materials {
            let named = crate::error::quoted(&material.name);
            if let Some(texture) = &material.texture {
                let [x, y] = texture.size.map(|n| n as usize);
                if x == 0 || y == 0 || texture.texels.len() != x * y {
                    let given = texture.texels.len();
                    return wrong(format!(
                        "material {named}: its texture of {x}×{y} pixels has {given} texels"
                    ));
                }
                if self.uvs.is_empty() {
                    return wrong(format!(
                        "material {named} has a texture, and the mesh no texture coordinates; export them, or take the texture off"
                    ));
                }
            }
        }
        self.check_caps()
    }

    /// Caps are of a solid, whose inside is in front of no face.
    fn check_caps(&self) -> Result<()> {
        let wrong = |problem: String| {
            let problem = format!("cannot have caps: {problem}; or do without caps, which shows its backs");
            Err(Error::Mesh { name: self.name.clone(), problem })
        };
        let cap = self.materials.first().and_then(|material| material.cap);
        if let Some(other) = self.materials.iter().find(|material| material.cap != cap) {
            return wrong(format!(
                "material {} has another cap than the first one; a cut is of the whole mesh: give all the same",
                crate::error::quoted(&other.name)
            ));
        }
        if cap.is_none() {
            return Ok(());
        }
        if self.materials.iter().any(|material| material.spared) {
            return wrong("clips leave it whole, as it is spared; let them cut it".into());
        }
        let mesh = match TriangleMesh::new(&self.name, &self.positions, &self.triangles)
            .and_then(|mesh| mesh.check_solid().map(|()| mesh))
        {
            Ok(mesh) => mesh,
            Err(Error::Mesh { problem, .. }) => return wrong(problem),
            Err(other) => return Err(other),
        };
        if mesh.signed_volume() < 0.0 {
            return wrong("it is inside out; in a mesh editor, flip its faces".into());
        }
        Ok(())
    }

    /// Smallest and largest coordinates of positions in mm.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        bounds_of(self.positions.iter().copied())
    }
}

impl Texture {
    /// Colour (sRGB as coded, 0 … 1) and opacity at a place, bilinear between the four nearest texels, repeated.
    pub fn at(&self, uv: Vec2) -> [f32; 4] {
        let size = self.size.map(|n| n as i64);
        let place = [0, 1].map(|i| {
            let turn = uv[i] - uv[i].floor();
            if turn.is_finite() { turn * size[i] as f32 - 0.5 } else { 0.0 }
        });
        let (first, share) = (place.map(|p| p.floor() as i64), place.map(|p| p - p.floor()));
        let mut mean = [0.0; 4];
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let [x, y] = [(first[0] + dx).rem_euclid(size[0]), (first[1] + dy).rem_euclid(size[1])];
            let part = |d: i64, share: f32| if d == 1 { share } else { 1.0 - share };
            let weight = part(dx, share[0]) * part(dy, share[1]);
            let texel = self.texels[(y * size[0] + x) as usize];
            mean.iter_mut().zip(texel).for_each(|(sum, part)| *sum += weight * f32::from(part) / 255.0);
        }
        mean
    }
}

impl Material {
    /// Whether there is a surface at this place of its texture.
    pub fn is_there(&self, uv: Vec2) -> bool {
        let Some(cutoff) = self.cutoff else { return true };
        let alpha = self.texture.as_ref().map_or(1.0, |texture| texture.at(uv)[3]);
        self.alpha * alpha >= cutoff
    }

    /// The share of a triangle with these texture coordinates that is there.
    fn share(&self, [a, b, c]: [Vec2; 3]) -> f32 {
        if self.cutoff.is_none() {
            return 1.0;
        }
        let (mut there, mut all) = (0, 0);
        for i in 0..OPACITY_SAMPLES {
            for j in 0..OPACITY_SAMPLES - i {
                let at = |k: u32| (k as f32 + 1.0 / 3.0) / OPACITY_SAMPLES as f32;
                let (s, t) = (at(i), at(j));
                there += u32::from(self.is_there(a * (1.0 - s - t) + b * s + c * t));
                all += 1;
            }
        }
        there as f32 / all as f32
    }
}

impl World {
    /// Puts all surfaces in their places.
    ///
    /// # Errors
    /// As [`Surface::check`] and [`Pose::check`]; [`Error::Mesh`] when nothing is left but triangles without area, or a pose leaves no finite
    /// place; [`Error::Limit`] above [`MOST_TRIANGLES`].
    pub fn new(instances: &[Instance]) -> Result<Self> {
        let mut world = Self::default();
        let needed: usize = instances.iter().map(|instance| instance.surface.triangles.len()).sum();
        if needed > MOST_TRIANGLES {
            return Err(Error::Limit {
                what: "triangles of a scene".into(),
                needed: needed as u64,
                limit: MOST_TRIANGLES as u64,
                hint: "leave instances out, or decimate meshes".into(),
            });
        }
        for (number, instance) in instances.iter().enumerate() {
            instance.surface.check()?;
            instance.pose.check()?;
            world.instance_of.extend(instance.surface.materials.iter().map(|_| number as u32));
            world.add(instance)?;
        }
        Ok(world)
    }

    fn add(&mut self, Instance { surface, pose }: &Instance) -> Result<()> {
        let rotation = pose.rotation();
        let place = |p: Vec3| pose.translate_mm + rotation * (pose.scale * p);
        // Normals go by the inverse transpose.
        let turn = |n: Vec3| (rotation * (n / pose.scale)).normalize_or_zero();
        let first = self.materials.len() as u32;
        self.materials.extend(surface.materials.iter().cloned());
        let before = self.triangles.len();
        for (corners, material) in surface.triangles.iter().zip(&surface.material_of) {
            let at = corners.map(|corner| place(surface.positions[corner as usize]));
            let across = (at[1] - at[0]).cross(at[2] - at[0]);
            let length = across.length();
            if !at.iter().all(|corner| corner.is_finite()) || !length.is_finite() {
                return Err(Error::Mesh {
                    name: surface.name.clone(),
                    problem: "its pose puts it beyond what numbers hold; place it nearer, or make it smaller"
                        .into(),
                });
            }
            if length == 0.0 {
                self.degenerate += 1;
                continue;
            }
            let own = across / length;
            let normals = corners.map(|corner| {
                let given = surface.normals.get(corner as usize).map_or(Vec3::ZERO, |n| turn(*n));
                if given.is_normalized() { given } else { own }
            });
            let uvs = corners.map(|corner| surface.uvs.get(corner as usize).copied().unwrap_or(Vec2::ZERO));
            self.triangles.push(Triangle {
                corners: at,
                normals,
                uvs,
                material: first + material,
                opacity: surface.materials[*material as usize].share(uvs),
            });
        }
        if self.triangles.len() == before {
            let problem = format!("all of its {} triangles have no area", surface.triangles.len());
            return Err(Error::Mesh { name: surface.name.clone(), problem });
        }
        Ok(())
    }

    /// The same, turned about the origin: a scene on the axes of its volume.
    pub fn turned(mut self, rotation: Quat) -> Self {
        for triangle in &mut self.triangles {
            triangle.corners = triangle.corners.map(|corner| rotation * corner);
            triangle.normals = triangle.normals.map(|normal| rotation * normal);
        }
        self
    }

    /// Smallest and largest coordinates in mm.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        bounds_of(self.triangles.iter().flat_map(|triangle| triangle.corners))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Surface {
        Surface {
            name: "square".into(),
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
            uvs: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material_of: vec![0; 2],
            materials: vec![Material::default()],
            ..Surface::default()
        }
    }

    fn refusal(surface: Surface) -> String {
        let instance = Instance { surface: Arc::new(surface), pose: Pose::default() };
        World::new(&[instance]).unwrap_err().to_string()
    }

    #[test]
    fn poses_move_turn_and_scale_and_normals_stay_across() {
        let pose = Pose {
            translate_mm: Vec3::new(5.0, 0.0, 0.0),
            rotate_deg: Vec3::new(90.0, 0.0, 0.0),
            scale: Vec3::new(2.0, 3.0, 4.0),
        };
        let mut surface = square();
        surface.normals = vec![Vec3::new(0.6, 0.0, 0.8); 4];
        let world = World::new(&[Instance { surface: Arc::new(surface), pose }]).unwrap();
        let triangle = world.triangles[0];
        assert!((triangle.corners[2] - Vec3::new(7.0, 0.0, 3.0)).length() < 1e-5, "{triangle:?}");
        // (0.6/2, 0, 0.8/4), turned about x.
        let expected = Vec3::new(0.3, -0.2, 0.0).normalize();
        assert!((triangle.normals[0] - expected).length() < 1e-5, "{triangle:?}");
        assert_eq!((triangle.opacity, world.degenerate), (1.0, 0));
    }

    #[test]
    fn a_mask_leaves_its_share() {
        // Left half opaque.
        let texels = vec![[255, 255, 255, 255], [255, 255, 255, 0]];
        let texture = Texture { name: "half".into(), size: [2, 1], texels };
        let mut surface = square();
        surface.materials[0] =
            Material { texture: Some(Arc::new(texture)), cutoff: Some(0.5), ..Material::default() };
        let world = World::new(&[Instance { surface: Arc::new(surface), pose: Pose::default() }]).unwrap();
        let mean = 0.5 * (world.triangles[0].opacity + world.triangles[1].opacity);
        assert!((mean - 0.5).abs() < 0.04, "{mean}");
    }

    #[test]
    fn caps_are_of_solids_as_a_whole() {
        let cube = TriangleMesh::cuboid();
        let with = |change: fn(&mut Surface)| {
            let capped = Material { cap: Some([0.5; 3]), ..Material::default() };
            let mut surface = Surface {
                name: "cube".into(),
                positions: cube.vertices.clone(),
                triangles: cube.triangles.clone(),
                material_of: vec![0; 12],
                materials: vec![capped.clone(), capped],
                ..Surface::default()
            };
            change(&mut surface);
            surface
        };
        let place = |surface| Instance { surface: Arc::new(surface), pose: Pose::default() };
        let world = World::new(&[place(with(|_| ())), place(square())]).unwrap();
        assert_eq!(world.instance_of, [0, 0, 1]);
        for (change, expected) in [
            ((|s: &mut Surface| s.triangles[3] = [0, 1, 2]) as fn(&mut Surface), "does not enclose a solid"),
            (
                |s| s.triangles.iter_mut().for_each(|t| t.swap(0, 1)),
                "inside out; in a mesh editor, flip its faces",
            ),
            (|s| s.materials[1].cap = None, "material \"default\" has another cap than the first one"),
            (|s| s.materials[1].spared = true, "clips leave it whole, as it is spared"),
        ] {
            let message = refusal(with(change));
            let named =
                message.contains("mesh cube: cannot have caps: ") && message.contains("do without caps");
            assert!(named && message.contains(expected), "{message}");
        }
    }

    #[test]
    fn bad_surfaces_are_refused_by_name() {
        let with = |change: fn(&mut Surface)| {
            let mut surface = square();
            change(&mut surface);
            refusal(surface)
        };
        for (message, expected) in [
            (with(|s| s.triangles.clear()), "mesh square: has no triangles"),
            (with(|s| s.triangles[1][0] = 9), "names vertex 9, but there are only 4"),
            (with(|s| s.positions[2].y = f32::NAN), "(1, NaN, 0)"),
            (with(|s| s.material_of[0] = 1), "material 1, but there are only 1"),
            (with(|s| s.normals = vec![Vec3::Z]), "1 normals for 4 positions"),
            (with(|s| s.triangles = vec![[0, 0, 1], [1, 1, 1]]), "all of its 2 triangles have no area"),
            (with(|s| s.positions[1].x = 3e38), "beyond what numbers hold"),
            (
                with(|s| {
                    s.uvs.clear();
                    let texture = Texture { name: "t".into(), size: [1, 1], texels: vec![[0; 4]] };
                    s.materials[0].texture = Some(Arc::new(texture));
                }),
                "no texture coordinates",
            ),
        ] {
            assert!(message.contains(expected), "{message}");
        }
    }
}
