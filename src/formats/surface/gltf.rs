//! glTF 2.0, `.gltf` and `.glb`: the meshes of the default scene, each surface at the places of its nodes.
//!
//! Metres become mm, y up becomes z up: (x, y, z) → 1000·(x, −z, y), so that what faces +z faces −y, where eyes stand. The crate `gltf` reads the JSON and
//! checks that what it names is there; numbers are read by `gltf_data`. Materials: base colour, its texture, opacity by `MASK` with its
//! cutoff; `BLEND` is drawn as a mask at 0.5, since a surface is there or not. Animations, skins and morph targets are not read: meshes stand as stored.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::MAX_BYTES;
use super::gltf_data::{Data, Source, source};
use super::mtl::CUTOFF;
use super::place::placed;
use super::texture::Textures;
use crate::{Error, Result, file};
use cao_model::error::{quoted, shown_path};
use cao_model::surface::{Instance, MOST_TRIANGLES, Material, Surface, Texture};
use glam::{DMat3, DMat4, DQuat, DVec3, Vec2, Vec3};
use gltf::json::Index;
use gltf::json::accessor::Accessor;
use gltf::json::material::{AlphaMode, Material as JsonMaterial};
use gltf::json::mesh::{Mesh, Mode, Primitive, Semantic};
use gltf::json::scene::Node;
use gltf::json::validation::{Checked, Error as Fault, Validate};

/// Mm of a metre.
const MM: f64 = 1000.0;

/// Beginnings of the names of extensions that only concern light, or that numbers are read by anyway.
const KNOWN: [&str; 3] = ["KHR_mesh_quantization", "KHR_materials_", "KHR_lights_punctual"];
/// One of those that does not: its colours are elsewhere.
const ELSEWHERE: &str = "KHR_materials_pbrSpecularGlossiness";

/// Reads the file's instances.
pub(super) fn load(path: &Path) -> Result<Vec<Instance>> {
    let bytes = file::read_bytes(path, MAX_BYTES)?;
    let wrong = |field: &str, problem: String| Error::file(path, field, problem);
    // The reader of the crate takes the head's own size off without looking.
    let length = bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    if bytes.starts_with(b"glTF") && length.is_none_or(|length| length < 12) {
        return Err(wrong("header", "expected 12 bytes and a length of at least as many".into()));
    }
    let read = gltf::Gltf::from_slice_without_validation(&bytes)
        .map_err(|error| wrong("glTF", error.to_string()))?;
    let root = read.document.as_json();
    let strange = |name: &&String| *name == ELSEWHERE || !KNOWN.iter().any(|known| name.starts_with(known));
    if let Some(name) = root.extensions_required.iter().find(strange) {
        return Err(wrong(
            "extensionsRequired",
            format!("{}, which is not read; export without it", quoted(name)),
        ));
    }
    // The crate's own checks panic at this one.
    let there = |primitive: &Primitive| {
        let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
        positions.is_none_or(|index| root.get(*index).is_some())
    };
    if let Some(number) = root.meshes.iter().position(|mesh| !mesh.primitives.iter().all(there)) {
        return Err(wrong(&format!("mesh {number}"), "names a POSITION that is not there".into()));
    }
    let mut fault = None;
    root.validate(root, gltf::json::Path::new, &mut |at, error| {
        // What is required was looked at.
        if error != Fault::Unsupported {
            fault.get_or_insert_with(|| (at().to_string(), error));
        }
    });
    if let Some((at, error)) = fault {
        return Err(wrong(&at, format!("{error}; expected what the specification of glTF 2.0 says")));
    }
    let data = Data::new(path, root, read.blob.as_deref())?;
    Reader {
        data,
        textures: Textures::default(),
        images: HashMap::new(),
        meshes: HashMap::new(),
        positions: 0,
    }
    .scene()
}

struct Reader<'a> {
    data: Data<'a>,
    textures: Textures,
    images: HashMap<usize, Arc<Texture>>,
    meshes: HashMap<usize, Arc<Surface>>,
    /// Positions of all meshes so far.
    positions: usize,
}

