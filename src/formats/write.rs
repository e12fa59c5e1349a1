//! Volumes as NRRD: a value a voxel, or three.

use std::io;
use std::path::Path;

use crate::outputs::Outputs;
use crate::{Error, Result};
use cao_model::error::shown_path;
use cao_model::order::Layout;
use cao_model::volume::{IDENTITY, Space, Volume};

/// Writes one value a voxel of `like` as a NRRD file: 32-bit float, raw, little-endian, x fastest. The file has the order of
/// voxels, the dimensions and the spacing of the one that `like` was read from, and its origin, directions and space if it
/// has any, so that it lies on that file in every program. `content` becomes the field of that name.
///
/// Errors: [`cao_model::Error::Config`] when `data` has not `like.len()` values; [`Error::Io`] as [`Outputs::write`].
pub fn write_nrrd(path: &Path, like: &Volume, data: &[f32], content: &str) -> Result<()> {
    let mut outputs = Outputs::default();
    outputs.nrrd(path, like, data, content)?;
    outputs.commit()
}

impl Outputs {
    /// As [`write_nrrd`], together with other files.
    ///
    /// # Errors
    /// As [`write_nrrd`].
    pub fn nrrd(&mut self, path: &Path, like: &Volume, data: &[f32], content: &str) -> Result<()> {
        self.values(path, like, data.as_chunks::<1>().0, content)
    }

    /// The same of red, green and blue a voxel, the fastest axis of four.
    ///
    /// # Errors
    /// As [`write_nrrd`].
    pub fn nrrd_colours(
        &mut self,
        path: &Path,
        like: &Volume,
        data: &[[f32; 3]],
        content: &str,
    ) -> Result<()> {
        self.values(path, like, data, content)
    }

    fn values<const N: usize>(
        &mut self,
        path: &Path,
        like: &Volume,
        data: &[[f32; N]],
        content: &str,
    ) -> Result<()> {
        if data.len() != like.len() {
            let problem = format!("{} values, expected {} as the volume has voxels", data.len(), like.len());
            return Err(Error::refused(&format!("values for {}", shown_path(path)), problem));
        }
        self.write(path, |out| {
            out.write_all(header(like, content, N > 1).as_bytes())?;
            const PIECE: usize = 1 << 16;
            let mut bytes = Vec::with_capacity(PIECE + 4 * N);
            like.stored_places().try_for_each(|place| {
                bytes.extend(data[place].iter().flat_map(|value| value.to_le_bytes()));
                if bytes.len() >= PIECE {
                    out.write_all(&bytes)?;
                    bytes.clear();
                }
                Ok::<_, io::Error>(())
            })?;
            out.write_all(&bytes)
        })
    }
}

/// Of a value a voxel, or of `coloured` ones.
fn header(like: &Volume, content: &str, coloured: bool) -> String {
    let Layout { dims: [x, y, z], spacing, origin, directions } = like.stored_layout();
    let mut text = String::from("NRRD0004\n");
    // A line end would end the field, and an empty line the header.
    let content = content.split_whitespace().collect::<Vec<_>>().join(" ");
    if !content.is_empty() {
        text += &format!("content: {content}\n");
    }
    // An axis of colours has no place in space.
    let [size, direction, spacing_of, kind] = match coloured {
        true => ["3 ", "none ", "NaN ", "RGB-color "],
        false => [""; 4],
    };
    let dimension = if coloured { 4 } else { 3 };
    text += &format!("type: float\ndimension: {dimension}\nsizes: {size}{x} {y} {z}\n");
    let placed = like.space != Space::Unknown || origin != [0.0; 3] || directions != IDENTITY;
    if placed {
        // `space` must stand before the fields that use it.
        text += match like.space {
            Space::Ras => "space: right-anterior-superior\n",
            Space::Unknown => "space dimension: 3\n",
        };
        let axis = |a: usize| vector(directions[a].map(|d| d * spacing[a]));
        text += &format!("space directions: {direction}{} {} {}\n", axis(0), axis(1), axis(2));
        text += &format!("space origin: {}\n", vector(origin));
    } else {
        let [x, y, z] = spacing;
        text += &format!("spacings: {spacing_of}{x} {y} {z}\n");
    }
    text + &format!("kinds: {kind}domain domain domain\nendian: little\nencoding: raw\n\n")
}

fn vector([x, y, z]: [f64; 3]) -> String {
    format!("({x},{y},{z})")
}
