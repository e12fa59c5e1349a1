//! Wavefront OBJ: the triangles of clip meshes.

use crate::{Result, file, polygon};
use cao_model::error::quoted;
use cao_model::error::shown_path;
use cao_model::mesh::TriangleMesh;
use glam::Vec3;
use std::io::Cursor;
use std::path::Path;

/// Longest file that is read: some five million triangles.
const MAX_BYTES: u64 = 256 << 20;

/// Reads a Wavefront OBJ file: all objects of the file as one mesh. Faces with more than three corners become
/// triangles, concave ones too; points, lines, normals, texture coordinates, colours and materials are ignored.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) when the file cannot be read, [`Error::File`](crate::Error::File) when it is longer than 256 MiB, [`cao_model::Error::Mesh`] naming the file
/// (and the line where there is one) when it is not an OBJ file, has no faces, one that crosses itself, or coordinates that are not finite.
pub fn load(path: &Path) -> Result<TriangleMesh> {
    let name = shown_path(path);
    let bytes = file::read_bytes(path, MAX_BYTES)?;
    parse(name, &String::from_utf8_lossy(&bytes))
}

/// As [`load`], a mesh that can clip.
///
/// # Errors
/// As [`load`] and [`TriangleMesh::check_solid`].
pub fn load_solid(path: &Path) -> Result<TriangleMesh> {
    let mesh = load(path)?;
    mesh.check_solid()?;
    Ok(mesh)
}

/// As [`load`], from the text of an OBJ file; `name` stands for the file in errors.
///
/// # Errors
/// As [`load`], without those of the file.
pub fn parse(name: impl Into<String>, text: &str) -> Result<TriangleMesh> {
    let name = name.into();
    let geometry = geometry_lines(text);
    let mut reader = Cursor::new(geometry.as_bytes());
    let options = tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    // Materials are never asked for: `geometry_lines` leaves no line that names one.
    let read = tobj::load_obj_buf(&mut reader, &options, |_| Err(tobj::LoadError::GenericFailure));
    let models = match read {
        Ok((models, _)) => models,
        Err(tobj::LoadError::FaceVertexOutOfBounds) => {
            let vertices = geometry.lines().filter(|l| l.starts_with('v')).count();
            let problem = format!("a face names a vertex that is not there; the file has {vertices}");
            return Err(cao_model::Error::Mesh { name, problem }.into());
        }
        Err(error) => {
            // tobj reads line by line and stops in the one it cannot read.
            let consumed = &geometry.as_bytes()[..reader.position() as usize];
            let line = consumed.iter().filter(|&&b| b == b'\n').count();
            let found = text.lines().nth(line.saturating_sub(1)).unwrap_or("");
            let problem = format!("line {line}: {error}: {}", quoted(found));
            return Err(cao_model::Error::Mesh { name, problem }.into());
        }
    };
    let mut positions = Vec::new();
    let mut faces = Vec::new();
    // One and two corners are points and lines, which tobj leaves out.
    let is_face = |line: &str| line.starts_with('f') && !matches!(line.split(' ').count(), 2 | 3);
    let mut lines = geometry.lines().zip(1..).filter(|(line, _)| is_face(line));
    for tobj::Model { mesh, .. } in &models {
        let first = positions.len() as u32;
        positions.extend(mesh.positions.chunks_exact(3).map(Vec3::from_slice));
        // No arities: all faces are triangles.
        let triangles = vec![3; mesh.indices.len() / 3];
        let arities = if mesh.face_arities.is_empty() { &triangles } else { &mesh.face_arities };
        let mut rest = mesh.indices.as_slice();
        for &arity in arities {
            let (face, after) = rest.split_at((arity as usize).min(rest.len()));
            rest = after;
            let corners: Vec<Vec3> = face.iter().map(|&v| positions[(first + v) as usize]).collect();
            let line = lines.next().map_or(0, |(_, line)| line);
            let triangles = polygon::triangles(&corners).map_err(|problem| cao_model::Error::Mesh {
                name: name.clone(),
                problem: format!("line {line}: {problem}"),
            })?;
            faces.extend(triangles.iter().map(|t| t.map(|corner| first + face[corner])));
        }
    }
    Ok(TriangleMesh::new(name, &positions, &faces)?)
}

/// The lines of an OBJ file that make geometry (positions, and the position index of each face corner), every other
/// line left empty so that line numbers stay. tobj trusts what it does not need here: a texture index near the
/// largest integer overflows in it, a malformed material file panics, half-coloured vertices are refused.
fn geometry_lines(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for (line, lines) in statements(text) {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let words: Vec<&str> = words.collect();
                // A fourth number is a weight; six or seven are a position and a colour.
                let take = if words.len() == 4 { 4 } else { 3 };
                out.push('v');
                words.iter().take(take).for_each(|word| {
                    out.push(' ');
                    out.push_str(word);
                });
            }
            Some("f") => {
                out.push('f');
                words.for_each(|word| {
                    out.push(' ');
                    out.push_str(word.split('/').next().unwrap_or(""));
                });
            }
            _ => {}
        }
        (0..lines).for_each(|_| out.push('\n'));
    }
    out
}

/// The statements of an OBJ file, each with how many lines it takes. Those of geometry are without comments: in a name `#` is a character.
pub(crate) fn statements(text: &str) -> impl Iterator<Item = (String, usize)> {
    let mut lines = text.lines();
    std::iter::from_fn(move || {
        let mut line = lines.next()?.to_owned();
        let mut count = 1;
        if line.trim_start().starts_with(['v', 'f']) {
            // A backslash continues a line; in a comment or a name it is only a character.
            while line.ends_with('\\') {
                line.pop();
                line.push_str(lines.next().unwrap_or(""));
                count += 1;
            }
            let end = line.find('#').unwrap_or(line.len());
            line.truncate(end);
        }
        Some((line, count))
    })
}