impl Reader<'_> {
    fn scene(&mut self) -> Result<Vec<Instance>> {
        let root = self.data.root;
        let number = root.scene.map_or(0, |scene| scene.value());
        let Some(scene) = root.scenes.get(number) else {
            return Err(self.data.wrong("scenes", "has none; export one with the meshes in it"));
        };
        let mut instances = Vec::new();
        let (mut triangles, mut seen) = (0, vec![false; root.nodes.len()]);
        let mut todo: Vec<(Index<Node>, DMat4)> =
            scene.nodes.iter().rev().map(|node| (*node, DMat4::IDENTITY)).collect();
        while let Some((index, outer)) = todo.pop() {
            let field = format!("node {}", index.value());
            let node = root.get(index).ok_or_else(|| self.data.wrong(&field, "is not there"))?;
            if std::mem::replace(&mut seen[index.value()], true) {
                let problem = "is a child twice, or of itself; expected a tree of nodes";
                return Err(self.data.wrong(&field, problem));
            }
            let at = outer
                * own(node).ok_or_else(|| self.data.wrong(&field, "turns by a rotation that is none"))?;
            todo.extend(node.children.iter().flatten().rev().map(|child| (*child, at)));
            let Some(mesh) = node.mesh else { continue };
            let surface = self.mesh(mesh)?;
            triangles += surface.triangles.len();
            if triangles > MOST_TRIANGLES {
                return Err(self
                    .data
                    .wrong(&field, format!("more than {MOST_TRIANGLES} triangles; leave instances out")));
            }
            if !at.is_finite() {
                return Err(self.data.wrong(&field, "stands where no finite numbers are"));
            }
            instances.push(placed(&surface, ours(at)));
        }
        if instances.is_empty() {
            return Err(self
                .data
                .wrong(&format!("scene {number}"), "has no meshes; there is nothing to draw"));
        }
        Ok(instances)
    }

    fn mesh(&mut self, index: Index<Mesh>) -> Result<Arc<Surface>> {
        if let Some(surface) = self.meshes.get(&index.value()) {
            return Ok(surface.clone());
        }
        let field = format!("mesh {}", index.value());
        let mesh = self.data.root.get(index).ok_or_else(|| self.data.wrong(&field, "is not there"))?;
        let named = mesh.name.as_ref().map_or(String::new(), |name| format!(" {}", quoted(name)));
        let mut surface =
            Surface { name: format!("{}, {field}{named}", shown_path(self.data.path)), ..Surface::default() };
        let mut materials = HashMap::new();
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let field = format!("{field}, primitive {number}");
            let key = primitive.material.map(|material| material.value());
            let material = match materials.get(&key) {
                Some(material) => *material,
                None => {
                    surface.materials.push(self.material(primitive.material)?);
                    *materials.entry(key).or_insert(surface.materials.len() as u32 - 1)
                }
            };
            self.primitive(&field, primitive, material, &mut surface)?;
        }
        let surface = Arc::new(surface);
        self.meshes.insert(index.value(), surface.clone());
        Ok(surface)
    }

    fn primitive(
        &mut self,
        field: &str,
        primitive: &Primitive,
        material: u32,
        surface: &mut Surface,
    ) -> Result<()> {
        let data = &self.data;
        let Checked::Valid(mode) = primitive.mode else {
            return Err(data.wrong(field, "of no mode that there is"));
        };
        if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            return Err(
                data.wrong(field, format!("of mode {mode:?}; expected triangles, as only they occlude"))
            );
        }
        let of = |what: Semantic| primitive.attributes.get(&Checked::Valid(what)).copied();
        let Some(at) = of(Semantic::Positions) else {
            return Err(data.wrong(field, "has no POSITION"));
        };
        let claimed =
            |index: Index<Accessor>| data.root.get(index).map_or(0, |accessor| accessor.count.0 as usize);
        self.positions = self.positions.saturating_add(claimed(at).max(primitive.indices.map_or(0, claimed)));
        if self.positions > 3 * MOST_TRIANGLES {
            return Err(
                data.wrong(field, format!("more than {} corners; decimate the meshes", 3 * MOST_TRIANGLES))
            );
        }
        let turn = |[x, y, z]: [f32; 3]| Vec3::new(x, -z, y);
        let positions: Vec<[f32; 3]> = data.numbers(at)?;
        let count = positions.len();
        let fits = |what: &str, given: usize| match given == count {
            true => Ok(()),
            false => {
                Err(data
                    .wrong(field, format!("has {given} of {what} and {count} of POSITION, expected as many")))
            }
        };
        let normals: Option<Vec<[f32; 3]>> =
            of(Semantic::Normals).map(|index| data.numbers(index)).transpose()?;
        normals.as_ref().map_or(Ok(()), |normals| fits("NORMAL", normals.len()))?;
        let texture = primitive
            .material
            .and_then(|index| data.root.get(index))
            .and_then(|material| material.pbr_metallic_roughness.base_color_texture.as_ref());
        let set = texture.map_or(0, |texture| texture.tex_coord);
        let uvs: Option<Vec<[f32; 2]>> =
            of(Semantic::TexCoords(set)).map(|index| data.numbers(index)).transpose()?;
        uvs.as_ref().map_or(Ok(()), |uvs| fits("TEXCOORD", uvs.len()))?;
        if uvs.is_none() && texture.is_some() {
            let name = quoted(&surface.materials[material as usize].name).to_string();
            let problem = format!(
                "without TEXCOORD_{set}, and material {name} has a texture; export it, or take it off"
            );
            return Err(data.wrong(field, problem));
        }
        let indices = match primitive.indices {
            Some(index) => data.indices(index)?,
            None => (0..count as u32).collect(),
        };
        if let Some(index) = indices.iter().find(|index| **index as usize >= count) {
            return Err(data.wrong(field, format!("names vertex {index}, but there are only {count}")));
        }
        // Only what is used: many primitives may name one accessor.
        let first = surface.positions.len();
        let (mut used, mut slots) = (Vec::new(), vec![None; count]);
        let mut slot = |index: u32| {
            *slots[index as usize].get_or_insert_with(|| {
                used.push(index as usize);
                (first + used.len() - 1) as u32
            })
        };
        let indices: Vec<u32> = indices.into_iter().map(&mut slot).collect();
        let before = surface.triangles.len();
        let corners = |three: [usize; 3]| three.map(|i| indices[i]);
        match mode {
            Mode::TriangleStrip => (2..indices.len()).for_each(|i| {
                // Every second one the other way, so that all face the same.
                surface.triangles.push(corners([i - 2, i - 1 + i % 2, i - i % 2]));
            }),
            Mode::TriangleFan => {
                (2..indices.len()).for_each(|i| surface.triangles.push(corners([i - 1, i, 0])))
            }
            _ => surface
                .triangles
                .extend((0..indices.len() / 3).map(|i| corners([3 * i, 3 * i + 1, 3 * i + 2]))),
        }
        surface.material_of.resize(surface.triangles.len(), material);
        if surface.triangles.len() == before {
            return Err(data.wrong(field, "has no triangle; leave it out"));
        }
        surface.positions.extend(used.iter().map(|&i| turn(positions[i]) * MM as f32));
        // What other primitives of the mesh lack is none: their triangles' own, or no place that a texture reads.
        if let Some(normals) = normals {
            surface.normals.resize(first, Vec3::ZERO);
            surface.normals.extend(used.iter().map(|&i| turn(normals[i]).normalize_or_zero()));
        }
        if let Some(uvs) = uvs {
            surface.uvs.resize(first, Vec2::ZERO);
            surface.uvs.extend(used.iter().map(|&i| Vec2::from_array(uvs[i])));
        }
        let all = surface.positions.len();
        if !surface.normals.is_empty() {
            surface.normals.resize(all, Vec3::ZERO);
        }
        if !surface.uvs.is_empty() {
            surface.uvs.resize(all, Vec2::ZERO);
        }
        Ok(())
    }

    fn material(&mut self, index: Option<Index<JsonMaterial>>) -> Result<Material> {
        // Without one: white, opaque, of one side, as the specification has it.
        let white = Material { colour: [1.0; 3], ..Material::default() };
        let Some((number, json)) = index.and_then(|i| Some((i.value(), self.data.root.get(i)?))) else {
            return Ok(white);
        };
        let field = format!("material {number}");
        let base = &json.pbr_metallic_roughness;
        let colour = base.base_color_factor.0;
        if !colour.iter().all(|part| (0.0..=1.0).contains(part)) {
            let problem = format!("baseColorFactor {colour:?}, expected numbers from 0 to 1");
            return Err(self.data.wrong(&field, problem));
        }
        let cutoff = match json.alpha_mode {
            Checked::Valid(AlphaMode::Mask) => Some(json.alpha_cutoff.map_or(CUTOFF, |cutoff| cutoff.0)),
            Checked::Valid(AlphaMode::Blend) => Some(CUTOFF),
            _ => None,
        };
        if let Some(cutoff) = cutoff.filter(|cutoff| !(*cutoff >= 0.0 && cutoff.is_finite())) {
            return Err(self.data.wrong(&field, format!("alphaCutoff {cutoff}, expected a number >= 0")));
        }
        let texture = base.base_color_texture.as_ref().map(|info| info.index);
        Ok(Material {
            name: json.name.clone().unwrap_or_else(|| field.clone()),
            colour: [colour[0], colour[1], colour[2]],
            alpha: colour[3],
            texture: texture.map(|index| self.texture(index, &field)).transpose()?,
            cutoff,
            two_sided: json.double_sided,
            spared: false,
            cap: None,
        })
    }

    fn texture(&mut self, index: Index<gltf::json::Texture>, of: &str) -> Result<Arc<Texture>> {
        let data = &self.data;
        let image = data
            .root
            .get(index)
            .and_then(|texture| Some((texture.source.value(), data.root.get(texture.source)?)));
        let Some((number, image)) = image else {
            return Err(data.wrong(of, "has a texture without an image"));
        };
        if let Some(texture) = self.images.get(&number) {
            return Ok(texture.clone());
        }
        let field = format!("{of}, image {number}");
        let name = image.name.clone().unwrap_or_else(|| "the image".into());
        let name = quoted(&name).to_string();
        let read = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => match source(data.path, uri) {
                Ok(Source::File(path)) => self.textures.load(&path),
                Ok(Source::Bytes(bytes)) => self.textures.decode(&name, &bytes),
                Err(problem) => Err(problem),
            },
            (None, Some(view)) => self.textures.decode(&name, data.view(view)?),
            (None, None) => Err("has neither uri nor bufferView".into()),
        };
        let texture = read.map_err(|problem| data.wrong(&field, problem))?;
        self.images.insert(number, texture.clone());
        Ok(texture)
    }
}

/// The place of a node in its parent; `None` where it turns by a quaternion without direction.
fn own(node: &Node) -> Option<DMat4> {
    if let Some(matrix) = node.matrix {
        return Some(DMat4::from_cols_array(&matrix.map(f64::from)));
    }
    let vector = |of: Option<[f32; 3]>, else_: f64| {
        of.map_or(DVec3::splat(else_), |v| DVec3::from_array(v.map(f64::from)))
    };
    let turn = match node.rotation {
        Some(q) => {
            let q = DQuat::from_array(q.0.map(f64::from));
            let length = q.length();
            if !(length.is_finite() && length > 0.0) {
                return None;
            }
            q / length
        }
        None => DQuat::IDENTITY,
    };
    Some(DMat4::from_scale_rotation_translation(vector(node.scale, 1.0), turn, vector(node.translation, 0.0)))
}

/// A place among y-up metres as one among z-up mm.
fn ours(at: DMat4) -> DMat4 {
    let turn = DMat3::from_cols(DVec3::X, DVec3::Z, -DVec3::Y);
    let linear = turn * DMat3::from_mat4(at) * turn.transpose();
    DMat4::from_translation(turn * at.w_axis.truncate() * MM) * DMat4::from_mat3(linear)
}
