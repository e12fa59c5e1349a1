//! Wavefront OBJ with normals, texture coordinates and materials, as one surface.
//!
//! `tobj` parses numbers and joins corners that are the same; what it trusts is made harmless before (`statements`): indices that
//! would overflow in it, corners of which only some have normals, materials.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::mtl::Library;
use super::texture::Textures;
use super::{MAX_BYTES, two_sided};
use crate::{Error, Result, file, obj, polygon};
use cao_model::clip::Pose;
use cao_model::error::{quoted, shown_path};
use cao_model::surface::{Instance, Material, Surface};
use glam::{Vec2, Vec3};

/// The texture coordinates and the normal of corners without.
const NONE: &str = "vt 0 0\nvn 0 0 0\n";

/// What a file says, its lines made harmless.
#[derive(Default)]
struct Statements {
    /// Lines for the parser: [`NONE`], and as many as the file has.
    geometry: String,
    /// The faces in their order.
    faces: Vec<Face>,
    /// Names of libraries.
    libraries: Vec<String>,
    /// Names of the materials of faces and the lines of their `usemtl`; none before any.
    materials: Vec<Option<(String, usize)>>,
    /// Whether any corner has a normal, or texture coordinates.
    normals: bool,
    uvs: bool,
}

struct Face {
    line: usize,
    material: u32,
    /// Whether all of its corners have texture coordinates.
    uvs: bool,
}

/// Reads the file as one instance at the origin.
pub(super) fn load(path: &Path) -> Result<Vec<Instance>> {
    let bytes = file::read_bytes(path, MAX_BYTES)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let surface = read(path, &String::from_utf8_lossy(&bytes), folder)?;
    Ok(vec![Instance { surface: Arc::new(surface), pose: Pose::default() }])
}

fn read(path: &Path, text: &str, folder: &Path) -> Result<Surface> {
    let said = statements(path, text)?;
    let mut surface = Surface { name: shown_path(path), ..Surface::default() };
    surface.materials = materials(path, &said, folder)?;
    let options = tobj::LoadOptions { single_index: true, ..Default::default() };
    let mut reader = std::io::Cursor::new(said.geometry.as_bytes());
    let no_library = |_: &Path| Err(tobj::LoadError::GenericFailure);
    let (models, _) = tobj::load_obj_buf(&mut reader, &options, no_library).map_err(|error| {
        let of = |what: &str| Error::file(path, "f", format!("a face names a {what} that is not there"));
        match error {
            tobj::LoadError::FaceVertexOutOfBounds => of("vertex"),
            tobj::LoadError::FaceTexCoordOutOfBounds => of("texture coordinate"),
            tobj::LoadError::FaceNormalOutOfBounds => of("normal"),
            // It reads line by line and stops in the one that it cannot read.
            other => {
                let consumed = &said.geometry[NONE.len()..(reader.position() as usize).max(NONE.len())];
                let line = consumed.matches('\n').count();
                let found = text.lines().nth(line.saturating_sub(1)).unwrap_or("");
                Error::file(path, &format!("line {line}"), format!("{other}: {}", quoted(found)))
            }
        }
    })?;
    // There are no lines that begin another model.
    let Some(tobj::Model { mesh, .. }) = models.into_iter().next() else { return Ok(surface) };
    surface.positions = mesh.positions.as_chunks().0.iter().copied().map(Vec3::from_array).collect();
    // No arities: all faces are triangles.
    let three = vec![3; mesh.indices.len() / 3];
    let arities = if mesh.face_arities.is_empty() { &three } else { &mesh.face_arities };
    let mut rest = mesh.indices.as_slice();
    for (face, &arity) in said.faces.iter().zip(arities) {
        let (corners, after) = rest.split_at((arity as usize).min(rest.len()));
        rest = after;
        let wrong = |problem: String| Error::file(path, &format!("line {}: f", face.line), problem);
        let material = &surface.materials[face.material as usize];
        if material.texture.is_some() && !face.uvs {
            let name = quoted(&material.name);
            let remedy = "export them, or take it off";
            return Err(wrong(format!(
                "without texture coordinates, and material {name} has a texture; {remedy}"
            )));
        }
        let places: Vec<Vec3> = corners.iter().map(|&corner| surface.positions[corner as usize]).collect();
        let triangles = polygon::triangles(&places).map_err(wrong)?;
        surface.triangles.extend(triangles.iter().map(|t| t.map(|corner| corners[corner])));
        surface.material_of.extend(triangles.iter().map(|_| face.material));
    }
    if said.uvs {
        // In the file (0, 0) is at the lower left.
        surface.uvs = mesh.texcoords.as_chunks().0.iter().map(|&[u, v]| Vec2::new(u, 1.0 - v)).collect();
    }
    if said.normals {
        let normals = mesh.normals.as_chunks().0.iter().copied().map(Vec3::from_array);
        surface.normals = normals.map(Vec3::normalize_or_zero).collect();
    }
    two_sided(&mut surface);
    Ok(surface)
}

/// The materials that faces use. Libraries that are not there leave the default; one that is there and lacks a material is refused.
fn materials(path: &Path, said: &Statements, folder: &Path) -> Result<Vec<Material>> {
    let (mut library, mut all_there) = (Library::default(), true);
    for name in &said.libraries {
        let file = folder.join(name.replace('\\', "/"));
        match file.exists() {
            true => library.add(&file)?,
            false => all_there = false,
        }
    }
    let mut textures = Textures::default();
    let material = |used: &Option<(String, usize)>| {
        let Some((name, line)) = used else { return Ok(Material::default()) };
        match library.material(name, &mut textures)? {
            Some(material) => Ok(material),
            None if said.libraries.is_empty() || !all_there => {
                Ok(Material { name: name.clone(), ..Material::default() })
            }
            None => {
                let problem =
                    format!("{}: no library of materials has it; expected one of its newmtl", quoted(name));
                Err(Error::file(path, &format!("line {line}: usemtl"), problem))
            }
        }
    };
    said.materials.iter().map(material).collect()
}

/// The lines of a file that matter. Every corner gets a normal and texture coordinates, the first of all, which are none, where it has no
/// others, because the parser wants all or no corners to have them.
fn statements(path: &Path, text: &str) -> Result<Statements> {
    let mut said = Statements::default();
    let mut known = HashMap::new();
    let (mut used, mut material) = (None, None);
    // Positions, texture coordinates, normals so far.
    let mut counts = [0_i64, 1, 1];
    let mut number = 1;
    let mut out = String::from(NONE);
    for (line, lines) in obj::statements(text) {
        let mut words = line.split_whitespace();
        let key = words.next().unwrap_or("");
        let rest = line.trim_start().strip_prefix(key).unwrap_or("").trim();
        let wrong = |problem: String| Err(Error::file(path, &format!("line {number}: {key}"), problem));
        match key {
            "v" => {
                // A fourth number is a weight; six or seven are a position and a colour.
                let words: Vec<&str> = words.collect();
                let take = if words.len() == 4 { 4 } else { 3 };
                out += &format!("v {}", words[..take.min(words.len())].join(" "));
                counts[0] += 1;
            }
            "vt" => {
                // Of one number: the other is 0. A third is depth.
                let (u, v) = (words.next().unwrap_or("x"), words.next().unwrap_or("0"));
                out += &format!("vt {u} {v}");
                counts[1] += 1;
            }
            "vn" => {
                out += &format!("vn {}", words.collect::<Vec<_>>().join(" "));
                counts[2] += 1;
            }
            "f" => {
                let corners: Vec<&str> = words.collect();
                if corners.is_empty() {
                    return wrong("a face without corners".into());
                }
                // One and two corners are points and lines.
                if corners.len() > 2 {
                    let material = *material.get_or_insert_with(|| {
                        let name = used.as_ref().map(|(name, _): &(String, usize)| name.clone());
                        *known.entry(name).or_insert_with(|| {
                            said.materials.push(used.clone());
                            said.materials.len() as u32 - 1
                        })
                    });
                    let mut face = Face { line: number, material, uvs: true };
                    out.push('f');
                    for corner in corners {
                        let Some([v, vt, vn]) = indices(corner, counts) else {
                            return wrong(format!(
                                "{}: expected v, v/vt, v//vn or v/vt/vn, numbers of what is there",
                                quoted(corner)
                            ));
                        };
                        face.uvs &= vt > 1;
                        said.uvs |= vt > 1;
                        said.normals |= vn > 1;
                        out += &format!(" {v}/{vt}/{vn}");
                    }
                    said.faces.push(face);
                }
            }
            "mtllib" if !rest.is_empty() => said.libraries.push(rest.to_owned()),
            "usemtl" => (used, material) = (Some((rest.to_owned(), number)), None),
            _ => {}
        }
        (0..lines).for_each(|_| out.push('\n'));
        number += lines;
    }
    said.geometry = out;
    Ok(said)
}

/// The indices of a corner into what the parser has, which counts [`NONE`]; `None` where they are no numbers, or of nothing before this line.
fn indices(corner: &str, counts: [i64; 3]) -> Option<[i64; 3]> {
    let mut found = [0, 1, 1];
    for (i, word) in corner.split('/').enumerate() {
        if word.is_empty() {
            continue;
        }
        let given: i64 = word.parse().ok().filter(|given| *given != 0 && i32::try_from(*given).is_ok())?;
        let none = i64::from(i > 0);
        let index = if given < 0 { counts.get(i)? + given + 1 } else { given + none };
        *found.get_mut(i)? = Some(index).filter(|index| *index > none)?;
    }
    Some(found).filter(|[v, ..]| *v > 0)
}
